//! Benchmark of throws of maximum distance: as planned, in the simulated world, with an early or late release, and
//! with faster joints.

use std::time::Instant;

use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::throw::{
    Aim, Swing, THROW_JOINTS, ThrowJoints, ThrowPlan, ThrowPlanConfig, ThrowRequest, Thrower,
};
use tactnet_catching::throw_back::ThrowBack;
use tactnet_catching_packets::checks::positive;
use tactnet_catching_packets::{ARMS, RobotDescription};
use tactnet_catching_world::{WorldConfig, down_to};

use crate::error::TrialError;
use crate::parallel::on_all_cores;
use crate::rally::{Player, lost, with_turn};
use crate::stepped_time::world_seed;
use crate::throw_config::ThrowConfig;
use tactnet_plot::Quantiles;

/// Goal for the length, in m.
const GOAL: f64 = 7.0;
/// Delay or advance of the release, in s.
const LATE: f64 = 2e-3;
/// Maximum factor in the search for speeds that reach the goal.
const FASTEST: f64 = 3.0;
/// Share of the maximum speed from which a joint counts as being at its limit.
const AT_LIMIT: f64 = 0.999;
/// Contribution below which a joint is ignored, in m/s.
const GIVES: f64 = 0.05;

/// Settings of the benchmark.
#[derive(Debug, Clone)]
pub struct ThrowBench {
    /// Robot.
    pub robot: Robot,
    /// Settings of the world.
    pub world: WorldConfig,
    /// Height at which flights end, in m.
    pub height: f64,
    /// Distance of the wheels from the centre of the platform in m, which turns with its own speed. `None`: the
    /// vertical axis of the torso turns with its own limits.
    pub wheels: Option<f64>,
    /// Number of throws in the world, alternating between both arms.
    pub throws: usize,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Results. Everything except the times is reproducible bit by bit.
#[derive(Debug, Clone, Serialize)]
pub struct ThrowReport {
    /// Number of throws in the world.
    pub throws: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Height at which flights end, in m.
    pub height_m: f64,
    /// Length of the planned flight, in m.
    pub planned_m: f64,
    /// Planned speed of the ball at the release, in m/s.
    pub planned_speed_m_s: f64,
    /// Planned height of the release, in m.
    pub release_height_m: f64,
    /// Contributions of turn and arm joints to that speed, in m/s.
    pub speed_by_joint_m_s: ThrowJoints,
    /// Joints that contribute to the speed and are at their limit at the release: 0 for the turn, 1 to 7 for the arm.
    pub at_limit: Vec<usize>,
    /// Mean, minimum and maximum length of the true flights, in m.
    pub distance_m: [f64; 3],
    /// Mean true speed of the balls at the release, in m/s.
    pub speed_m_s: f64,
    /// Maximum torques of turn and arm over all throws until the robot stands still, in Nm. The world's drives have
    /// no torque limits.
    pub torques_nm: ThrowJoints,
    /// Loss of distance of the planned flight if the fingers open 2 ms early or late, whichever is larger, in mm.
    pub planned_lost_mm_at_2ms: f64,
    /// Loss of distance in the world in that case, without jitter, in mm.
    pub distance_lost_mm_at_2ms: f64,
    /// Displacement of the landing point in that case, in mm.
    pub displaced_mm_at_2ms: f64,
    /// Planning time on one core, in ms.
    pub plan_ms: Option<Quantiles>,
    /// Speeds that reach the goal.
    pub goal: Goal,
}

/// Speeds for which planned throws reach the goal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Goal {
    /// Goal for the length, in m.
    pub goal_m: f64,
    /// Factor for the arm's speeds with the turn as described; `None` if it exceeds 3.
    pub arm_times: Option<f64>,
    /// Speed of the turn in deg/s with the arm as described; `None` if it exceeds three times the description's.
    pub turn_deg_s: Option<f64>,
}

impl ThrowBench {
    /// Runs the benchmark.
    ///
    /// # Errors
    /// Invalid settings, or an impossible throw.
    pub fn run(&self, done: impl Fn() + Sync) -> Result<ThrowReport, TrialError> {
        let height = self.height;
        positive("height", &height)?;
        let description = with_turn(self.robot.description(), self.wheels)?;
        let robot = Robot::new(description.clone());
        let plan = self.plan(&description, ARMS - 1)?;
        let (shares, given) = (plan.shares_of_speed(&robot), by_joint(&plan, &robot));
        // The last three throws have no jitter: on time, late and early.
        let flown = on_all_cores(0..self.throws + 3, |number| {
            let flown = self.fly(&description, number);
            done();
            flown
        })?;
        let (usual, exact) = flown.split_at(self.throws);
        let lengths = || usual.iter().map(|flown| flown.length);
        let mean = |of: &dyn Fn(&Flown) -> f64| {
            usual.iter().map(of).sum::<f64>() / self.throws.max(1) as f64
        };
        let most = |of: &dyn Fn(&Flown) -> f64| usual.iter().map(of).fold(0.0, f64::max);
        let worst = |of: &dyn Fn(&Flown) -> f64| exact[1..].iter().map(of).fold(0.0, f64::max);
        Ok(ThrowReport {
            throws: self.throws,
            seed: self.seed,
            height_m: height,
            planned_m: plan.distance(),
            planned_speed_m_s: plan.v.norm(),
            release_height_m: plan.p.z,
            speed_by_joint_m_s: given,
            at_limit: (0..shares.len())
                .filter(|i| shares[*i].abs() >= AT_LIMIT && given[*i] >= GIVES)
                .collect(),
            distance_m: [
                mean(&|flown| flown.length),
                lengths().fold(f64::INFINITY, f64::min),
                lengths().fold(0.0, f64::max),
            ],
            speed_m_s: mean(&|flown| flown.speed),
            torques_nm: std::array::from_fn(|i| most(&|flown| flown.torques[i])),
            planned_lost_mm_at_2ms: 1e3 * lost(&plan, &robot, height)[0],
            distance_lost_mm_at_2ms: 1e3 * worst(&|flown| exact[0].down.x - flown.down.x),
            displaced_mm_at_2ms: 1e3 * worst(&|flown| (exact[0].down - flown.down).norm()),
            plan_ms: Quantiles::of(flown.iter().map(|flown| flown.plan_ms).collect()),
            goal: self.goal(&description),
        })
    }

    fn goal(&self, description: &RobotDescription) -> Goal {
        Goal {
            goal_m: GOAL,
            arm_times: self.times_for_goal(|times| faster_arms(description, times)),
            turn_deg_s: self
                .times_for_goal(|times| faster_turn(description, times))
                .map(|times| times * description.torso.joints[0].speed.to_degrees()),
        }
    }

    fn plan(&self, description: &RobotDescription, arm: usize) -> Result<ThrowPlan, TrialError> {
        let robot = Robot::new(description.clone());
        let thrower = Thrower::new(&robot, ThrowPlanConfig::default());
        Ok(thrower.plan(&ThrowRequest::new(arm, self.aim()))?)
    }

    fn aim(&self) -> Aim {
        Aim::Farthest {
            heading: 0.0,
            height: self.height,
        }
    }

    /// Throws once in the world. The last three throws have no jitter: the release is on time, late and early.
    fn fly(&self, description: &RobotDescription, number: usize) -> Result<Flown, TrialError> {
        let mut world = self.world.clone();
        let late = match number.checked_sub(self.throws) {
            None => 0.0,
            Some(which) => {
                world.release.jitter = 0.0;
                [0.0, LATE, -LATE][which]
            }
        };
        // The last three are the same throw.
        let (draw, arm) = (number.min(self.throws), number.min(self.throws) % ARMS);
        let config = ThrowConfig::new(self.robot.clone(), world);
        let throws = ThrowBack {
            tries: 1,
            planner: ThrowPlanConfig::default(),
            ..ThrowBack::default()
        };
        let begun = Instant::now();
        self.plan(description, arm)?;
        let plan_ms = begun.elapsed().as_secs_f64() * 1e3;
        let seed = world_seed(self.seed, draw as u64);
        let mut player = Player::new(&config, description, throws, seed)?;
        player.thrower().aim = Some(self.aim());
        player.late_ns = (late * 1e9) as i64;
        player.world.give(arm)?;
        let throw = player.throw(arm)?;
        let flight = player.world.flight_of(&throw.released);
        let start = throw.released.state;
        let down = down_to(&flight, self.height).unwrap_or(start.position.xy());
        Ok(Flown {
            length: (down - start.position.xy()).norm(),
            down,
            speed: start.velocity.norm(),
            plan_ms,
            torques: throw.torques,
        })
    }

    /// Returns the factor of the speeds that reaches the goal, with an accuracy of 0.01, by bisection.
    fn times_for_goal(&self, with: impl Fn(f64) -> RobotDescription) -> Option<f64> {
        let reaches = |times: f64| {
            self.plan(&with(times), ARMS - 1)
                .is_ok_and(|plan| plan.distance() >= GOAL)
        };
        let (mut low, mut high) = (0.0, FASTEST);
        if !reaches(high) {
            return None;
        }
        while high - low > 0.01 {
            let middle = (low + high) / 2.0;
            if middle > 0.05 && reaches(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Some(high)
    }
}

/// A throw in the world.
#[derive(Debug, Clone, Copy)]
struct Flown {
    length: f64,
    down: nalgebra::Vector2<f64>,
    speed: f64,
    plan_ms: f64,
    torques: ThrowJoints,
}

/// Returns the contribution of every joint to the planned speed.
fn by_joint(plan: &ThrowPlan, robot: &Robot) -> ThrowJoints {
    let swing = Swing::new(robot, plan.arm, &robot.waiting());
    std::array::from_fn(|i| {
        let mut rates = [0.0; THROW_JOINTS];
        rates[i] = plan.rates[i];
        swing.hand(&plan.q, &rates).1.dot(&plan.v.normalize())
    })
}

fn faster_arms(description: &RobotDescription, times: f64) -> RobotDescription {
    let mut description = description.clone();
    for joint in description.arms.iter_mut().flat_map(|arm| &mut arm.joints) {
        joint.speed *= times;
        joint.acceleration *= times;
    }
    description
}

fn faster_turn(description: &RobotDescription, times: f64) -> RobotDescription {
    let mut description = description.clone();
    description.torso.joints[0].speed *= times;
    description.torso.joints[0].acceleration *= times;
    description
}

#[cfg(test)]
mod tests {
    use tactnet_catching_world::Stiffness;

    use super::*;

    fn bench() -> ThrowBench {
        ThrowBench {
            robot: Robot::nominal(),
            world: WorldConfig::default(),
            height: 1.1,
            wheels: None,
            throws: 2,
            seed: 4,
        }
    }

    /// The lag of the drives, unknown drag and spin, and a jitter of half a millisecond cost less than a tenth.
    #[test]
    fn with_a_rigid_torso_balls_fly_as_far_as_planned() {
        let mut bench = bench();
        bench.world.torso.stiffness = Stiffness::Rigid;
        let report = bench.run(|| ()).unwrap();
        let [mean, ..] = report.distance_m;
        assert!((mean / report.planned_m - 1.0).abs() < 0.1, "{report:?}");
        assert!((report.speed_m_s / report.planned_speed_m_s - 1.0).abs() < 0.05);
        let lost = report.distance_lost_mm_at_2ms;
        assert!((1.0..100.0).contains(&lost), "{report:?}");
        assert!(report.displaced_mm_at_2ms >= report.distance_lost_mm_at_2ms - 1e-9);
    }

    #[test]
    fn speeds_for_the_goal_reach_it_and_a_little_less_does_not() {
        let bench = bench();
        let report = bench.run(|| ()).unwrap();
        let times = report.goal.arm_times.unwrap();
        let reach = |times: f64| {
            let description = faster_arms(bench.robot.description(), times);
            bench.plan(&description, 1).unwrap().distance()
        };
        assert!(reach(times) >= 7.0 && reach(times - 0.03) < 7.0);
        let sum: f64 = report.speed_by_joint_m_s.iter().sum();
        assert!((sum - report.planned_speed_m_s).abs() < 1e-9);
    }

    #[test]
    fn settings_that_make_no_sense_are_named() {
        let mut bench = bench();
        bench.height = f64::NAN;
        let error = bench.run(|| ()).unwrap_err().to_string();
        assert!(error.contains("`height`"), "{error}");
    }
}
