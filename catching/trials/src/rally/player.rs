//! A robot that catches and throws in its own world.

use std::time::Instant;

use nalgebra::{Vector2, Vector3};
use tactnet_catching::Robot;
use tactnet_catching::flight::DRAG;
use tactnet_catching::safety::Bodies;
use tactnet_catching::throw::{
    Aim, NoThrow, THROW_JOINTS, THROW_UNKNOWNS, ThrowJoints, ThrowMotion, ThrowPlan,
    ThrowPlanConfig, ThrowRequest, Thrower, Way, WayRequest, throw_joint,
};
use tactnet_catching_packets::packets::{HandCommand, JointCommand};
use tactnet_catching_packets::{ARMS, JOINTS, RobotDescription};
use tactnet_catching_world::{OpenCommand, Released, Sensed, TICK_NS, World};

use crate::error::TrialError;
use crate::stepped_time::{nanoseconds, ticks};
use crate::throw_config::ThrowConfig;

/// Time before the release at which the hand receives its command, in s.
const TOLD: f64 = 0.05;
/// Standstill after the return in s, because the torso oscillates.
const SETTLES: f64 = 3.0;
/// Minimum distance of bodies on the way back, in m.
const MARGIN: f64 = 0.015;
/// Share of the maximum speeds on the way back.
const PACE: f64 = 0.4;

/// A robot with its world.
pub(crate) struct Player {
    /// Settings of the stack, with the robot's limits for catching.
    pub config: ThrowConfig,
    pub world: World,
    thrower: Thrower,
    throwing: Robot,
    bodies: Bodies,
    /// Commanded joint positions.
    pub q: [f64; JOINTS],
    /// Joint positions at the start of the last swing.
    begun: [f64; JOINTS],
    /// Learnt corrections of each arm.
    pub learnt: [Learnt; ARMS],
}

/// Learnt correction of an arm's throws.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Learnt {
    /// Offset of the aim from the target, in m.
    pub beside: Vector2<f64>,
    /// Solution of the last throw, the starting point of the next.
    last: Option<[f64; THROW_UNKNOWNS]>,
}

/// An executed throw.
#[derive(Debug, Clone)]
pub(crate) struct Throw {
    pub plan: ThrowPlan,
    pub released: Released,
    /// Planning time on one core, in ms.
    pub plan_ms: f64,
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
        throws: ThrowPlanConfig,
        seed: u64,
    ) -> Result<Self, TrialError> {
        let throwing = Robot::new(description.clone());
        let q = config.ready();
        Ok(Self {
            world: World::new(description, &config.world, seed, &q)?,
            thrower: Thrower::new(&throwing, throws),
            bodies: Bodies::new(description),
            throwing,
            begun: q,
            q,
            learnt: [Learnt::default(); ARMS],
            config: config.clone(),
        })
    }

    /// Throws the ball in hand `arm`, with an aim in this robot's frame.
    ///
    /// - `late`: delay of the release command, in s
    ///
    /// # Errors
    /// An impossible throw or an empty hand.
    pub fn throw(&mut self, arm: usize, aim: Aim, late: f64) -> Result<Throw, TrialError> {
        let holds = self.world.holding().get(arm) == Some(&true);
        let aim = match aim {
            Aim::At { target } => {
                let beside = self.learnt[arm.min(ARMS - 1)].beside;
                Aim::At {
                    target: target + Vector3::new(beside.x, beside.y, 0.0),
                }
            }
            farthest => farthest,
        };
        let asked = Instant::now();
        let plan = self.thrower.plan(&ThrowRequest {
            q: self.q,
            holding: holds.then_some(arm),
            aim,
            drag: DRAG,
            last: self.learnt.get(arm).and_then(|learnt| learnt.last),
        })?;
        self.learnt[arm].last = Some(plan.unknowns);
        let plan_ms = asked.elapsed().as_secs_f64() * 1e3;
        self.begun = plan.motion.at(plan.motion.swing_begin()).0;
        let torques = self.carry_out(&plan.motion, arm, late)?;
        let released = *self.world.released().ok_or(NoThrow::NoBall)?;
        Ok(Throw {
            plan,
            released,
            plan_ms,
            torques,
        })
    }

    fn carry_out(
        &mut self,
        motion: &ThrowMotion,
        arm: usize,
        late: f64,
    ) -> Result<ThrowJoints, TrialError> {
        let start_ns = self.world.time_ns();
        let open_ns = start_ns + nanoseconds(motion.release() + late);
        let ahead = self.config.timing.drives;
        let mut torques = [0.0f64; THROW_JOINTS];
        let mut told = false;
        for tick in 0..=ticks(motion.end() + ahead) {
            if !told && self.world.time_ns() + nanoseconds(TOLD) >= open_ns {
                self.world.open(&OpenCommand { arm, open_ns })?;
                told = true;
            }
            let sensed = self.step(motion.at(tick as f64 * 1e-3 + ahead), &[None; ARMS]);
            for (i, greatest) in torques.iter_mut().enumerate() {
                let torque = sensed.joints.tau[throw_joint(arm, i)];
                *greatest = greatest.max(torque.abs());
            }
        }
        Ok(torques)
    }

    /// Returns to the waiting pose and waits until the torso is at rest. Returns false if the robot would touch
    /// itself on the way.
    pub fn go_home(&mut self) -> bool {
        let home = self.config.ready();
        let request = WayRequest {
            from: &self.q,
            to: &home,
            over: &self.begun,
            margin: MARGIN,
            pace: PACE,
        };
        let way = Way::free(&self.throwing, &self.bodies, &request);
        let Ok(way) = way else {
            return false;
        };
        for tick in 0..=ticks(way.end() + SETTLES) {
            self.step(way.at(tick as f64 * 1e-3), &[None; ARMS]);
        }
        true
    }

    /// Advances by a tick.
    pub fn step(
        &mut self,
        (q, dq): ([f64; JOINTS], [f64; JOINTS]),
        hands: &[Option<HandCommand>; ARMS],
    ) -> Sensed {
        self.q = q;
        let now_ns = self.world.time_ns();
        let command = JointCommand {
            number: now_ns / TICK_NS,
            command_ns: now_ns,
            q,
            dq,
        };
        *self.world.step(&command, hands)
    }

    /// Returns the robot with its limits for throwing.
    pub fn throwing(&self) -> &Robot {
        &self.throwing
    }
}
