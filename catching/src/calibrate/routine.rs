//! Robot motion in a calibration session. First the head alone rests and turns, for the IMU. Then each arm in turn
//! moves to each of its configurations and back the same way, while the head follows the marker and sweeps around it.

use std::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};
use tactnet_catching_packets::{ARMS, JOINTS, Joint, joint};

use super::choose::Candidate;
use super::session::NeckMotion;
use crate::ramp::{Ramp, together};
use crate::robot::Robot;

/// Resting positions of pan and tilt for the IMU, in rad.
const RESTS: [[f64; 2]; 7] = [
    [0.0, 0.0],
    [0.6, 0.5],
    [-0.6, 0.5],
    [0.0, 0.8],
    [-0.6, -0.5],
    [0.6, -0.5],
    [0.0, -0.8],
];
/// Periods of pan and tilt during the turn for the IMU.
const TURN_ROUNDS: [f64; 2] = [3.0, 4.0];

tactnet_catching_packets::settings! {
    /// Settings of the session's motion.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct RoutineConfig {
        /// Fraction of the joints' maximum speeds.
        pub speed: f64 = 0.9,
        /// Fraction of the joints' maximum accelerations.
        pub acceleration: f64 = 0.3,
        /// Time from the end of an arm's motion to the first picture, in s.
        pub settle: f64 = 0.2,
        /// Duration of each rest of the head, in s. Only the second half is used.
        pub rest: f64 = 2.0,
        /// Head motion for the IMU.
        pub turn: Sweep = Sweep {
            pan: 0.7,
            tilt: 0.5,
            seconds: 8.0,
            rounds: TURN_ROUNDS,
        },
        /// Head motion around a marker.
        pub sweep: Sweep = Sweep {
            pan: 0.28,
            tilt: 0.2,
            seconds: 2.4,
            rounds: [2.0, 1.0],
        },
    }
}

/// Smooth neck motion away from a gaze and back: `pan sin^2(pi t / T) sin(tau rounds t / T)`; tilt uses a cosine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// Amplitude of pan, in rad.
    pub pan: f64,
    /// Amplitude of tilt, in rad.
    pub tilt: f64,
    /// Duration, in s.
    pub seconds: f64,
    /// Number of periods of pan and tilt.
    pub rounds: [f64; 2],
}

impl Sweep {
    /// Returns the neck motion relative to the gaze at time `t`, in s from the start.
    pub fn at(&self, t: f64) -> NeckMotion {
        let half = PI / self.seconds;
        let (window, slope, bend) = (
            (half * t).sin().powi(2),
            half * (2.0 * half * t).sin(),
            2.0 * half * half * (2.0 * half * t).cos(),
        );
        let axis = |amplitude: f64, rounds: f64, phase: f64| {
            let w = TAU * rounds / self.seconds;
            let (sin, cos) = (w * t + phase).sin_cos();
            [
                amplitude * window * sin,
                amplitude * (slope * sin + window * w * cos),
                amplitude * (bend * sin + 2.0 * slope * w * cos - window * w * w * sin),
            ]
        };
        let pan = axis(self.pan, self.rounds[0], 0.0);
        let tilt = axis(self.tilt, self.rounds[1], PI / 2.0);
        NeckMotion {
            q: [pan[0], tilt[0]],
            dq: [pan[1], tilt[1]],
            ddq: [pan[2], tilt[2]],
        }
    }

    /// Returns `count` samples, evenly spaced over the duration.
    pub fn views(&self, count: usize) -> Vec<NeckMotion> {
        (0..count)
            .map(|view| self.at((view as f64 + 0.5) / count as f64 * self.seconds))
            .collect()
    }
}

/// Kind of data to record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Nothing is recorded during transfer motions.
    Way,
    /// IMU at rest, in the resting position of this index.
    Rest(usize),
    /// IMU while the head turns.
    Turn,
    /// Marker of an arm in a configuration.
    Marker {
        /// Index of the configuration.
        configuration: usize,
        /// Arm: 0 left, 1 right.
        arm: usize,
    },
}

#[derive(Debug, Clone)]
enum Motion {
    Ramps(Box<[Ramp; JOINTS]>),
    Sweep(Sweep),
}

/// Segment of the motion.
#[derive(Debug, Clone)]
struct Leg {
    begin: f64,
    seconds: f64,
    from: [f64; JOINTS],
    motion: Motion,
    phase: Phase,
}

/// Motion of a session.
#[derive(Debug, Clone)]
pub struct Routine {
    legs: Vec<Leg>,
    end: f64,
    q: [f64; JOINTS],
}

impl Routine {
    /// Plans a session that starts and ends in the waiting pose: first the left arm's configurations, then the right
    /// arm's, each in the given order.
    pub fn new(robot: &Robot, config: &RoutineConfig, configurations: &[Candidate]) -> Self {
        let waiting = robot.waiting();
        let limits = robot.joints().map(|joint| Joint {
            speed: config.speed * joint.speed,
            acceleration: config.acceleration * joint.acceleration,
            ..joint
        });
        let mut routine = Self {
            legs: Vec::new(),
            end: 0.0,
            q: waiting,
        };
        for (number, [pan, tilt]) in RESTS.into_iter().enumerate() {
            let mut q = waiting;
            q[joint::NECK].copy_from_slice(&[pan, tilt]);
            routine.go(&q, &limits);
            routine.stand(config.rest / 2.0, Phase::Way);
            routine.stand(config.rest / 2.0, Phase::Rest(number));
        }
        routine.go(&waiting, &limits);
        routine.sweep(&config.turn, Phase::Turn);
        for arm in 0..ARMS {
            let own = configurations
                .iter()
                .enumerate()
                .filter(|(_, c)| c.arm == arm);
            for (configuration, candidate) in own {
                let mut q = waiting;
                q[joint::ARM[arm].clone()].copy_from_slice(&candidate.q);
                q[joint::NECK].copy_from_slice(&candidate.gaze);
                routine.go(&q, &limits);
                routine.stand(config.settle, Phase::Way);
                routine.sweep(&config.sweep, Phase::Marker { configuration, arm });
                let mut back = waiting;
                back[joint::NECK].copy_from_slice(&candidate.gaze);
                routine.go(&back, &limits);
            }
        }
        routine.go(&waiting, &limits);
        routine
    }

    /// Returns the duration of the session, in s.
    pub fn seconds(&self) -> f64 {
        self.end
    }

    /// Returns positions and velocities of all joints at time `t`, in s, and the kind of data to record.
    pub fn at(&self, t: f64) -> ([f64; JOINTS], [f64; JOINTS], Phase) {
        let number = self.legs.partition_point(|leg| leg.begin <= t);
        let Some(leg) = number.checked_sub(1).map(|number| &self.legs[number]) else {
            return (self.q, [0.0; JOINTS], Phase::Way);
        };
        let since = t - leg.begin;
        if since > leg.seconds {
            return (self.q, [0.0; JOINTS], Phase::Way);
        }
        let (mut q, mut dq) = (leg.from, [0.0; JOINTS]);
        match &leg.motion {
            Motion::Ramps(ramps) => {
                for (i, ramp) in ramps.iter().enumerate() {
                    (q[i], dq[i]) = ramp.at(since);
                }
            }
            Motion::Sweep(sweep) => {
                let away = sweep.at(since);
                for (i, place) in joint::NECK.enumerate() {
                    q[place] += away.q[i];
                    dq[place] = away.dq[i];
                }
            }
        }
        (q, dq, leg.phase)
    }

    fn push(&mut self, seconds: f64, motion: Motion, phase: Phase) {
        self.legs.push(Leg {
            begin: self.end,
            seconds,
            from: self.q,
            motion,
            phase,
        });
        self.end += seconds;
    }

    /// Moves all joints straight to `q` such that they arrive at the same time.
    fn go(&mut self, q: &[f64; JOINTS], limits: &[Joint; JOINTS]) {
        let (ramps, seconds) = together(&self.q, q, limits);
        if seconds <= 0.0 {
            return;
        }
        self.push(seconds, Motion::Ramps(Box::new(ramps)), Phase::Way);
        self.q = *q;
    }

    fn stand(&mut self, seconds: f64, phase: Phase) {
        let standing = Box::new(self.q.map(Ramp::standing));
        self.push(seconds, Motion::Ramps(standing), phase);
    }

    fn sweep(&mut self, sweep: &Sweep, phase: Phase) {
        self.push(sweep.seconds, Motion::Sweep(*sweep), phase);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn routine() -> (Robot, RoutineConfig, Routine) {
        let robot = Robot::nominal();
        let away = |arm: usize| {
            let mut q = robot.ready(arm);
            q[0] += 0.3;
            q[3] -= 0.5;
            Candidate {
                arm,
                q,
                gaze: [0.1, 0.4],
            }
        };
        let config = RoutineConfig::default();
        // The right arm's configuration comes first.
        let routine = Routine::new(&robot, &config, &[away(1), away(0)]);
        (robot, config, routine)
    }

    #[test]
    fn motions_keep_the_limits_and_velocities_are_derivatives() {
        let (robot, config, routine) = routine();
        let limits = robot.joints();
        let h = 1e-4;
        let ticks = (routine.seconds() / h) as usize;
        let mut before = routine.at(0.0);
        assert_eq!(before.0, robot.waiting());
        for tick in 1..=ticks {
            let now = routine.at(tick as f64 * h);
            for i in 0..JOINTS {
                let [low, high] = limits[i].range;
                assert!((low..=high).contains(&now.0[i]));
                assert!(now.1[i].abs() <= config.speed * limits[i].speed + 1e-9);
                let moved = (now.0[i] - before.0[i]) / h;
                let mean = (now.1[i] + before.1[i]) / 2.0;
                // Accelerations of 10 rad/s^2 change within a step.
                assert!((moved - mean).abs() < 2e-3, "{i} {moved} {mean}");
            }
            before = now;
        }
        assert_eq!(routine.at(routine.seconds() + 1.0).0, robot.waiting());
    }

    #[test]
    fn the_left_arm_goes_first_and_arms_stand_while_markers_are_looked_at() {
        let (_, config, routine) = routine();
        let ticks = (routine.seconds() / 1e-3) as usize;
        let mut arms = Vec::new();
        let mut seen = 0;
        for tick in 0..ticks {
            let (_, dq, phase) = routine.at(tick as f64 * 1e-3);
            let Phase::Marker { arm, configuration } = phase else {
                continue;
            };
            assert_eq!(configuration, 1 - arm);
            assert!(dq[6..].iter().all(|dq| *dq == 0.0));
            if arms.last() != Some(&arm) {
                arms.push(arm);
            }
            seen += 1;
        }
        assert_eq!(arms, [0, 1]);
        let expected = 2.0 * config.sweep.seconds * 1e3;
        assert!((f64::from(seen) - expected).abs() <= 4.0);
    }

    #[test]
    fn a_sweeps_accelerations_are_derivatives() {
        let sweep = RoutineConfig::default().sweep;
        let h = 1e-5;
        for step in 1..24 {
            let t = f64::from(step) * 0.1;
            let (before, now, after) = (sweep.at(t - h), sweep.at(t), sweep.at(t + h));
            for i in 0..2 {
                assert!(((after.q[i] - before.q[i]) / (2.0 * h) - now.dq[i]).abs() < 1e-7);
                assert!(((after.dq[i] - before.dq[i]) / (2.0 * h) - now.ddq[i]).abs() < 1e-7);
            }
        }
    }
}
