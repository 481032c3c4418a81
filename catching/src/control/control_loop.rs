//! The controller as a step function: packets in, a joint command out, at 1 kHz.

use tactnet_catching_packets::JOINTS;
use tactnet_catching_packets::packets::{
    ArmPath, BodyPath, ControllerCommand, ControllerMode, ControllerOrder, ControllerState, Gaze,
    JointCommand, JointState, SafetyState, ThrowPath,
};

use super::controller::Controller;
use crate::calibrate::Corrections;
use crate::safety::{Bodies, PAIRS};

/// Number of steps between state packets while the state does not change.
const STATE_EVERY: u64 = 20;
/// Maximum number of commands after a verdict of the monitor for which it still counts.
const VERDICT_COUNTS: u64 = 50;

/// Settings of the controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlConfig {
    /// Delay from a step to the time that its command applies to, in ns.
    pub drives_ns: u64,
    /// Timeout without verdicts of the safety monitor after which the controller brakes, in ns.
    pub patience_ns: u64,
    /// Makes the controller brake if the monitor predicts a collision.
    pub brakes: bool,
}

/// Inputs of one step. All slices hold the packets since the last step.
#[derive(Debug, Clone, Copy, Default)]
pub struct ControlInputs<'a> {
    /// Latest state of the joints, as measured.
    pub joints: Option<&'a JointState>,
    /// Latest verdict of the safety monitor.
    pub verdict: Option<&'a SafetyState>,
    /// Orders.
    pub orders: &'a [ControllerCommand],
    /// Paths of the arms.
    pub paths: &'a [ArmPath],
    /// Throws.
    pub throws: &'a [ThrowPath],
    /// Paths of platform and torso.
    pub bodies: &'a [BodyPath],
    /// Gaze targets.
    pub gazes: &'a [Gaze],
}

/// Packets that one step sends.
#[derive(Debug, Clone, Copy)]
pub struct ControlOutputs {
    /// Command to the drives.
    pub command: JointCommand,
    /// State of the controller, when it changes and every 20 ms, with a loop time of 0.
    pub state: Option<ControllerState>,
}

/// Control loop of one robot.
#[derive(Debug, Clone)]
pub struct ControlLoop {
    corrections: Corrections,
    config: ControlConfig,
    waiting: [f64; JOINTS],
    bodies: Bodies,
    /// Present from the first joint state on.
    controller: Option<Box<Controller>>,
    begun_ns: u64,
    /// Number of the last joint state.
    sample: u64,
    /// Number of commands.
    number: u64,
    told: Option<ControllerMode>,
}

impl ControlLoop {
    /// Creates a loop that begins with the first joint state.
    pub fn new(corrections: Corrections, config: ControlConfig) -> Self {
        Self {
            bodies: Bodies::new(corrections.robot().description()),
            waiting: *corrections.waiting(),
            corrections,
            config,
            controller: None,
            begun_ns: 0,
            sample: 0,
            number: 0,
            told: None,
        }
    }

    /// Changes the waiting pose. Call it before the first step.
    pub fn wait_in(&mut self, waiting: [f64; JOINTS]) {
        self.waiting = waiting;
    }

    /// Takes the packets since the last step and returns the next command, or `None` before the first joint state.
    pub fn step(&mut self, now_ns: u64, inputs: &ControlInputs<'_>) -> Option<ControlOutputs> {
        self.begin(now_ns, inputs.joints);
        let effect_ns = now_ns + self.config.drives_ns;
        let seen_ns = inputs.verdict.map_or(0, |verdict| verdict.command_ns);
        let silent_ns = now_ns.saturating_sub(seen_ns.max(self.begun_ns));
        let silent = silent_ns > self.config.patience_ns;
        let controller = self.controller.as_mut()?;
        for order in inputs.orders {
            match order.order() {
                Some(ControllerOrder::Brake) => controller.brake(order.reason.as_str()),
                // The robot moves only while the safety monitor is alive.
                Some(ControllerOrder::GoBack) if !silent => controller.go_back(),
                Some(ControllerOrder::GoBack) | None => {}
            }
        }
        // The state packet reports refusals.
        for path in inputs.paths {
            let _ = controller.arm_path(effect_ns, path);
        }
        for path in inputs.throws {
            let _ = controller.throw_path(effect_ns, path);
        }
        for path in inputs.bodies {
            let _ = controller.body_path(path);
        }
        for gaze in inputs.gazes {
            controller.gaze(effect_ns, gaze);
        }
        if silent {
            controller.brake("the monitor of self-collisions is silent");
        } else if let Some(verdict) = inputs.verdict {
            self.obey(verdict);
        }
        let came = !(inputs.paths.is_empty() && inputs.throws.is_empty());
        self.answer(now_ns, effect_ns, came)
    }

    /// Starts the controller at the first joint state, and again if restarted drives may be at other positions.
    fn begin(&mut self, now_ns: u64, joints: Option<&JointState>) {
        let Some(joints) = joints else {
            return;
        };
        let restarted = self.controller.is_none() || joints.number < self.sample;
        if restarted && joints.q.iter().all(|q| q.is_finite()) {
            if self.controller.is_none() {
                self.begun_ns = now_ns;
            }
            let (robot, q) = (self.corrections.robot(), self.corrections.links(&joints.q));
            let controller = Controller::new(robot.clone(), self.waiting, &q);
            self.controller = Some(Box::new(controller));
        }
        self.sample = joints.number;
    }

    /// Brakes a moving robot if the safety monitor demands it.
    fn obey(&mut self, verdict: &SafetyState) {
        use ControllerMode::{Following, GoingBack, Throwing};
        let counts = verdict.number + VERDICT_COUNTS > self.number;
        let stop = self.config.brakes && verdict.go == 0 && counts;
        let moves = |mode| matches!(mode, Following | GoingBack | Throwing);
        if let Some(controller) = self.controller.as_mut()
            && stop
            && moves(controller.mode())
        {
            let [a, b] = self.bodies.names(verdict.pair as usize % PAIRS);
            controller.brake(&format!("{a} and {b} would come too near"));
        }
    }

    fn answer(&mut self, now_ns: u64, effect_ns: u64, came: bool) -> Option<ControlOutputs> {
        let controller = self.controller.as_mut()?;
        let (q, dq) = controller.tick(effect_ns);
        let (q, dq) = (*q, *dq);
        let torso_brakes = controller.brakes_torso(effect_ns).into();
        let changed = came || self.told != Some(controller.mode());
        self.told = Some(controller.mode());
        let due = changed || self.number.is_multiple_of(STATE_EVERY);
        self.number += 1;
        Some(ControlOutputs {
            command: self.corrections.command(&JointCommand {
                number: self.number,
                command_ns: now_ns,
                q,
                dq,
                torso_brakes,
            }),
            state: due.then(|| controller.state(now_ns)),
        })
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_catching_packets::packets::Text;

    use super::*;
    use crate::ramp::Ramp;
    use crate::robot::Robot;

    const TICK_NS: u64 = 1_000_000;
    const CONFIG: ControlConfig = ControlConfig {
        drives_ns: 3 * TICK_NS,
        patience_ns: 50 * TICK_NS,
        brakes: true,
    };

    fn order(order: ControllerOrder, why: &str) -> ControllerCommand {
        ControllerCommand {
            command_ns: 0,
            command: order as u64,
            reason: Text::new(why),
        }
    }

    /// A loop with its packets, in ticks of 1 ms.
    struct Bench {
        control: ControlLoop,
        joints: JointState,
        verdict: SafetyState,
        now_ns: u64,
    }

    impl Bench {
        fn new() -> Self {
            let robot = Robot::nominal();
            let mut joints = JointState::zeroed();
            joints.number = 100;
            joints.q = robot.waiting();
            let mut verdict = SafetyState::zeroed();
            verdict.go = 1;
            Self {
                control: ControlLoop::new(Corrections::new(&robot, None), CONFIG),
                joints,
                verdict,
                now_ns: 0,
            }
        }

        /// Performs a step in which the monitor has answered the last command.
        fn step(&mut self, inputs: ControlInputs<'_>) -> ControlOutputs {
            self.verdict.command_ns = self.now_ns;
            self.now_ns += TICK_NS;
            self.joints.number += 1;
            let inputs = ControlInputs {
                joints: Some(&self.joints),
                verdict: Some(&self.verdict),
                ..inputs
            };
            self.control.step(self.now_ns, &inputs).unwrap()
        }

        fn mode(&self) -> ControllerMode {
            self.control.controller.as_ref().unwrap().mode()
        }

        /// Sends a motion of an arm joint by 0.2 rad.
        fn send_path(&mut self) -> ControlOutputs {
            let state = self.step(ControlInputs::default()).state;
            let mut path = state.unwrap().paths[0];
            path.start_ns = self.now_ns + 6 * TICK_NS;
            let q = path.ramps[6].q0;
            path.ramps[6] = Ramp::between(q, 0.0, q + 0.2, 0.5, 2.0).packet();
            self.step(ControlInputs {
                paths: &[path],
                ..ControlInputs::default()
            })
        }

        /// Runs until the arm is in motion.
        fn move_on(&mut self) {
            self.send_path();
            for _ in 0..100 {
                self.step(ControlInputs::default());
            }
        }
    }

    #[test]
    fn commands_follow_paths_and_the_state_is_told_when_it_changes_and_every_20_steps() {
        let mut bench = Bench::new();
        let nothing = ControlInputs::default();
        assert!(bench.control.step(0, &nothing).is_none(), "no joint state");
        let sent = bench.send_path();
        assert_eq!(bench.mode(), ControllerMode::Following);
        assert_eq!((sent.command.number, sent.state.unwrap().refused), (2, 0));
        let told: Vec<u64> = (0..40)
            .filter_map(|_| bench.step(nothing).state)
            .map(|state| state.beats)
            .collect();
        assert_eq!(told, [21, 41]);
        let moved = bench.step(nothing).command;
        assert!(moved.dq.iter().filter(|dq| **dq != 0.0).count() == 1);
    }

    #[test]
    fn a_verdict_brakes_a_moving_robot_and_an_old_one_or_one_that_only_reports_does_not() {
        for (brakes, is_old, mode) in [
            (true, false, ControllerMode::Braking),
            (false, false, ControllerMode::Following),
            (true, true, ControllerMode::Following),
        ] {
            let mut bench = Bench::new();
            bench.control.config.brakes = brakes;
            bench.move_on();
            let number = if is_old { 10 } else { bench.control.number };
            (bench.verdict.go, bench.verdict.number) = (0, number);
            bench.step(ControlInputs::default());
            assert_eq!(bench.mode(), mode);
        }
    }

    #[test]
    fn a_silent_monitor_brakes_and_forbids_the_way_back() {
        let mut bench = Bench::new();
        bench.send_path();
        let seen_ns = bench.now_ns;
        bench.verdict.command_ns = seen_ns;
        let order = order(ControllerOrder::GoBack, "over");
        let mut step = |now_ns: u64, orders: &[ControllerCommand]| {
            let inputs = ControlInputs {
                verdict: Some(&bench.verdict),
                orders,
                ..ControlInputs::default()
            };
            bench.control.step(now_ns, &inputs).unwrap();
            bench.control.controller.as_ref().unwrap().mode()
        };
        let patient_ns = seen_ns + CONFIG.patience_ns;
        assert_eq!(step(patient_ns, &[]), ControllerMode::Following);
        assert_eq!(step(patient_ns + TICK_NS, &[]), ControllerMode::Braking);
        let later = seen_ns + 10 * CONFIG.patience_ns;
        assert_eq!(step(later, &[]), ControllerMode::Standing);
        assert_eq!(step(later + TICK_NS, &[order]), ControllerMode::Standing);
    }

    #[test]
    fn orders_are_obeyed_and_restarted_drives_restart_the_controller() {
        let mut bench = Bench::new();
        bench.move_on();
        let brake = order(ControllerOrder::Brake, "asked");
        let told = bench.step(ControlInputs {
            orders: &[brake],
            ..ControlInputs::default()
        });
        assert_eq!(bench.mode(), ControllerMode::Braking);
        assert_eq!(told.state.unwrap().reason.as_str(), "asked");
        bench.joints.number = 3;
        bench.step(ControlInputs::default());
        assert_eq!(bench.mode(), ControllerMode::Ready);
    }
}
