//! A robot that catches and throws in its own world, with the whole stack.

use tactnet_catching::Robot;
use tactnet_catching::pose::TORSO_RESTS;
use tactnet_catching::throw::{NoThrow, THROW_JOINTS, ThrowJoints, ThrowPlan, throw_joint};
use tactnet_catching::throw_back::{ThrowBack, ThrowTask};
use tactnet_catching_packets::packets::{ControllerMode, HandState};
use tactnet_catching_packets::{ARMS, RobotDescription};
use tactnet_catching_world::{Released, Sensed, World};

use crate::error::TrialError;
use crate::stepped_stack::SteppedStack;
use crate::stepped_time::ticks;
use crate::throw_config::ThrowConfig;

/// Maximum time of a throw with the return before it, and of a return with the rest after it, in s.
const LONGEST: f64 = 60.0;

pub(crate) struct Player {
    /// Settings of the stack, with the robot's limits for catching.
    pub config: ThrowConfig,
    pub world: World,
    pub stack: SteppedStack,
    /// Robot with its limits for throwing.
    pub throwing: Robot,
    /// Delay of releases, in ns.
    pub late_ns: i64,
    /// Number of balls held so far.
    grips: u64,
    held: bool,
}

#[derive(Debug, Clone)]
pub(crate) struct Throw {
    pub plan: ThrowPlan,
    pub released: Released,
    /// Maximum torques of turn and arm until the robot stands still, in Nm.
    pub torques: ThrowJoints,
}

impl Player {
    /// Creates a robot in its waiting pose.
    ///
    /// - `description`: description with the limits of the turn in throws
    pub fn new(
        config: &ThrowConfig,
        description: &RobotDescription,
        throws: ThrowBack,
        seed: u64,
    ) -> Result<Self, TrialError> {
        let config = ThrowConfig {
            still: TORSO_RESTS,
            ..config.clone()
        };
        let throwing = Robot::new(description.clone());
        let q = config.robot.waiting();
        let mut stack = SteppedStack::new(&config, q, None, 0)?;
        stack.throws_with(&config, &throwing, throws);
        Ok(Self {
            world: World::new(description, &config.world, seed, &q)?,
            stack,
            throwing,
            config,
            late_ns: 0,
            grips: 0,
            held: false,
        })
    }

    /// Returns the thrower.
    pub fn thrower(&mut self) -> &mut ThrowTask {
        let thrower = self.stack.thrower.as_mut();
        thrower.expect("every player throws")
    }

    /// Throws the ball in hand `arm` as soon as the robot waits.
    ///
    /// # Errors
    /// An impossible throw, an empty hand, or a robot that brakes.
    pub fn throw(&mut self, arm: usize) -> Result<Throw, TrialError> {
        if self.world.holding().get(arm) != Some(&true) {
            return Err(NoThrow::NoBall.into());
        }
        let (begun_ns, failed) = (self.world.time_ns(), self.thrower().failed().0);
        let mut torques = [0.0f64; THROW_JOINTS];
        for _ in 0..ticks(LONGEST) {
            let sensed = self.tick();
            for (i, greatest) in torques.iter_mut().enumerate() {
                let torque = sensed.joints.tau[throw_joint(arm, i)];
                *greatest = greatest.max(torque.abs());
            }
            let released = self.world.released().copied();
            let throws = self.stack.mode() == Some(ControllerMode::Throwing);
            let thrower = self.thrower();
            match (released, thrower.last()) {
                (_, Some(Err(no_throw))) if thrower.failed().0 > failed => {
                    return Err((*no_throw).into());
                }
                _ if thrower.failed().0 > failed => break,
                (Some(released), Some(Ok(plan))) if released.at_ns > begun_ns && !throws => {
                    return Ok(Throw {
                        plan: *plan,
                        released,
                        torques,
                    });
                }
                _ => {}
            }
        }
        Err(TrialError::NotThrown {
            reason: self.thrower().failed().1.into(),
        })
    }

    /// Waits until the robot is in its waiting pose and its torso is at rest. Its hands must be empty.
    ///
    /// # Errors
    /// A robot that does not get there.
    pub fn rest(&mut self) -> Result<(), TrialError> {
        for _ in 0..ticks(LONGEST) {
            if self.stack.waits_at_rest(self.world.time_ns()) {
                return Ok(());
            }
            self.tick();
        }
        Err(TrialError::NotBack)
    }

    /// Advances by a tick.
    pub fn tick(&mut self) -> Sensed {
        let commands = self.stack.step(self.world.time_ns(), None);
        for mut opening in commands.openings.into_iter().flatten() {
            opening.open_ns = opening.open_ns.saturating_add_signed(self.late_ns);
            self.world.tell_opening(&opening);
        }
        let sensed = *self.world.step(&commands.joints, &commands.hands);
        self.stack.sense(&sensed, &self.world.truth());
        let holding = self.world.holding();
        let arm = (0..ARMS).find(|arm| holding[*arm]);
        self.grips += u64::from(arm.is_some() && !self.held);
        self.held = arm.is_some();
        self.stack.hold(HandState {
            t_ns: self.world.time_ns(),
            arm: arm.unwrap_or_default() as u32,
            holds: u32::from(self.held),
            grip: self.grips,
        });
        sensed
    }
}
