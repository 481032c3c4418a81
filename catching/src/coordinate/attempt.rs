//! One attempt to catch, from the waiting pose until the hands close: requests to the planner, paths of arms and body,
//! closing times.

use bytemuck::Zeroable;
use nalgebra::{Isometry3, Vector3};
use tactnet_catching_packets::packets::{
    BallPrediction, BallPredictions, HandCommand, MAX_BALLS, PlanFailure, PlanRequest, PlanResult,
};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, JOINTS, joint};

use super::assign::assign;
use super::body::BodyMotion;
use super::config::CoordinatorConfig;
use super::neck::GazeTargets;
use super::room::Room;
use crate::flight::{Flight, FlightPath};
use crate::plan::ChestWay;
use crate::ramp::Ramp;
use crate::robot::Robot;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CatchState {
    /// Waits for a ball.
    Armed,
    /// A ball is valid, but no catch is planned.
    Tracking,
    /// At least one arm executes a catch motion.
    Reaching,
    /// All hands have received their last closing time.
    Closed,
}

/// Maximum number of simultaneous requests.
pub(super) const MAX_REQUESTS: usize = ARMS * MAX_BALLS;
/// Minimum time between a change of the closing time and the closing, in ns.
const LAST_CLOSING_NS: u64 = 10_000_000;
/// Minimum time of an answer, in ns. A path that starts within this time has started when the next one arrives.
const ANSWER_NS: u64 = 1_000_000;

#[derive(Debug, Clone, Copy)]
struct Reaching {
    ball: u64,
    catch_ns: u64,
    q: [f64; ARM_JOINTS],
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct ArmMotion {
    start_ns: u64,
    ramps: [Ramp; ARM_JOINTS],
}

#[derive(Debug, Clone, Copy)]
struct Task {
    motion: ArmMotion,
    reaching: Option<Reaching>,
    hand: Option<HandCommand>,
}

/// Attempt to catch, which decides the arm and time of each catch.
#[derive(Debug, Clone)]
pub(super) struct CatchAttempt {
    robot: Robot,
    config: CoordinatorConfig,
    ready: [f64; JOINTS],
    /// Motion of platform and torso.
    pub body: BodyMotion,
    arms: [ArmMotion; ARMS],
    reaching: [Option<Reaching>; ARMS],
    /// Closing commands of the hands.
    pub hands: [Option<HandCommand>; ARMS],
    /// Last task of each arm that the controller confirmed.
    taken: [Option<Task>; ARMS],
    /// Balls that the head looks at.
    pub looked_at: GazeTargets,
    pub state: CatchState,
    pending: bool,
    /// Number of failed plans for valid balls.
    pub no_plans: u64,
    /// Free space for platform and torso, if there is a map.
    room: Option<Room>,
    /// Transform from the chest pose by joint angles to the last measured one.
    deviation: Isometry3<f64>,
}

impl CatchAttempt {
    /// Creates an attempt with joints at rest in `ready`.
    ///
    /// - `room`: free space for platform and torso. The arms' planner must avoid obstacles itself.
    pub fn new(
        robot: Robot,
        config: CoordinatorConfig,
        ready: [f64; JOINTS],
        room: Option<Room>,
    ) -> Self {
        let standing = |arm: usize| ArmMotion {
            start_ns: 0,
            ramps: joint::of_arm(&ready, arm).map(Ramp::standing),
        };
        Self {
            body: BodyMotion::standing(&ready),
            arms: [standing(0), standing(1)],
            reaching: [None; ARMS],
            hands: [None; ARMS],
            taken: [None; ARMS],
            looked_at: [None; MAX_BALLS],
            state: CatchState::Armed,
            pending: false,
            no_plans: 0,
            room,
            deviation: Isometry3::identity(),
            robot,
            config,
            ready,
        }
    }

    /// Returns the next attempt, which starts in the current pose. All joints must be at rest.
    pub fn next(&self, now_ns: u64) -> Self {
        let mut ready = self.body_at(now_ns);
        for (arm, motion) in self.arms.iter().enumerate() {
            let elapsed = (now_ns as f64 - motion.start_ns as f64) * 1e-9;
            for (i, ramp) in motion.ramps.iter().enumerate() {
                ready[joint::ARM[arm].start + i] = ramp.at(elapsed).0;
            }
        }
        Self {
            arms: self.arms,
            ..Self::new(self.robot.clone(), self.config, ready, self.room.clone())
        }
    }

    /// Returns the planned motion of the chest from `start_ns` on, in the frame of its measurement.
    pub fn chest_way(&self, start_ns: u64) -> ChestWay {
        self.body
            .chest_way(&self.robot, &self.ready, &self.deviation, start_ns)
    }

    /// Returns number and catch time of the ball that an arm is reaching for.
    pub fn target(&self, arm: usize) -> Option<(u64, u64)> {
        self.reaching[arm].map(|reaching| (reaching.ball, reaching.catch_ns))
    }

    /// Returns the motion of an arm: its start in ns and the ramps of its joints.
    pub fn arm(&self, arm: usize) -> (u64, &[Ramp; ARM_JOINTS]) {
        (self.arms[arm].start_ns, &self.arms[arm].ramps)
    }

    /// Processes the motion that the controller executes. If it differs from the planned one, the plan was rejected and
    /// the arm resumes its previous task or none.
    pub fn carried_out(&mut self, arm: usize, start_ns: u64, ramps: [Ramp; ARM_JOINTS]) {
        let motion = ArmMotion { start_ns, ramps };
        if self.arms[arm] == motion {
            self.taken[arm] = Some(Task {
                motion,
                reaching: self.reaching[arm],
                hand: self.hands[arm],
            });
            return;
        }
        let task = self.taken[arm].filter(|task| task.motion == motion);
        self.arms[arm] = motion;
        self.reaching[arm] = task.and_then(|task| task.reaching);
        self.hands[arm] = task.and_then(|task| task.hand);
        if self.state == CatchState::Reaching && self.reaching.iter().all(Option::is_none) {
            self.state = CatchState::Tracking;
        }
    }

    /// Processes predictions and returns requests to the planner for the selected arms. Their answers are due after
    /// [`CoordinatorConfig::plan_delay`] ([`CatchAttempt::planned`]). `chest` is the measured pose of the chest in the
    /// inertial frame. Its deviation from the pose by joint angles is assumed constant until the catch.
    pub fn predictions(
        &mut self,
        arms: [bool; ARMS],
        now_ns: u64,
        predictions: &BallPredictions,
        chest: &Isometry3<f64>,
    ) -> [Option<PlanRequest>; MAX_REQUESTS] {
        let mut requests = [None; MAX_REQUESTS];
        let deviation = self.robot.chest(&self.body_at(now_ns)).inverse() * chest;
        self.deviation = deviation;
        let CoordinatorConfig {
            existence, frames, ..
        } = self.config;
        let valid = |ball: &&BallPrediction| ball.existence >= existence && ball.frames >= frames;
        let Some(first) = predictions.valid().iter().find(valid) else {
            return requests;
        };
        let start_ns = now_ns + (self.config.plan_delay * 1e9) as u64;
        let balls = predictions.valid().iter();
        let mut flights = balls.map(|ball| (ball.t_ns, Flight::of(ball)));
        self.looked_at = std::array::from_fn(|_| flights.next());
        if self.state == CatchState::Armed {
            self.state = CatchState::Tracking;
            // With two balls only the arms move.
            if self.config.lower_body && predictions.count == 1 {
                self.body = self.body_towards(now_ns, first, chest);
            }
        }
        // Chest pose at the end of the body's motion.
        let end_ns = self.body.end_ns().max(start_ns);
        let to_chest = (self.robot.chest(&self.body_at(end_ns)) * deviation).inverse();
        self.follow_closing_times(now_ns, predictions, &to_chest);
        if self.pending || self.state == CatchState::Closed {
            return requests;
        }
        let mut count = 0;
        for ball in predictions.valid().iter().filter(valid) {
            for arm in (0..ARMS).filter(|&arm| arms[arm]) {
                if !self.may_request(ball.ball, arm, now_ns) {
                    continue;
                }
                requests[count] = self.request(ball, arm, start_ns, &to_chest);
                count += usize::from(requests[count].is_some());
            }
        }
        self.pending = count > 0;
        requests
    }

    /// Returns the motion of platform and torso towards a ball, as far as the free space allows.
    fn body_towards(
        &self,
        now_ns: u64,
        ball: &BallPrediction,
        chest: &Isometry3<f64>,
    ) -> BodyMotion {
        let seen = flight_at(ball, now_ns).in_frame(&chest.inverse());
        let path = FlightPath::new(seen);
        let wanted = BodyMotion::towards(&self.robot, &self.body_at(now_ns), &path, now_ns);
        match &self.room {
            None => wanted,
            Some(room) => room.within(&self.robot, &self.ready, &self.deviation, &wanted),
        }
    }

    /// Returns the request of a plan that starts at `start_ns`, or `None` too close to the catch.
    fn request(
        &self,
        ball: &BallPrediction,
        arm: usize,
        start_ns: u64,
        to_chest: &Isometry3<f64>,
    ) -> Option<PlanRequest> {
        let left = self.reaching[arm].map(|r| (r.catch_ns as f64 - start_ns as f64) * 1e-9);
        if left.is_some_and(|left| left < self.config.last_correction) {
            return None;
        }
        let end_ns = self.body.end_ns().max(start_ns);
        let motion = &self.arms[arm];
        let elapsed = (start_ns as f64 - motion.start_ns as f64) * 1e-9;
        let state: [(f64, f64); ARM_JOINTS] = std::array::from_fn(|i| motion.ramps[i].at(elapsed));
        let other = &self.arms[(arm + 1) % ARMS];
        Some(PlanRequest {
            ball: ball.ball,
            arm: arm as u64,
            start_ns,
            flight: flight_at(ball, start_ns)
                .in_frame(to_chest)
                .packet(start_ns),
            q0: state.map(|(q, _)| q),
            w0: state.map(|(_, w)| w),
            earliest: (end_ns - start_ns) as f64 * 1e-9,
            latest: 1.8,
            objective: self.config.objective as u64,
            has_last: u64::from(left.is_some()),
            last_q: self.reaching[arm].map_or([0.0; ARM_JOINTS], |reaching| reaching.q),
            last_t: left.unwrap_or(0.0),
            has_other: 1,
            other_start_ns: other.start_ns,
            other: other.ramps.each_ref().map(Ramp::packet),
            ..PlanRequest::zeroed()
        })
    }

    /// Returns true if a new plan of an arm for a ball is permitted now.
    fn may_request(&self, ball: u64, arm: usize, now_ns: u64) -> bool {
        let holder = self
            .reaching
            .iter()
            .position(|r| r.is_some_and(|r| r.ball == ball));
        if holder.is_some() && !self.config.replan {
            return false;
        }
        // The controller rejects a path behind one that has not started yet.
        if self.arms[arm].start_ns > now_ns + ANSWER_NS {
            return false;
        }
        // Each ball and each arm keeps its assignment.
        holder == Some(arm) || (holder.is_none() && self.reaching[arm].is_none())
    }

    /// Processes the planner's answers to one call of [`CatchAttempt::predictions`] at their due time.
    pub fn planned(&mut self, answers: &[PlanResult]) {
        self.pending = false;
        let is_plan = |answer: &&PlanResult| answer.failure() == Some(PlanFailure::NotFailed);
        self.no_plans += answers.iter().filter(|answer| !is_plan(answer)).count() as u64;
        // Balls in the order of their answers.
        let mut balls = [None; MAX_BALLS];
        let mut costs = [[None; ARMS]; MAX_BALLS];
        for answer in answers.iter().filter(is_plan) {
            let number = answer.request.ball;
            let Some(place) = balls
                .iter()
                .position(|ball| ball.is_none_or(|ball| ball == number))
            else {
                continue;
            };
            balls[place] = Some(number);
            costs[place][answer.request.arm as usize] = Some(answer.cost);
        }
        for (arm, place) in assign(&costs).iter().enumerate() {
            let number = place.and_then(|place| balls[place]);
            let mut plans = answers.iter().filter(is_plan);
            let Some(plan) = plans
                .find(|plan| plan.request.arm == arm as u64 && Some(plan.request.ball) == number)
            else {
                continue;
            };
            let start_ns = plan.request.start_ns;
            let catch_ns = start_ns + (plan.t * 1e9) as u64;
            self.arms[arm] = ArmMotion {
                start_ns,
                ramps: plan.ramps.each_ref().map(Ramp::of),
            };
            self.reaching[arm] = Some(Reaching {
                ball: plan.request.ball,
                catch_ns,
                q: plan.q,
            });
            self.hands[arm] = Some(HandCommand {
                arm: arm as u64,
                catch_ns,
            });
            self.state = CatchState::Reaching;
        }
    }

    /// Closes the attempt once no closing time can change any more.
    pub fn tick(&mut self, now_ns: u64) {
        let last = self.hands.iter().flatten().map(|hand| hand.catch_ns).max();
        if self.state == CatchState::Reaching
            && last.is_some_and(|last| now_ns + LAST_CLOSING_NS >= last)
        {
            self.state = CatchState::Closed;
        }
    }

    /// Returns the planned positions of platform and torso, with all other joints in the waiting pose.
    fn body_at(&self, now_ns: u64) -> [f64; JOINTS] {
        let (mut q, mut dq) = (self.ready, [0.0; JOINTS]);
        self.body.write(now_ns, &mut q, &mut dq);
        q
    }

    /// Adjusts the closing times to the time at which the ball crosses the plane of the catch frame, even without a
    /// path correction.
    fn follow_closing_times(
        &mut self,
        now_ns: u64,
        predictions: &BallPredictions,
        to_chest: &Isometry3<f64>,
    ) {
        for (arm, (reaching, hand)) in self.reaching.iter().zip(&mut self.hands).enumerate() {
            let (Some(reaching), Some(hand)) = (reaching, hand) else {
                continue;
            };
            let mut balls = predictions.valid().iter();
            let ball = balls.find(|ball| ball.ball == reaching.ball);
            let Some(ball) = ball.filter(|_| hand.catch_ns > now_ns + LAST_CLOSING_NS) else {
                continue;
            };
            let pose = self.robot.arm(arm).forward(&reaching.q);
            let axis: Vector3<f64> = pose.rotation.column(2).into_owned();
            let planned = flight_at(ball, hand.catch_ns).in_frame(to_chest);
            // Newton's method; the ball's speed is almost constant over some milliseconds.
            let mut shift = 0.0;
            for _ in 0..3 {
                let there = planned.after(shift);
                let speed = there.v.dot(&axis);
                if speed.abs() < 0.5 {
                    break;
                }
                shift -= (there.p - pose.position).dot(&axis) / speed;
            }
            if shift.abs() < 0.1 {
                let shifted = hand.catch_ns as f64 + shift * 1e9;
                hand.catch_ns = shifted.max((now_ns + LAST_CLOSING_NS) as f64) as u64;
            }
        }
    }
}

fn flight_at(ball: &BallPrediction, t_ns: u64) -> Flight {
    Flight::of(ball).after((t_ns as f64 - ball.t_ns as f64) * 1e-9)
}

#[cfg(test)]
mod tests;
