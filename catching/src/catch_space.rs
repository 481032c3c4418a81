//! Catch space: the set of balls that the robot is able to catch.
//!
//! The test uses the true flight. A ball is in the catch space if at least one arm has a feasible catch motion that
//! starts at the first possible moment. The search covers a dense grid of catch times, elbow angles and hand angles
//! with all closed-form branches. Platform and torso either rest or move as the stack would move them for the true
//! ball.

use nalgebra::Isometry3;
use tactnet_catching_packets::{ARMS, JOINTS, joint};

use crate::Robot;
use crate::coordinate::BodyMotion;
use crate::flight::{Flight, FlightPath, STEP};
use crate::plan::{CatchRequest, Grid, Objective, PlanConfig, Planner};

const GRID: Grid = Grid {
    times: 30,
    hands: 24,
    elbows: 24,
};

/// Test for balls that the robot is able to catch.
#[derive(Debug, Clone)]
pub struct CatchSpace {
    robot: Robot,
    planners: [Planner; ARMS],
    lower_body: bool,
}

impl CatchSpace {
    /// Creates the test. With `lower_body`, platform and torso may move.
    pub fn new(robot: &Robot, lower_body: bool) -> Self {
        Self {
            planners: std::array::from_fn(|arm| Planner::new(robot, arm, PlanConfig::default())),
            robot: robot.clone(),
            lower_body,
        }
    }

    /// Returns the arms that are able to catch a ball, thrown at a robot that rests in `ready`.
    ///
    /// - `flight`: true flight from the release, in the inertial frame, one entry per millisecond
    /// - `reaction`: time from the release to the start of the first path, in s
    pub fn arms_of(
        &self,
        flight: impl Iterator<Item = Flight>,
        reaction: f64,
        ready: &[f64; JOINTS],
    ) -> [bool; ARMS] {
        let flight: Vec<Flight> = flight.skip((reaction * 1e3) as usize).step_by(10).collect();
        let mut possible = [false; ARMS];
        if flight.is_empty() {
            return possible;
        }
        let chest = self.robot.chest(ready);
        let seen = in_frame(&flight, &chest);
        let standing = BodyMotion::standing(ready);
        let moving = BodyMotion::towards(&self.robot, ready, &FlightPath::recorded(&seen), 0);
        let bodies = 1 + usize::from(self.lower_body);
        for body in [standing, moving].iter().take(bodies) {
            let mut q = *ready;
            body.write(body.end_ns() + 1, &mut q, &mut [0.0; JOINTS]);
            let path = FlightPath::recorded(&in_frame(&flight, &self.robot.chest(&q)));
            for (arm, possible) in possible.iter_mut().enumerate() {
                let request = CatchRequest {
                    ball: path.at(0.0),
                    q0: joint::of_arm(ready, arm),
                    w0: [0.0; 7],
                    earliest: body.end_ns() as f64 * 1e-9,
                    latest: (flight.len() as f64 * STEP).min(1.8),
                    objective: Objective::Latest,
                    other: None,
                };
                *possible |= self.planners[arm]
                    .best_on_grid(&request, Some(&path), GRID)
                    .is_ok();
            }
        }
        possible
    }
}

fn in_frame(flight: &[Flight], frame: &Isometry3<f64>) -> Vec<Flight> {
    let to_frame = frame.inverse();
    flight.iter().map(|ball| ball.in_frame(&to_frame)).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// Returns the arms that catch a ball that passes the height of 1.3 m, 0.6 m ahead and `aside`, after `time` s.
    fn arms(oracle: &CatchSpace, aside: f64, time: f64) -> [bool; ARMS] {
        let (aim, v) = (Vector3::new(0.6, aside, 1.3), Vector3::new(-5.5, 0.0, -2.0));
        let ball = Flight::without_spin(aim, v, 0.03);
        let flight = (0..1200).map(|ms| ball.after(1e-3 * f64::from(ms) - time));
        oracle.arms_of(flight, 0.0, &oracle.robot.waiting())
    }

    #[test]
    fn balls_before_a_shoulder_can_be_caught_and_balls_far_aside_cannot() {
        let robot = Robot::nominal();
        let oracle = CatchSpace::new(&robot, false);
        let before = |y: f64| arms(&oracle, y, 0.6);
        assert!(before(0.5)[0]);
        assert!(before(-0.5)[1]);
        assert_eq!(before(2.2), [false, false]);
        assert_eq!(before(1.2), [false, false]);
    }

    #[test]
    fn platform_and_torso_widen_the_catch_space() {
        let robot = Robot::nominal();
        let farthest = |oracle: &CatchSpace| {
            let mut aside = (0..40).rev().map(|i| 0.9 + 0.02 * f64::from(i));
            aside.find(|aside| arms(oracle, *aside, 1.0)[0])
        };
        let standing = farthest(&CatchSpace::new(&robot, false));
        let moving = farthest(&CatchSpace::new(&robot, true));
        assert!(standing.is_some() && moving > standing.map(|y| y + 0.1));
    }
}
