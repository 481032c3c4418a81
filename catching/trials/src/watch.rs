//! The monitor of self-collisions beside a throw: it watches, on the way to the catch and on the way back, and does not brake.

use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::control::Trail;
use tactnet_catching::coordinate::Coordinator;
use tactnet_catching::safety::{Bodies, Monitor, MonitorConfig, PAIRS, distance};
use tactnet_catching_packets::JOINTS;
use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_world::TICK_NS;

/// Arms end their motion within so many ticks after a throw.
const MOST_AFTER: u64 = 1000;

/// Which part of a throw's motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Motion {
    /// Towards the balls, until the arms stand.
    Out,
    /// Back to where the robot waits.
    Back,
}

/// A command at which the monitor would have braked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Braked {
    /// On which way.
    pub motion: Motion,
    /// When, s after the throw; on the way back, s after its begin.
    pub since: f64,
    /// Bodies that it holds for too near.
    pub bodies: [&'static str; 2],
    /// Least distance of all pairs of bodies, had it braked, m.
    pub braked_apart: f64,
    /// True if braking would have kept all bodies farther apart than the margin.
    pub in_vain: bool,
    /// Least distance of all pairs of bodies from there on, had the robot carried on on this way, looked at every millisecond, m.
    pub carried_on: f64,
}

/// A monitor with what it has seen.
pub(crate) struct Watch {
    monitor: Monitor,
    trail: Trail,
    braked: Option<Braked>,
}

impl Braked {
    /// Returns true if nobody would have missed the brake: the robot, had it carried on, would have stayed farther apart than the margin.
    pub fn is_false(&self) -> bool {
        self.carried_on >= MonitorConfig::default().margin
    }
}

impl Watch {
    /// Begins with a robot that stands in `ready`.
    pub fn new(robot: &Robot, ready: &[f64; JOINTS]) -> Self {
        let bodies = Bodies::new(robot.description());
        Self {
            monitor: Monitor::new(bodies, *robot.joints(), MonitorConfig::default(), ready),
            trail: Trail::new(ready),
            braked: None,
        }
    }

    /// Judges a command on the way out, `since` seconds after the throw.
    pub fn look(&mut self, command: &JointCommand, since: f64) {
        self.trail.push(&command.q);
        self.judge(command, since, Motion::Out);
    }

    /// Goes on until the arms stand, then back the same way, and returns the first command at which the monitor would have braked.
    pub fn end(mut self, coordinator: &mut Coordinator, from_ns: u64) -> Option<Braked> {
        for tick in 0..MOST_AFTER {
            let (q, dq) = coordinator.tick(from_ns + tick * TICK_NS);
            self.look(&command(q, dq), f64::NAN);
            if dq.iter().all(|dq| *dq == 0.0) {
                break;
            }
        }
        if self.braked.is_none() {
            self.trail.turn_round();
            for tick in 0_u32.. {
                let (q, dq, there) = self.trail.back();
                self.judge(&command(q, dq), f64::from(tick) * 1e-3, Motion::Back);
                if there {
                    break;
                }
            }
        }
        self.braked
    }

    fn judge(&mut self, command: &JointCommand, since: f64, motion: Motion) {
        let ruling = self.monitor.judge(command);
        if !ruling.go && self.braked.is_none() {
            let least = self.monitor.least_while_braking(command);
            self.braked = Some(Braked {
                motion,
                since,
                bodies: self.monitor.bodies().names(ruling.pair),
                braked_apart: least,
                in_vain: least >= self.monitor.config().margin,
                carried_on: f64::INFINITY,
            });
        }
        if let Some(braked) = self
            .braked
            .as_mut()
            .filter(|braked| braked.motion == motion)
        {
            for pair in 0..PAIRS {
                let [a, b] = self.monitor.bodies().placed(pair, &command.q);
                braked.carried_on = braked.carried_on.min(distance(&a, &b));
            }
        }
    }
}

fn command(q: [f64; JOINTS], dq: [f64; JOINTS]) -> JointCommand {
    JointCommand {
        number: 0,
        command_ns: 0,
        q,
        dq,
    }
}
