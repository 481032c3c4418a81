//! Throws at a target with practice, by the whole stack in stepped time: the mean error of a round corrects the aim of
//! the next.

use nalgebra::Vector3;
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::throw::ThrowPlanConfig;
use tactnet_catching::throw_back::ThrowBack;
use tactnet_catching_packets::{ARMS, RobotDescription};
use tactnet_catching_world::{WorldConfig, down_to};

use crate::error::TrialError;
use crate::parallel::on_all_cores;
use crate::rally::{Player, with_turn};
use crate::stepped_time::world_seed;
use crate::throw_config::ThrowConfig;
use tactnet_plot::quantile;

/// Settings of the measurement.
#[derive(Debug, Clone)]
pub struct ThrowAim {
    /// Robot.
    pub robot: Robot,
    /// Settings of the world.
    pub world: WorldConfig,
    /// Same as [`ThrowBench::wheels`](crate::ThrowBench::wheels).
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
        let mut aim = self.beside;
        let mut rounds = Vec::new();
        for round in 0..=self.practice {
            let missed = on_all_cores(0..self.throws, |number| {
                let seed = world_seed(self.seed, (round * self.throws + number) as u64);
                let missed = self.miss(&description, number % ARMS, aim, seed);
                done();
                missed
            });
            let missed = match missed {
                // No throw is possible with this offset, so the previous aim stays.
                Err(TrialError::Throw(_)) if round > 0 => break,
                missed => missed?,
            };
            let mean: [Vector3<f64>; ARMS] = std::array::from_fn(|arm| {
                let own = missed.iter().skip(arm).step_by(ARMS);
                own.clone().sum::<Vector3<f64>>() / own.len().max(1) as f64
            });
            let mut sorted: Vec<f64> = missed.iter().map(|missed| 1e3 * missed.norm()).collect();
            sorted.sort_by(f64::total_cmp);
            rounds.push(AimRound {
                aim_beside_m: aim,
                miss_p50_mm: quantile(&sorted, 0.5),
                miss_p95_mm: quantile(&sorted, 0.95),
                miss_max_mm: quantile(&sorted, 1.0),
                beside_mm: mean.map(|mean| [1e3 * mean.x, 1e3 * mean.y]),
            });
            for (aim, mean) in aim.iter_mut().zip(mean) {
                *aim = (Vector3::from(*aim) - mean).into();
            }
        }
        Ok(ThrowAimReport {
            throws: self.throws,
            seed: self.seed,
            target_m: self.target,
            rounds,
        })
    }

    /// Throws once and returns the offset of the landing point from the target. If the ball stays below the target's
    /// height, the point of the release counts.
    fn miss(
        &self,
        description: &RobotDescription,
        arm: usize,
        beside: [[f64; 3]; ARMS],
        seed: u64,
    ) -> Result<Vector3<f64>, TrialError> {
        let config = ThrowConfig::new(self.robot.clone(), self.world.clone());
        let throws = ThrowBack {
            at: Some(self.target),
            beside,
            tries: 1,
            planner: ThrowPlanConfig::live(),
            ..ThrowBack::default()
        };
        let mut player = Player::new(&config, description, throws, seed)?;
        player.world.give(arm)?;
        let throw = player.throw(arm)?;
        let height = self.target[2];
        let begin = throw.released.state.position.xy();
        let down = down_to(&player.world.flight_of(&throw.released), height).unwrap_or(begin);
        Ok(Vector3::new(down.x, down.y, height) - Vector3::from(self.target))
    }
}

#[cfg(test)]
mod tests {
    use tactnet_catching_world::Stiffness;

    use super::*;

    fn aim() -> ThrowAim {
        ThrowAim {
            robot: Robot::nominal(),
            world: WorldConfig::default(),
            wheels: None,
            target: [4.2, 0.0, 1.2],
            beside: [[0.0; 3]; ARMS],
            practice: 0,
            throws: 4,
            seed: 2,
        }
    }

    /// Without jitter, only the lag of the drives and unknown drag and spin move the landing points.
    #[test]
    fn a_ball_comes_down_where_it_was_planned_from_both_hands() {
        let mut aim = aim();
        aim.world.release.jitter = 0.0;
        aim.world.torso.stiffness = Stiffness::Rigid;
        let report = aim.run(|| ()).unwrap();
        assert!(report.rounds[0].miss_max_mm < 250.0, "{report:?}");
    }

    #[test]
    fn practice_brings_throws_nearer_to_their_target() {
        let mut aim = ThrowAim {
            practice: 2,
            ..aim()
        };
        // The planner expects half of this drag.
        aim.world.ball.drag = [0.9, 0.9];
        let report = aim.run(|| ()).unwrap();
        assert_eq!(report.rounds.len(), 3);
        let [first, .., last] = &report.rounds[..] else {
            panic!("three rounds");
        };
        assert!(last.miss_p50_mm < 0.7 * first.miss_p50_mm, "{report:?}");
        assert_eq!(aim.run(|| ()).unwrap(), report);
        // The learnt offsets help from the start.
        let mut again = aim;
        again.beside = last.aim_beside_m;
        again.practice = 0;
        let miss = again.run(|| ()).unwrap().rounds[0].miss_p50_mm;
        assert!(miss < 0.7 * first.miss_p50_mm, "{miss}");
    }
}
