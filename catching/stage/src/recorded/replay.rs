//! The same packets through the same parts again.

use std::collections::VecDeque;

use serde::Serialize;
use tactnet_catching::plan::Planner;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{
    BallPredictions, Circles, HeadPose, PlanFailure, PlanRequest, PlanResult,
};
use tactnet_catching_roles::{RoleSettings, Sight, answer, planning_ends_ns};
use tactnet_recording::{RecordedPacket, Recording};

use super::RecordedError;

/// Questions by which the clocks of recorder and robot are compared.
const QUESTIONS: usize = 64;

/// Answers of a part, in the recording and again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Compared {
    /// Answers in the recording that were asked for again.
    pub answers: usize,
    /// Of them, the same bit by bit.
    pub same: usize,
    /// Plans that ran out of time in the recording, or differ and were there only when it had run out: how far they come depends on the machine.
    pub out_of_time: usize,
    /// Answers without a question in the recording, or the other way round: packets that it lacks.
    pub alone: usize,
}

/// A recording's answers, and those of now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Replayed {
    /// Of the planners: questions answered again, without a limit of time.
    pub plans: Compared,
    /// Of the tracker: circles and poses taken again, in the order in which they were put.
    pub predictions: Compared,
}

/// Asks tracker and planners again what a recording holds.
///
/// The tracker's answers are the same only if the recording began before it; what follows a tracker that was killed differs.
///
/// # Errors
/// No packets of a catching stack; settings of the recording's table that cannot be used.
pub fn replay(recording: &Recording) -> Result<Replayed, RecordedError> {
    let settings = RoleSettings::of(&recording.table)?;
    let corrections = settings.corrections()?;
    let robot = corrections.robot();
    let planners: [Planner; ARMS] =
        std::array::from_fn(|arm| Planner::new(robot, arm, settings.planner));
    let mut sight = Sight::new(&settings)?;
    let mut replayed = Replayed::default();
    let mut expected: Vec<BallPredictions> = Vec::new();
    let mut clocks = Clocks {
        ahead_ns: (settings.coordinator.plan_delay * 1e9) as u64,
        differ_ns: VecDeque::new(),
    };
    for entry in &recording.entries {
        let RecordedPacket::Plain(packet) = &entry.packet else {
            continue;
        };
        if let Some(recorded) = packet.get::<PlanResult>() {
            let late = clocks.was_late(&recorded.request, entry.time_ns);
            replayed.plans.plan(&planners, &recorded, late);
        } else if let Some(question) = packet.get::<PlanRequest>() {
            clocks.ask(&question, entry.time_ns);
        } else if let Some(pose) = packet.get::<HeadPose>() {
            sight.pose(&pose);
        } else if let Some(circles) = packet.get::<Circles>() {
            let seen = sight.pair(&circles).and_then(|pair| sight.predict(&pair));
            expected.extend(seen);
        } else if let Some(recorded) = packet.get::<BallPredictions>() {
            replayed.predictions.prediction(&mut expected, &recorded);
        }
    }
    replayed.predictions.alone += expected.len();
    if replayed == Replayed::default() {
        return Err(RecordedError::NotCatching);
    }
    Ok(replayed)
}

/// By how much the recorder's clock, which says when packets were put, is ahead of the robot's, which packets have in them.
struct Clocks {
    /// From a question to the motion that it is for, ns.
    ahead_ns: u64,
    /// What the newest questions tell, each with the time that it took to its channel, ns.
    differ_ns: VecDeque<i128>,
}

impl Clocks {
    fn ask(&mut self, question: &PlanRequest, put_ns: u64) {
        if self.differ_ns.len() == QUESTIONS {
            self.differ_ns.pop_front();
        }
        let asked_ns = i128::from(question.start_ns) - i128::from(self.ahead_ns);
        self.differ_ns.push_back(i128::from(put_ns) - asked_ns);
    }

    /// Returns true if an answer that was put at `put_ns` came when time was up.
    fn was_late(&self, question: &PlanRequest, put_ns: u64) -> bool {
        let ends_ns = i128::from(planning_ends_ns(question));
        let least = self.differ_ns.iter().min();
        least.is_some_and(|differ_ns| i128::from(put_ns) >= ends_ns + differ_ns)
    }
}

impl Compared {
    /// - `late`: the answer was there when time was up
    fn plan(&mut self, planners: &[Planner; ARMS], recorded: &PlanResult, late: bool) {
        if recorded.failure() == Some(PlanFailure::OutOfTime) {
            self.out_of_time += 1;
            return;
        }
        let question = &recorded.request;
        let planner = planners.get(question.arm as usize);
        let again = planner.and_then(|planner| answer(planner, question, || false));
        let Some(again) = again else {
            self.alone += 1;
            return;
        };
        // What it took is another matter.
        let again = PlanResult {
            computing_ns: recorded.computing_ns,
            ..again
        };
        let same = bytemuck::bytes_of(&again) == bytemuck::bytes_of(recorded);
        if late && !same {
            self.out_of_time += 1;
            return;
        }
        self.answers += 1;
        self.same += usize::from(same);
    }

    fn prediction(&mut self, expected: &mut Vec<BallPredictions>, recorded: &BallPredictions) {
        let is = |again: &BallPredictions| again.exposure_ns == recorded.exposure_ns;
        let Some(place) = expected.iter().position(is) else {
            self.alone += 1;
            return;
        };
        self.alone += place;
        let again = expected.drain(..=place).next_back();
        self.answers += 1;
        let same =
            again.is_some_and(|again| bytemuck::bytes_of(&again) == bytemuck::bytes_of(recorded));
        self.same += usize::from(same);
    }
}
