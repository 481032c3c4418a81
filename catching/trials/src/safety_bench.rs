//! Benchmark of the self-collision monitor: missed collisions, false stops and computation time.

use std::time::Instant;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::safety::{Bodies, Monitor, MonitorConfig, PAIRS, distance};
use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_packets::{JOINTS, Joint};

use crate::quantiles::Quantiles;

/// Number of random motions that are timed on one core.
const TIMED: usize = 5000;
/// Number of ticks of a continuous motion with swinging joints for timing.
const WATCHED: usize = 5000;

/// Settings of the benchmark.
#[derive(Debug, Clone, Copy)]
pub struct SafetyBench {
    /// Number of random motions, with arbitrary poses and velocities within limits.
    pub motions: usize,
    /// Seed of the motions.
    pub seed: u64,
    /// Settings of the monitor.
    pub config: MonitorConfig,
}

/// Results. Everything except the times is reproducible bit by bit.
#[derive(Debug, Clone, Serialize)]
pub struct SafetyReport {
    /// Number of random motions.
    pub motions: usize,
    /// Seed of the motions.
    pub seed: u64,
    /// Minimum distance that the monitor allows, in m.
    pub margin: f64,
    /// Number of motions that start with a smaller distance; excluded from the numbers below.
    pub begun_too_near: usize,
    /// Number of motions that the monitor allows.
    pub go: usize,
    /// Number of allowed motions in which bodies touch while braking; 0 for a correct monitor.
    pub missed: usize,
    /// Minimum distance of bodies in allowed motions, in m.
    pub least_distance: f64,
    /// Number of false stops: motions that are braked although all distances exceed the margin.
    pub braked_in_vain: usize,
    /// Number of motions in which all distances exceed the margin.
    pub free: usize,
    /// Time of a verdict on a random command, which updates all necessary pairs, in µs.
    pub judge_anew_us: Option<Quantiles>,
    /// Time of a verdict in a motion of swinging joints, in µs.
    pub judge_us: Option<Quantiles>,
    /// Mean time of the distance between two hulls at rest, in µs.
    pub distance_us: f64,
    /// Mean time of the swept hulls of a pair and their distance, in µs.
    pub swept_us: f64,
}

/// Result of a random motion.
struct Judged {
    /// True if the distances at the start exceed the margin.
    begun: bool,
    go: bool,
    /// Minimum distance while braking, in m.
    least: f64,
}

impl SafetyBench {
    /// Runs the benchmark.
    ///
    /// - `progress`: receives the number of finished motions
    pub fn run(&self, robot: &Robot, progress: impl Fn(usize) + Sync) -> SafetyReport {
        let bodies = Bodies::new(robot.description());
        let done = std::sync::atomic::AtomicUsize::new(0);
        let judged: Vec<Judged> = (0..self.motions)
            .into_par_iter()
            .map(|number| {
                let judged = self.judge(robot, &bodies, number);
                let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
                if done.is_multiple_of(1000) {
                    progress(done);
                }
                judged
            })
            .collect();
        let begun = || judged.iter().filter(|judged| judged.begun);
        let free = |judged: &&Judged| judged.least >= self.config.margin;
        let times = self.times(robot, &bodies);
        SafetyReport {
            motions: self.motions,
            seed: self.seed,
            margin: self.config.margin,
            begun_too_near: self.motions - begun().count(),
            go: begun().filter(|judged| judged.go).count(),
            missed: begun()
                .filter(|judged| judged.go && judged.least <= 0.0)
                .count(),
            least_distance: begun()
                .filter(|judged| judged.go)
                .map(|judged| judged.least)
                .fold(f64::INFINITY, f64::min),
            braked_in_vain: begun().filter(free).filter(|judged| !judged.go).count(),
            free: begun().filter(free).count(),
            ..times
        }
    }

    fn judge(&self, robot: &Robot, bodies: &Bodies, number: usize) -> Judged {
        let command = self.command(robot.joints(), number);
        if bodies.least(&command.q) < self.config.margin {
            return Judged {
                begun: false,
                go: false,
                least: 0.0,
            };
        }
        let mut monitor = Monitor::new(bodies.clone(), *robot.joints(), self.config, &command.q);
        let ruling = monitor.judge(&command);
        let least = monitor.least_while_braking(&command);
        Judged {
            begun: true,
            go: ruling.go,
            least,
        }
    }

    /// Returns a random pose with a random velocity.
    fn command(&self, joints: &[Joint; JOINTS], number: usize) -> JointCommand {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(number as u64);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let q = std::array::from_fn(|i| between(joints[i].range[0], joints[i].range[1]));
        let dq = std::array::from_fn(|i| between(-joints[i].speed, joints[i].speed));
        JointCommand::of(q, dq)
    }

    fn times(&self, robot: &Robot, bodies: &Bodies) -> SafetyReport {
        let joints = robot.joints();
        let timed = self.motions.min(TIMED);
        let commands: Vec<JointCommand> = (0..timed).map(|i| self.command(joints, i)).collect();
        let mut anew = Vec::with_capacity(timed);
        let (mut distances, mut swept) = (0.0, 0.0);
        let mut sum = 0.0;
        for (i, command) in commands.iter().enumerate() {
            let mut monitor = Monitor::new(bodies.clone(), *joints, self.config, &command.q);
            let begun = Instant::now();
            sum += monitor.judge(command).bound;
            anew.push(begun.elapsed().as_secs_f64() * 1e6);
            let pair = i % PAIRS;
            let [a, b] = bodies.placed(pair, &command.q);
            let begun = Instant::now();
            sum += distance(&a, &b);
            distances += begun.elapsed().as_secs_f64() * 1e6;
            let intervals = monitor.intervals(command);
            let begun = Instant::now();
            let [a, b] = bodies.swept(pair, &intervals);
            sum += distance(&a, &b);
            swept += begun.elapsed().as_secs_f64() * 1e6;
        }
        let mut monitor = Monitor::new(bodies.clone(), *joints, self.config, &swing(joints, 0).q);
        let watched = (0..WATCHED).map(|tick| {
            let command = swing(joints, tick);
            let begun = Instant::now();
            sum += monitor.judge(&command).bound;
            begun.elapsed().as_secs_f64() * 1e6
        });
        let watched: Vec<f64> = watched.collect();
        std::hint::black_box(sum);
        SafetyReport {
            motions: 0,
            seed: 0,
            margin: 0.0,
            begun_too_near: 0,
            go: 0,
            missed: 0,
            least_distance: 0.0,
            braked_in_vain: 0,
            free: 0,
            judge_anew_us: Quantiles::of(anew),
            judge_us: Quantiles::of(watched),
            distance_us: distances / timed.max(1) as f64,
            swept_us: swept / timed.max(1) as f64,
        }
    }
}

/// Returns the command at a tick of 1 ms while all joints swing about the centres of their ranges.
fn swing(joints: &[Joint; JOINTS], tick: usize) -> JointCommand {
    let t = 1e-3 * tick as f64;
    let of = |i: usize| {
        let [low, high] = joints[i].range;
        let (middle, half) = (0.5 * (low + high), 0.2 * (high - low));
        let pace = 0.8 * joints[i].speed / half * (1.0 - 0.02 * i as f64);
        (middle, half, pace)
    };
    let q = |i: usize| {
        let (middle, half, pace) = of(i);
        middle + half * (pace * t).sin()
    };
    let dq = |i: usize| {
        let (_, half, pace) = of(i);
        half * pace * (pace * t).cos()
    };
    JointCommand::of(std::array::from_fn(q), std::array::from_fn(dq))
}
