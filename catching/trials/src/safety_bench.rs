//! Benchmark of the self-collision monitor: missed collisions and false stops.

use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::safety::{Bodies, Hull, Monitor, MonitorConfig, PAIRS, distance};
use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_packets::{JOINTS, Joint};

/// Settings of the benchmark.
#[derive(Debug, Clone, Copy)]
pub struct SafetyBench {
    /// Number of random motions, with arbitrary poses and velocities within limits.
    pub motions: usize,
    /// Seed of the motions.
    pub seed: u64,
}

/// Results, reproducible bit by bit.
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
}

/// Points of two hulls, their radii and distance, for other implementations.
#[derive(Debug, Clone, Serialize)]
pub struct PeerHulls {
    /// Points of the first hull, in m.
    pub a: Vec<[f64; 3]>,
    /// Points of the second hull, in m.
    pub b: Vec<[f64; 3]>,
    /// Radii of both hulls, in m.
    pub radii: [f64; 2],
    /// Distance according to this project, in m.
    pub distance: f64,
}

/// Result of a random motion that begins with distances above the margin.
struct Judged {
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
        let judged: Vec<Option<Judged>> = (0..self.motions)
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
        let begun = || judged.iter().flatten();
        let free = |judged: &&Judged| judged.least >= MonitorConfig::default().margin;
        SafetyReport {
            motions: self.motions,
            seed: self.seed,
            margin: MonitorConfig::default().margin,
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
        }
    }

    /// Returns hulls of random motions, at rest and swept.
    pub fn peer_hulls(&self, robot: &Robot) -> Vec<PeerHulls> {
        let bodies = Bodies::new(robot.description());
        let peers = (0..self.motions).map(|number| {
            let command = self.command(robot.joints(), number);
            let monitor = monitor(robot, &bodies, &command);
            let pair = number % PAIRS;
            let [a, b] = if number % 2 == 0 {
                bodies.placed(pair, &command.q)
            } else {
                bodies.swept(pair, &monitor.intervals(&command))
            };
            let points = |hull: &Hull| {
                hull.points()
                    .iter()
                    .map(|p: &Vector3<f64>| (*p).into())
                    .collect()
            };
            PeerHulls {
                a: points(&a),
                b: points(&b),
                radii: [a.radius, b.radius],
                distance: distance(&a, &b),
            }
        });
        peers.collect()
    }

    fn judge(&self, robot: &Robot, bodies: &Bodies, number: usize) -> Option<Judged> {
        let command = self.command(robot.joints(), number);
        if bodies.least(&command.q) < MonitorConfig::default().margin {
            return None;
        }
        let mut monitor = monitor(robot, bodies, &command);
        Some(Judged {
            go: monitor.judge(&command).go,
            least: monitor.least_while_braking(&command),
        })
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
}

fn monitor(robot: &Robot, bodies: &Bodies, command: &JointCommand) -> Monitor {
    let (bodies, config) = (bodies.clone(), MonitorConfig::default());
    Monitor::new(bodies, *robot.joints(), config, &command.q)
}
