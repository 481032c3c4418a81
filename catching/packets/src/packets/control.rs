//! Orders to the controller, and the states of controller, safety monitor and coordinator.

use tactnet_packet::{Text, choices, packets};

use super::ArmPath;

packets! {
    /// Order to the controller.
    #[derive(PartialEq)] #[version(1)]
    pub struct ControllerCommand {
        /// Time of the command, in ns.
        #[recorded(1)] pub command_ns: u64,
        /// A [`ControllerOrder`].
        #[recorded(2)] pub command: u64,
        /// Reason, as text padded with zeros.
        #[recorded(3)] pub reason: Text<64>,
    }

    /// State of the controller and the paths that it executes.
    #[derive(PartialEq)] #[version(1)]
    pub struct ControllerState {
        /// Time, in ns.
        #[recorded(1)] pub t_ns: u64,
        /// A [`ControllerMode`].
        #[recorded(2)] pub mode: u64,
        /// Number of rejected paths since the start.
        #[recorded(3)] pub refused: u64,
        /// Number of control cycles since the start.
        #[recorded(4)] pub beats: u64,
        /// Longest time from the start of a control cycle to its command since the previous packet, in ns.
        #[recorded(5)] pub loop_ns: u64,
        /// Reason for the current mode.
        #[recorded(6)] pub reason: Text<64>,
        /// Paths of the arms: left, right. `start_ns` is 0 for an arm at rest.
        #[recorded(7)] pub paths: [ArmPath; 2],
    }

    /// Result of the self-collision check of one command.
    #[derive(PartialEq)] #[version(1)]
    pub struct SafetyState {
        /// Command number.
        #[recorded(1)] pub number: u64,
        /// Time of the command, in ns.
        #[recorded(2)] pub command_ns: u64,
        /// Smallest lower bound of any distance during the braking motion, in m.
        #[recorded(3)] pub bound: f64,
        /// Computing time of the check, in ns.
        #[recorded(4)] pub computing_ns: u64,
        /// Index of the pair of bodies with the smallest bound.
        #[recorded(5)] pub pair: u32,
        /// 1 if the motion is safe, otherwise 0.
        #[recorded(6)] pub go: u32,
    }

    /// Phase of the catch and its reason.
    #[derive(PartialEq)] #[version(1)]
    pub struct CatchStatus {
        /// Time, in ns.
        #[recorded(1)] pub t_ns: u64,
        /// A [`CatchPhase`].
        #[recorded(2)] pub phase: u64,
        /// Start of the phase, in ns.
        #[recorded(3)] pub since_ns: u64,
        /// Number of failed plans since the start.
        #[recorded(4)] pub no_plans: u64,
        /// Reason for the phase.
        #[recorded(5)] pub reason: Text<64>,
    }

    /// Inputs of one step of the coordinator by their stamps, which are 0 for missing inputs. With it, a recording of
    /// the coordinator can be replayed.
    #[derive(PartialEq)] #[version(1)]
    pub struct CoordinatorStep {
        /// Time of the step, in ns.
        #[recorded(1)] pub now_ns: u64,
        /// Time of the latest joint state, in ns.
        #[recorded(2)] pub joints_ns: u64,
        /// Time of the latest head pose, in ns.
        #[recorded(3)] pub head_ns: u64,
        /// Time of the latest state of the controller, in ns.
        #[recorded(4)] pub controller_ns: u64,
        /// Exposure time of the predictions since the last step, in ns.
        #[recorded(5)] pub exposure_ns: u64,
        /// Number of results of each planner since the last step: left, right.
        #[recorded(6)] pub results: [u64; 2],
    }
}

choices! {
    /// Order to the controller.
    pub enum ControllerOrder {
        /// Brake all joints.
        Brake = 1,
        /// Return to the waiting pose.
        GoBack = 2,
    }

    /// Mode of the controller.
    pub enum ControllerMode {
        /// Rests in the waiting pose and accepts paths.
        Ready = 1,
        /// Executes paths.
        Following = 2,
        /// Brakes.
        Braking = 3,
        /// Rests outside the waiting pose and accepts no paths.
        Standing = 4,
        /// Returns to the waiting pose.
        GoingBack = 5,
        /// Rests, because no collision-free way back was found.
        Stuck = 6,
        /// Executes a throw.
        Throwing = 7,
    }

    /// Phase of the coordinator.
    pub enum CatchPhase {
        /// At least one process has not reported yet.
        Starting = 1,
        /// Waits for a ball.
        Armed = 2,
        /// A ball is valid, but no catch is planned.
        Tracking = 3,
        /// At least one arm executes a catch motion.
        Reaching = 4,
        /// The hands have received their last closing time.
        Closed = 5,
        /// Returns to the waiting pose.
        GoingBack = 6,
        /// Brakes or rests after braking.
        Braking = 7,
        /// No collision-free way back was found.
        Stuck = 8,
        /// Throws a ball back.
        Throwing = 9,
    }
}
