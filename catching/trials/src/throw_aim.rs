//! Throws at a target with practice: the mean error of a round corrects the aim of the next.
//!
//! Planner, path in absolute time and controller are those of live runs; only the time is stepped.

use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::control::Controller;
use tactnet_catching::flight::DRAG;
use tactnet_catching::throw::{Aim, NoThrow, ThrowPlanConfig, ThrowRequest, Thrower};
use tactnet_catching_packets::packets::{JointCommand, ThrowPath};
use tactnet_catching_packets::{ARMS, RobotDescription};
use tactnet_catching_world::{OpenCommand, Released, TICK_NS, World, WorldConfig};

use crate::error::TrialError;
use crate::rally::with_turn;
use crate::stepped_time::{nanoseconds, world_seed};
use tactnet_catching::ChainDelays;
use tactnet_catching_world::down_to;

/// Time before the release at which the hand receives its command, in s.
const TOLD: f64 = 0.05;
/// Time between the planning of a throw and its start, in ns.
const AHEAD_NS: u64 = 50_000_000;

/// Settings of the measurement.
#[derive(Debug, Clone)]
pub struct ThrowAim {
    /// Robot.
    pub robot: Robot,
    /// Settings of the world.
    pub world: WorldConfig,
    /// Delays.
    pub timing: ChainDelays,
    /// Same as [`ThrowBenchConfig::wheels`](crate::ThrowBenchConfig::wheels).
    pub wheels: Option<f64>,
    /// Landing point in the inertial frame, in m.
    pub target: [f64; 3],
    /// Initial offsets of the aim for the left and the right hand, in m.
    pub beside: [[f64; 3]; ARMS],
    /// Number of rounds of practice.
    pub practice: usize,
    /// Number of throws of each round, alternating between both hands.
    pub throws: usize,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Results, reproducible bit by bit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ThrowAimReport {
    /// Number of throws per round.
    pub throws: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Landing point, in m.
    pub target_m: [f64; 3],
    /// Rounds: the first with the initial offsets, the last with the learnt ones.
    pub rounds: Vec<AimRound>,
}

/// Throws with the same aim.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AimRound {
    /// Offset of the aim from the target for the left and the right hand, in m.
    pub aim_beside_m: [[f64; 3]; ARMS],
    /// Median distance of the landing points from the target, in mm.
    pub miss_p50_mm: f64,
    /// 95th percentile of the distance, in mm.
    pub miss_p95_mm: f64,
    /// Maximum distance, in mm.
    pub miss_max_mm: f64,
    /// Mean offset of the landing points along x and y for the left and the right hand, in mm.
    pub beside_mm: [[f64; 2]; ARMS],
}

impl ThrowAim {
    /// Runs the measurement.
    ///
    /// # Errors
    /// Invalid settings, or a target that no throw reaches.
    pub fn run(&self, done: impl Fn() + Sync) -> Result<ThrowAimReport, TrialError> {
        let description = with_turn(self.robot.description(), self.wheels)?;
        let robot = Robot::new(description.clone());
        let thrower = Thrower::new(&robot, ThrowPlanConfig::live());
        let mut aim = self.beside;
        let mut rounds = Vec::new();
        for round in 0..=self.practice {
            let mut paths = Vec::new();
            for (arm, beside) in aim.iter().enumerate() {
                match self.plan(&thrower, arm, beside) {
                    // No throw is possible with this offset, so the previous aim stays.
                    Err(TrialError::Throw(_)) if round > 0 => {
                        return Ok(self.report(rounds));
                    }
                    path => paths.push(path?),
                }
            }
            let missed: Result<Vec<Vector3<f64>>, TrialError> = (0..self.throws)
                .into_par_iter()
                .map(|number| {
                    let seed = world_seed(self.seed, (round * self.throws + number) as u64);
                    let missed = self.miss(&description, &robot, &paths[number % ARMS], seed);
                    done();
                    missed
                })
                .collect();
            let (missed, mean) = missed.map(|missed| {
                let mean: [Vector3<f64>; ARMS] =
                    std::array::from_fn(|arm| mean(missed.iter().skip(arm).step_by(ARMS)));
                (missed, mean)
            })?;
            let mut sorted: Vec<f64> = missed.iter().map(|missed| 1e3 * missed.norm()).collect();
            sorted.sort_by(f64::total_cmp);
            let at = |share: f64| {
                let place = (share * sorted.len() as f64).ceil() as usize;
                sorted[place.clamp(1, sorted.len()) - 1]
            };
            rounds.push(AimRound {
                aim_beside_m: aim,
                miss_p50_mm: at(0.5),
                miss_p95_mm: at(0.95),
                miss_max_mm: at(1.0),
                beside_mm: mean.map(|mean| [1e3 * mean.x, 1e3 * mean.y]),
            });
            for (aim, mean) in aim.iter_mut().zip(mean) {
                *aim = (Vector3::from(*aim) - mean).into();
            }
        }
        Ok(self.report(rounds))
    }

    fn report(&self, rounds: Vec<AimRound>) -> ThrowAimReport {
        ThrowAimReport {
            throws: self.throws,
            seed: self.seed,
            target_m: self.target,
            rounds,
        }
    }

    fn plan(
        &self,
        thrower: &Thrower,
        arm: usize,
        beside: &[f64; 3],
    ) -> Result<ThrowPath, TrialError> {
        let request = ThrowRequest {
            q: self.robot.waiting(),
            holding: Some(arm),
            aim: Aim::At {
                target: self.target.into(),
            },
            drag: DRAG,
            last: None,
        };
        let plan = thrower.plan_beside(&request, &Vector3::from(*beside))?;
        let path = plan.path(AHEAD_NS, 1, self.target);
        Ok(path.expect("a way from where the robot waits is straight"))
    }

    /// Throws once and returns the offset of the landing point from the target. If the ball stays below the target's
    /// height, the point of the release counts.
    fn miss(
        &self,
        description: &RobotDescription,
        robot: &Robot,
        path: &ThrowPath,
        seed: u64,
    ) -> Result<Vector3<f64>, TrialError> {
        let mut world = World::new(description, &self.world, seed, &robot.waiting())?;
        let released = throw(&mut world, robot, &self.timing, path)?;
        let height = self.target[2];
        let down =
            down_to(&world.flight_of(&released), height).unwrap_or(released.state.position.xy());
        Ok(Vector3::new(down.x, down.y, height) - Vector3::from(self.target))
    }
}

/// Runs the controller with a throw in a world, from the waiting pose with a ball in the hand. Returns the released
/// ball.
fn throw(
    world: &mut World,
    robot: &Robot,
    timing: &ChainDelays,
    path: &ThrowPath,
) -> Result<Released, TrialError> {
    let (arm, waiting) = (path.arm as usize, robot.waiting());
    let ahead_ns = nanoseconds(timing.drives);
    let mut controller = Controller::new(robot.clone(), waiting, &waiting);
    world.give(arm)?;
    controller
        .throw_path(world.time_ns() + ahead_ns, path)
        .expect("planned throws are within limits");
    let mut told = false;
    while world.released().is_none() && world.time_ns() < path.open_ns + 100 * TICK_NS {
        let now_ns = world.time_ns();
        if !told && now_ns + nanoseconds(TOLD) >= path.open_ns {
            world.open(&OpenCommand {
                arm,
                open_ns: path.open_ns,
            })?;
            told = true;
        }
        let (q, dq) = controller.tick(now_ns + ahead_ns);
        let command = JointCommand {
            number: now_ns / TICK_NS,
            command_ns: now_ns,
            q: *q,
            dq: *dq,
        };
        world.step(&command, &[None; ARMS]);
    }
    Ok(*world.released().ok_or(NoThrow::NoBall)?)
}

fn mean<'a>(all: impl Iterator<Item = &'a Vector3<f64>>) -> Vector3<f64> {
    let (mut sum, mut count) = (Vector3::zeros(), 0);
    for each in all {
        sum += each;
        count += 1;
    }
    sum / f64::from(count.max(1))
}

#[cfg(test)]
mod tests {
    use tactnet_catching_world::Stiffness;

    use super::*;

    fn aim() -> ThrowAim {
        ThrowAim {
            robot: Robot::new(RobotDescription::nominal()),
            world: WorldConfig::default(),
            timing: ChainDelays::ours(),
            wheels: None,
            target: [4.2, 0.0, 1.2],
            beside: [[0.0; 3]; ARMS],
            practice: 0,
            throws: 4,
            seed: 2,
        }
    }

    /// Without jitter, the ball leaves at the planned time with the planned speed, except for the lag of the drives.
    #[test]
    fn a_ball_leaves_at_the_planned_moment_and_comes_down_where_it_was_planned() {
        let mut aim = aim();
        aim.world.release.jitter = 0.0;
        aim.world.torso.stiffness = Stiffness::Rigid;
        let thrower = Thrower::new(&aim.robot, ThrowPlanConfig::live());
        for arm in 0..ARMS {
            let path = aim.plan(&thrower, arm, &[0.0; 3]).unwrap();
            let description = aim.robot.description();
            let mut world = World::new(description, &aim.world, 5, &aim.robot.waiting()).unwrap();
            let released = throw(&mut world, &aim.robot, &aim.timing, &path).unwrap();
            assert_eq!((released.arm, released.at_ns), (arm, path.open_ns));
            let down = down_to(&world.flight_of(&released), 1.2).unwrap();
            assert!((down.x - 4.2).hypot(down.y) < 0.25, "{down}");
        }
    }

    #[test]
    fn practice_brings_throws_nearer_to_their_target() {
        let aim = ThrowAim {
            practice: 2,
            ..aim()
        };
        let report = aim.run(|| ()).unwrap();
        assert_eq!(report.rounds.len(), 3);
        let [first, .., last] = &report.rounds[..] else {
            panic!("three rounds");
        };
        assert!(last.miss_p50_mm < 0.7 * first.miss_p50_mm, "{report:?}");
        assert_eq!(aim.run(|| ()).unwrap(), report);
        // The learnt offsets help from the start.
        let again = ThrowAim {
            beside: last.aim_beside_m,
            practice: 0,
            ..aim
        };
        let miss = again.run(|| ()).unwrap().rounds[0].miss_p50_mm;
        assert!(miss < 0.7 * first.miss_p50_mm, "{miss}");
    }

    #[test]
    fn a_place_out_of_reach_is_an_error() {
        let far = ThrowAim {
            target: [9.0, 0.0, 1.2],
            ..aim()
        };
        let error = far.run(|| ()).unwrap_err().to_string();
        assert!(error.contains("9.00 m is out of reach"), "{error}");
    }
}
