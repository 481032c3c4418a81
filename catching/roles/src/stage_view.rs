//! Robot and balls for a web page, from channels only: the state that the stack estimates, not the true one.

use nalgebra::Vector3;
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::calibrate::Corrections;
use tactnet_catching::flight::Flight;
use tactnet_catching_packets::packets::{
    BallPrediction, BallPredictions, CatchOutcome, CatchPhase, CatchStatus, HandState, JointState,
};
use tactnet_catching_packets::{ARMS, JOINTS, joint};
use tactnet_channel::{Bus, ChannelError, GetPort, Packet, Table, now_ns};

use crate::channels::{CATCH_OUTCOME, CATCH_STATE, HAND_STATE, JOINT_STATE, PREDICTION};
use crate::latest_value::{LatestValue, drain};
use crate::{RoleError, RoleSettings};

/// Age of a prediction after which its ball is no longer drawn, in ns.
const IN_THE_AIR_NS: u64 = 300_000_000;
/// Height of the foot of the torso column, in m.
const FOOT: f64 = 0.1;

/// A point in the side view: metres ahead of the robot, metres above the floor.
pub type Side = [f32; 2];

/// Content of the drawing.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Stage {
    /// Foot, hip, knee, chest and head.
    pub body: Vec<Side>,
    /// Left and right arm: shoulder, elbow, wrist, hand.
    pub arms: Vec<[Side; 4]>,
    /// Predicted current positions of the balls.
    pub balls: Vec<Side>,
    /// Hand that holds a ball: 0 left, 1 right.
    pub holds: Option<u32>,
    /// Current activity of the robot, in words.
    pub about: &'static str,
    /// Number of thrown balls.
    pub thrown: u64,
    /// Number of caught balls.
    pub caught: u64,
    /// Number of caught balls with a predicted material.
    pub felt: u64,
    /// Number of correctly predicted materials.
    pub right: u64,
    /// Outcome of the last ball, in words; empty before the first.
    pub last: String,
}

/// Subscribes to the channels that the drawing needs.
pub struct StageView {
    corrections: Corrections,
    joints: LatestValue<JointState>,
    predictions: LatestValue<BallPredictions>,
    hand: LatestValue<HandState>,
    status: LatestValue<CatchStatus>,
    outcomes: GetPort<CatchOutcome>,
    stage: Stage,
}

impl StageView {
    /// Returns true if a table has the channels of the stack.
    pub fn is_on(table: &Table) -> bool {
        let joints = table.channels.get(JOINT_STATE.id);
        joints.is_some_and(|config| config.packet == JointState::NAME)
    }

    /// Opens the channels.
    ///
    /// # Errors
    /// No hub, channels that the table lacks, or a robot's description that cannot be read.
    pub fn open(bus: &Bus) -> Result<Self, RoleError> {
        Ok(Self {
            corrections: RoleSettings::of(bus.table())?.corrections()?,
            joints: JOINT_STATE.latest(bus)?,
            predictions: PREDICTION.latest(bus)?,
            hand: HAND_STATE.latest(bus)?,
            status: CATCH_STATE.latest(bus)?,
            outcomes: CATCH_OUTCOME.get(bus)?,
            stage: Stage::default(),
        })
    }

    /// Takes all waiting packets and returns the updated drawing.
    ///
    /// # Errors
    /// Broken channels.
    pub fn look(&mut self) -> Result<&Stage, ChannelError> {
        drain(&self.outcomes, |outcome| self.stage.take(outcome))?;
        if let Some(state) = self.joints.look()? {
            let links = self.corrections.joints(state).q;
            (self.stage.body, self.stage.arms) = limbs(self.corrections.robot(), &links);
        }
        let now = now_ns();
        let balls = self.predictions.look()?.map(BallPredictions::valid);
        let balls = balls.into_iter().flatten();
        self.stage.balls = balls.filter_map(|ball| place(ball, now)).collect();
        let held = self.hand.look()?.filter(|hand| hand.holds == 1);
        self.stage.holds = held.map(|hand| hand.arm);
        let phase = self.status.look()?.and_then(CatchStatus::phase);
        self.stage.about = about(phase, held.is_some());
        Ok(&self.stage)
    }
}

impl Stage {
    fn take(&mut self, outcome: &CatchOutcome) {
        self.thrown += 1;
        let (material, felt) = (outcome.material.as_str(), outcome.felt.as_str());
        self.last = if outcome.caught == 1 {
            self.caught += 1;
            let side = if outcome.arm == 0 { "left" } else { "right" };
            format!("Ball {}: caught with the {side} hand", self.thrown)
        } else {
            format!("Ball {}: missed", self.thrown)
        };
        if outcome.arms == 0 {
            self.last += ", out of reach";
        }
        if !felt.is_empty() {
            let is_right = felt == material;
            self.felt += 1;
            self.right += u64::from(is_right);
            let mark = if is_right { "right" } else { "wrong" };
            self.last += &format!("; felt like {felt}, it is {material}: {mark}");
        }
        self.last.push('.');
    }
}

fn side(point: &Vector3<f64>) -> Side {
    [point.x as f32, point.z as f32]
}

fn limbs(robot: &Robot, q: &[f64; JOINTS]) -> (Vec<Side>, Vec<[Side; 4]>) {
    let torso = &robot.description().torso;
    let chest = robot.chest(q);
    let hip = Vector3::new(0.0, q[joint::PLATFORM], torso.lower_pitch_height);
    let (yaw, lean) = (q[joint::TORSO.start], q[joint::TORSO.start + 1]);
    let forward = lean.sin() * torso.lower_length;
    let up = lean.cos() * torso.lower_length;
    let knee = hip + Vector3::new(forward * yaw.cos(), forward * yaw.sin(), up);
    let head = chest * robot.head(q);
    let body = [
        Vector3::new(hip.x, hip.y, FOOT),
        hip,
        knee,
        chest.translation.vector,
        head.translation.vector,
    ];
    let arms = (0..ARMS).map(|arm| {
        let points = robot.arm(arm).points(&joint::of_arm(q, arm));
        points.map(|point| side(&(chest * nalgebra::Point3::from(point)).coords))
    });
    (body.iter().map(side).collect(), arms.collect())
}

/// Returns the current position of a ball, or `None` if it is no longer in the air.
fn place(ball: &BallPrediction, now_ns: u64) -> Option<Side> {
    let since = now_ns.checked_sub(ball.t_ns)?;
    let flight = Flight::of(ball);
    let now = (since < IN_THE_AIR_NS).then(|| flight.after(since as f64 * 1e-9))?;
    (now.p.z > 0.0).then(|| side(&now.p))
}

fn about(phase: Option<CatchPhase>, holds: bool) -> &'static str {
    match phase {
        None | Some(CatchPhase::Starting) => "starting",
        Some(CatchPhase::Armed) if holds => "feels the ball",
        Some(CatchPhase::Armed) => "waits for a ball",
        Some(CatchPhase::Tracking) => "sees a ball",
        Some(CatchPhase::Reaching) => "reaches for it",
        Some(CatchPhase::Closed) => "closes its hand",
        Some(CatchPhase::GoingBack) => "goes back",
        Some(CatchPhase::Braking) => "brakes",
        Some(CatchPhase::Stuck) => "is stuck",
        Some(CatchPhase::Throwing) => "throws the ball back",
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_catching_packets::packets::Text;

    use super::*;

    #[test]
    fn a_robot_that_waits_stands_upright_with_its_hands_before_it() {
        let robot = Robot::nominal();
        let (body, arms) = limbs(&robot, &robot.waiting());
        assert!(body.is_sorted_by(|a, b| b[1] > a[1]), "{body:?}");
        let chest = body[3];
        for arm in arms {
            assert!(arm[3][0] > chest[0] + 0.2, "{arm:?}");
        }
    }

    #[test]
    fn balls_fly_on_until_they_are_old_or_on_the_floor() {
        let ball = |z: f64| BallPrediction {
            t_ns: 1_000_000_000,
            p: [3.0, 0.0, z],
            v: [-5.0, 0.0, 0.0],
            ..BallPrediction::zeroed()
        };
        let after = place(&ball(1.5), 1_100_000_000).unwrap();
        assert!((after[0] - 2.5).abs() < 1e-3, "{after:?}");
        assert!((1.4..1.46).contains(&after[1]), "{after:?}");
        assert_eq!(place(&ball(1.5), 1_400_000_000), None);
        assert_eq!(place(&ball(0.01), 1_100_000_000), None);
        assert_eq!(place(&ball(1.5), 900_000_000), None);
    }

    #[test]
    fn outcomes_are_counted_and_told() {
        let mut stage = Stage::default();
        let outcome = |caught, material, felt| CatchOutcome {
            caught,
            arms: caught,
            material: Text::new(material),
            felt: Text::new(felt),
            ..CatchOutcome::zeroed()
        };
        stage.take(&outcome(1, "cork", "cork"));
        let caught = "Ball 1: caught with the left hand; felt like cork, it is cork: right.";
        assert_eq!(stage.last, caught);
        stage.take(&outcome(1, "cork", "felt"));
        stage.take(&outcome(0, "", ""));
        assert_eq!(stage.last, "Ball 3: missed, out of reach.");
        let counts = [stage.thrown, stage.caught, stage.felt, stage.right];
        assert_eq!(counts, [3, 2, 2, 1]);
    }
}
