//! Replay of recorded packets through tracker and planners.

use serde::Serialize;
use tactnet_catching::coordinate::{Answering, answer};
use tactnet_catching::plan::Planner;
use tactnet_catching::track::PairTracker;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{BallPredictions, Circles, HeadPose, PlanResult};
use tactnet_catching_roles::{RoleError, RoleSettings};
use tactnet_recording::{RecordedPacket, Recording};

use super::RecordedError;
use super::decisions::Decisions;

/// Comparison of recorded and recomputed results of one part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Compared {
    /// Number of recorded results that were recomputed.
    pub answers: usize,
    /// Number of results that are equal bit by bit.
    pub same: usize,
    /// Number of plans that the time limit cut short. They depend on the speed of the machine and are not recomputed.
    pub out_of_time: usize,
    /// Number of results without a request, or requests without a result, because the recording lacks a packet.
    pub alone: usize,
}

/// Comparison of all recorded results.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Replayed {
    /// Comparison of the planners, which run without a time limit in the replay.
    pub plans: Compared,
    /// Comparison of the tracker, which takes circles and poses in the order of publication.
    pub predictions: Compared,
    /// Comparison of the coordinator: steps that sent packets. `alone` counts steps with a missing input.
    pub decisions: Compared,
}

/// Recomputes the results of tracker, coordinator and planners in a recording.
///
/// The results of tracker and coordinator are equal only if the recording began before them; they differ after a
/// restart.
///
/// # Errors
/// No packets of a catching stack, or invalid settings in the table of the recording.
pub fn replay(recording: &Recording) -> Result<Replayed, RecordedError> {
    let settings = RoleSettings::of(&recording.table)?;
    let corrections = settings.corrections()?;
    let robot = corrections.robot();
    let planners: [Planner; ARMS] =
        std::array::from_fn(|arm| Planner::new(robot, arm, settings.planner));
    let mut tracker =
        PairTracker::new(corrections.clone(), settings.track()).map_err(RoleError::from)?;
    let mut decisions = Decisions::new(settings.new_coordinator()?);
    let mut replayed = Replayed::default();
    let mut expected: Vec<BallPredictions> = Vec::new();
    for entry in &recording.entries {
        let RecordedPacket::Plain(packet) = &entry.packet else {
            continue;
        };
        decisions.take(&entry.channel, packet);
        if let Some(recorded) = packet.get::<PlanResult>() {
            replayed.plans.plan(&planners, &recorded);
        } else if let Some(pose) = packet.get::<HeadPose>() {
            tracker.pose(&pose);
        } else if let Some(circles) = packet.get::<Circles>() {
            let pair = tracker.pair(&circles);
            let seen = pair.and_then(|pair| tracker.predict(&pair));
            expected.extend(seen);
        } else if let Some(recorded) = packet.get::<BallPredictions>() {
            replayed.predictions.prediction(&mut expected, &recorded);
        }
    }
    replayed.predictions.alone += expected.len();
    replayed.decisions = decisions.end();
    if replayed == Replayed::default() {
        return Err(RecordedError::NotCatching);
    }
    Ok(replayed)
}

impl Compared {
    fn plan(&mut self, planners: &[Planner; ARMS], recorded: &PlanResult) {
        if recorded.cut_short == 1 {
            self.out_of_time += 1;
            return;
        }
        let question = &recorded.request;
        let planner = planners.get(question.arm as usize);
        let again =
            planner.and_then(|planner| answer(planner, question, &Answering::default(), || false));
        let Some(again) = again else {
            self.alone += 1;
            return;
        };
        // Computation times may differ.
        let again = PlanResult {
            computing_ns: recorded.computing_ns,
            ..again
        };
        self.answers += 1;
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
