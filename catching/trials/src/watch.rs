//! Self-collision monitor during a throw. It observes the motion to the catch and back, and does not brake.

use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::control::Controller;
use tactnet_catching::safety::{Bodies, Monitor, MonitorConfig, PAIRS, distance};
use tactnet_catching_packets::JOINTS;
use tactnet_catching_packets::packets::{ControllerMode, JointCommand};
use tactnet_catching_world::TICK_NS;

/// Maximum number of ticks after a throw until the arms stand still.
const MOST_AFTER: u64 = 1000;
/// Maximum number of ticks on the way back, which takes at most twice as long as the way out.
const MOST_BACK: u64 = 20_000;

/// Phase of a throw's motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Motion {
    /// Towards the balls, until the arms stand still.
    Out,
    /// Return to the waiting pose.
    Back,
}

/// A command at which the monitor would have braked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Braked {
    /// Phase of the motion.
    pub motion: Motion,
    /// Time after the throw in s; on the way back, time after its start.
    pub since: f64,
    /// Bodies that the monitor considers too close.
    pub bodies: [&'static str; 2],
    /// Minimum distance of all pairs of bodies if the robot had braked, in m.
    pub braked_apart: f64,
    /// True for a false stop: braking would have kept all distances above the margin.
    pub in_vain: bool,
    /// Minimum distance of all pairs of bodies if the robot had continued, checked every millisecond, in m.
    pub carried_on: f64,
}

/// A monitor and its findings.
pub(crate) struct Watch {
    monitor: Monitor,
    braked: Option<Braked>,
}

impl Braked {
    /// Returns true if the brake was unnecessary: without it, all distances would have exceeded the margin.
    pub fn is_false(&self) -> bool {
        self.carried_on >= MonitorConfig::default().margin
    }
}

impl Watch {
    /// Starts with a robot at rest in `ready`.
    pub fn new(robot: &Robot, ready: &[f64; JOINTS]) -> Self {
        let bodies = Bodies::new(robot.description());
        Self {
            monitor: Monitor::new(bodies, *robot.joints(), MonitorConfig::default(), ready),
            braked: None,
        }
    }

    /// Checks a command on the way out, `since` seconds after the throw.
    pub fn look(&mut self, command: &JointCommand, since: f64) {
        self.judge(command, since, Motion::Out);
    }

    /// Continues until the arms stand still, then back on the same path. Returns the first command at which the
    /// monitor would have braked.
    ///
    /// - `from_ns`: time of the next command
    pub fn end(mut self, controller: &mut Controller, from_ns: u64) -> Option<Braked> {
        let mut tick = 0;
        let mut next = |controller: &mut Controller| {
            let (q, dq) = controller.tick(from_ns + tick * TICK_NS);
            tick += 1;
            command(*q, *dq)
        };
        for _ in 0..MOST_AFTER {
            let command = next(controller);
            self.look(&command, f64::NAN);
            if command.dq.iter().all(|dq| *dq == 0.0) {
                break;
            }
        }
        for tick in 0..MOST_BACK {
            if self
                .braked
                .is_some_and(|braked| braked.motion == Motion::Out)
                || controller.mode() == ControllerMode::Ready
            {
                break;
            }
            controller.go_back();
            self.judge(&next(controller), tick as f64 * 1e-3, Motion::Back);
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
