//! Replay of recorded packets through tracker and planners.

use std::collections::VecDeque;

use serde::Serialize;
use tactnet_catching::coordinate::{Answering, PhaseConfig, answer};
use tactnet_catching::plan::Planner;
use tactnet_catching::track::PairTracker;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{
    BallPredictions, Circles, HeadPose, PlanFailure, PlanRequest, PlanResult,
};
use tactnet_catching_roles::{RoleError, RoleSettings, planning_ends_ns};
use tactnet_recording::{RecordedPacket, Recording};

use super::RecordedError;
use super::decisions::Decisions;

/// Number of requests that the comparison of the recorder's and the robot's clock uses.
const QUESTIONS: usize = 64;

/// Comparison of recorded and recomputed results of one part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Compared {
    /// Number of recorded results that were recomputed.
    pub answers: usize,
    /// Number of results that are equal bit by bit.
    pub same: usize,
    /// Number of plans that ran out of time, or that differ and were published only at the time limit. Their results
    /// depend on the speed of the machine.
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
    let mut clocks = Clocks {
        ahead_ns: (settings.coordinator.plan_delay * 1e9) as u64,
        phases: settings.phases(),
        differ_ns: VecDeque::new(),
    };
    for entry in &recording.entries {
        let RecordedPacket::Plain(packet) = &entry.packet else {
            continue;
        };
        decisions.take(&entry.channel, packet);
        if let Some(recorded) = packet.get::<PlanResult>() {
            let late = clocks.was_late(&recorded.request, entry.time_ns);
            replayed.plans.plan(&planners, &recorded, late);
        } else if let Some(question) = packet.get::<PlanRequest>() {
            clocks.ask(&question, entry.time_ns);
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

/// Offset between the recorder's clock, which stamps publications, and the robot's clock, which stamps packets.
struct Clocks {
    /// Time from a request to the start of its motion, in ns.
    ahead_ns: u64,
    phases: PhaseConfig,
    /// Offsets according to the latest requests, each including the delay until publication, in ns.
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

    /// Returns true if a result that was published at `put_ns` arrived at the time limit.
    fn was_late(&self, question: &PlanRequest, put_ns: u64) -> bool {
        let ends_ns = i128::from(planning_ends_ns(question, &self.phases));
        let least = self.differ_ns.iter().min();
        least.is_some_and(|differ_ns| i128::from(put_ns) >= ends_ns + differ_ns)
    }
}

impl Compared {
    /// Compares a plan.
    ///
    /// - `late`: the result was published at the time limit
    fn plan(&mut self, planners: &[Planner; ARMS], recorded: &PlanResult, late: bool) {
        if recorded.failure() == Some(PlanFailure::OutOfTime) {
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
