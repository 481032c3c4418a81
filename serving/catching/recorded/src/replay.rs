//! The same packets through the same parts again.

use serde::Serialize;
use tactnet_catching::plan::Planner;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{BallPredictions, Circles, HeadPose, PlanResult};
use tactnet_catching_roles::{RoleSettings, Sight, answer, planning_ends_ns};
use tactnet_recording::{RecordedPacket, Recording};

use crate::RecordedError;

/// A plan that ran out of time, as [`PlanResult::failure`] says.
const OUT_OF_TIME: u64 = 4;

/// Answers of a part, in the recording and again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Compared {
    /// Answers in the recording that were asked for again.
    pub answers: usize,
    /// Of them, the same bit by bit.
    pub same: usize,
    /// Plans that ran out of time in the recording, or were there only when it had run out: how far they come depends on the machine.
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
    let robot = settings.robot()?;
    let planners: [Planner; ARMS] =
        std::array::from_fn(|arm| Planner::new(&robot, arm, settings.planner));
    let mut sight = Sight::new(&settings)?;
    let mut replayed = Replayed::default();
    let mut expected: Vec<BallPredictions> = Vec::new();
    for entry in &recording.entries {
        let RecordedPacket::Plain(packet) = &entry.packet else {
            continue;
        };
        if let Some(recorded) = packet.get::<PlanResult>() {
            replayed.plans.plan(&planners, &recorded, entry.time_ns);
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

impl Compared {
    /// - `put_ns`: when the answer was put
    fn plan(&mut self, planners: &[Planner; ARMS], recorded: &PlanResult, put_ns: u64) {
        let question = &recorded.request;
        if recorded.failure == OUT_OF_TIME || put_ns >= planning_ends_ns(question) {
            self.out_of_time += 1;
            return;
        }
        let planner = planners.get(question.arm as usize);
        let again = planner.and_then(|planner| answer(planner, question, || false));
        let Some(again) = again else {
            self.alone += 1;
            return;
        };
        self.answers += 1;
        // What it took is another matter.
        let again = PlanResult {
            computing_ns: recorded.computing_ns,
            ..again
        };
        self.same += usize::from(bytemuck::bytes_of(&again) == bytemuck::bytes_of(recorded));
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
