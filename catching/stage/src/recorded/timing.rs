//! Durations of all steps, from the timestamps in packets.

use std::collections::HashMap;

use serde::Serialize;
use tactnet_catching_packets::packets::{
    ArmPath, CatchOutcome, HeadPose, ImuSample, JointCommand, JointState, SafetyState,
};
use tactnet_catching_roles::{CatchTimes, Milliseconds, RoleSettings};
use tactnet_recording::Recording;

use super::chain::{Chain, chains};
use super::{Put, RecordedError, packets_of};

/// One step from an exposure to its path.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// Name of the step.
    pub name: &'static str,
    /// Processes that perform the step.
    pub process: &'static str,
    /// End of the step, in ms after the middle of the exposure.
    pub ends_ms: Milliseconds,
    /// Duration of the step, in ms.
    pub takes_ms: Milliseconds,
}

/// Durations in a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Timing {
    /// Time from the first to the last packet, in s.
    pub seconds: f64,
    /// Number of complete chains: first paths of an exposure and an arm, with all packets before them.
    pub paths: usize,
    /// Number of such paths with a missing packet in their chain.
    pub incomplete: usize,
    /// Steps in temporal order.
    pub steps: Vec<Step>,
    /// Time from the middle of an exposure to the path that follows from it.
    pub exposure_to_path_ms: Option<Milliseconds>,
    /// Age of the last picture behind the path of a caught ball, at the catch.
    pub last_picture_age_ms: Option<Milliseconds>,
    /// Age of the last head pose behind the path of a caught ball, at the catch: the last measurement with an
    /// inertial unit of the thesis.
    pub last_measurement_age_ms: Option<Milliseconds>,
    /// Time from the start of a controller cycle (1 kHz) to its command.
    pub beat_to_command_ms: Option<Milliseconds>,
    /// Time between two joint states.
    pub joint_period_ms: Option<Milliseconds>,
    /// Time from an inertial sample to its head pose.
    pub imu_to_pose_ms: Option<Milliseconds>,
    /// Time from a joint command to the verdict of the safety monitor.
    pub command_to_monitor_ms: Option<Milliseconds>,
}

/// Computes the durations in a recording.
///
/// # Errors
/// No packets of a catching stack, invalid settings in the table of the recording, or an unknown start of the
/// channels' clock.
pub fn timing(recording: &Recording) -> Result<Timing, RecordedError> {
    let settings = RoleSettings::of(&recording.table)?;
    // Only a calibrated stack changes the timestamps of its sensors.
    let calibrated = settings.calibration.is_some();
    let corrections = calibrated.then(|| settings.corrections()).transpose()?;
    let corrections = corrections.as_ref();
    let exposure = |stamp_ns| corrections.map_or(stamp_ns, |known| known.exposure(stamp_ns));
    let sample = |sample: &ImuSample| {
        corrections.map_or(sample.sensor_ns, |known| known.sample(sample).sensor_ns)
    };
    let (chains, incomplete) = chains(recording, exposure)?;
    let states = packets_of::<JointState>(recording, None)?;
    if chains.is_empty() && incomplete == 0 && states.is_empty() {
        return Err(RecordedError::NotCatching);
    }
    let caught = catch_times(recording)?;
    let commands = packets_of::<JointCommand>(recording, None)?;
    let beats = commands
        .iter()
        .map(|put| between(put.packet.command_ns, put.ns));
    let beat_to_command: Vec<f64> = beats.collect();
    let follows = |pair: &&[Put<JointState>]| pair[1].packet.number == pair[0].packet.number + 1;
    let periods = states.windows(2).filter(follows);
    let periods: Vec<f64> = periods
        .map(|pair| between(pair[0].ns, pair[1].ns))
        .collect();
    let samples = packets_of::<ImuSample>(recording, None)?
        .iter()
        .map(|put| (sample(&put.packet), put.ns))
        .collect();
    let poses = packets_of::<HeadPose>(recording, None)?;
    let poses = delays(&samples, poses.iter().map(|put| (put.packet.t_ns, put.ns)));
    let commanded = commands
        .iter()
        .map(|put| (put.packet.command_ns, put.ns))
        .collect();
    let judged = packets_of::<SafetyState>(recording, None)?;
    let judged = judged.iter().map(|put| (put.packet.command_ns, put.ns));
    let judged = delays(&commanded, judged);
    let ends = [recording.entries.first(), recording.entries.last()];
    let [first, last] = ends.map(|entry| entry.map_or(0, |entry| entry.time_ns));
    Ok(Timing {
        seconds: last.saturating_sub(first) as f64 * 1e-9,
        paths: chains.len(),
        incomplete,
        steps: steps(&chains),
        exposure_to_path_ms: Milliseconds::of(&caught.exposure_to_path_ms),
        last_picture_age_ms: Milliseconds::of(&caught.picture_age_ms),
        last_measurement_age_ms: Milliseconds::of(&caught.head_age_ms),
        beat_to_command_ms: Milliseconds::of(&beat_to_command),
        joint_period_ms: Milliseconds::of(&periods),
        imu_to_pose_ms: Milliseconds::of(&poses),
        command_to_monitor_ms: Milliseconds::of(&judged),
    })
}

/// Name, process, start and end of a step.
type Part = (
    &'static str,
    &'static str,
    fn(&Chain) -> u64,
    fn(&Chain) -> u64,
);

const PARTS: [Part; 6] = [
    ("circles", "cameras and eyes", |c| c.exposure, |c| c.circles),
    ("prediction", "tracker", |c| c.circles, |c| c.prediction),
    ("question", "coordinator", |c| c.prediction, |c| c.request),
    ("plan", "planner", |c| c.request, |c| c.result),
    ("path", "coordinator", |c| c.result, |c| c.path),
    ("motion begins", "controller", |c| c.path, |c| c.start),
];

fn steps(chains: &[Chain]) -> Vec<Step> {
    let of = |each: &dyn Fn(&Chain) -> u64| {
        let times = chains.iter().map(|chain| milliseconds(each(chain)));
        Milliseconds::of(&times.collect::<Vec<f64>>())
    };
    let step = |(name, process, begins, ends): Part| {
        Some(Step {
            name,
            process,
            ends_ms: of(&|chain| ends(chain).saturating_sub(chain.exposure))?,
            takes_ms: of(&|chain| ends(chain).saturating_sub(begins(chain)))?,
        })
    };
    PARTS.into_iter().filter_map(step).collect()
}

fn catch_times(recording: &Recording) -> Result<CatchTimes, RecordedError> {
    let mut times = CatchTimes::default();
    let outcomes = packets_of::<CatchOutcome>(recording, None)?;
    let mut outcomes = outcomes.iter().peekable();
    for path in packets_of::<ArmPath>(recording, Some("arm/path"))? {
        while let Some(outcome) = outcomes.next_if(|outcome| outcome.ns <= path.ns) {
            times.outcome(&outcome.packet);
        }
        times.path(path.ns, &path.packet);
    }
    outcomes.for_each(|outcome| times.outcome(&outcome.packet));
    Ok(times)
}

/// Returns the times from packets to those that follow from them, in ms. Packets without a predecessor are skipped.
///
/// - `before`: time of each packet by its stamp
/// - `after`: stamp of the predecessor and time of each packet
fn delays(before: &HashMap<u64, u64>, after: impl Iterator<Item = (u64, u64)>) -> Vec<f64> {
    after
        .filter_map(|(stamp, ns)| Some(between(*before.get(&stamp)?, ns)))
        .collect()
}

fn between(from_ns: u64, to_ns: u64) -> f64 {
    milliseconds(to_ns.saturating_sub(from_ns))
}

fn milliseconds(ns: u64) -> f64 {
    ns as f64 * 1e-6
}
