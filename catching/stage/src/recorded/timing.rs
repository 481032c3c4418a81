//! How long every step takes, from the stamps in packets.

use std::collections::HashMap;

use serde::Serialize;
use tactnet_catching_packets::packets::{
    ArmPath, CatchOutcome, HeadPose, ImuSample, JointCommand, JointState, SafetyState,
};
use tactnet_catching_roles::{CatchTimes, Milliseconds, RoleSettings};
use tactnet_recording::Recording;

use super::RecordedError;
use super::chain::{Chain, chains};
use super::packets_of::packets_of;

/// One step from an exposure to its path.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// What happens.
    pub name: &'static str,
    /// Who does it.
    pub process: &'static str,
    /// When it has ended, ms after the middle of the exposure.
    pub ends_ms: Milliseconds,
    /// How long it takes, ms.
    pub takes_ms: Milliseconds,
}

/// Times of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Timing {
    /// From the first packet to the last, s.
    pub seconds: f64,
    /// Paths that are the first of an exposure and an arm, with every packet before them.
    pub paths: usize,
    /// Such paths of which a packet before them is missing.
    pub incomplete: usize,
    /// The steps, in their order.
    pub steps: Vec<Step>,
    /// From the middle of an exposure to the path that follows from it.
    pub exposure_to_path_ms: Option<Milliseconds>,
    /// How old the last picture was that a caught ball's path follows from, when it was caught.
    pub last_picture_age_ms: Option<Milliseconds>,
    /// How old the head's last pose was, as used by that path: the thesis's last measurement with an inertial unit.
    pub last_measurement_age_ms: Option<Milliseconds>,
    /// From the controller's beat, 1000 a second, to its command.
    pub beat_to_command_ms: Option<Milliseconds>,
    /// From one joint state to the next.
    pub joint_period_ms: Option<Milliseconds>,
    /// From a sample of the inertial unit to the head's pose of that moment.
    pub imu_to_pose_ms: Option<Milliseconds>,
    /// From a command to the word of the monitor of self-collisions on it.
    pub command_to_monitor_ms: Option<Milliseconds>,
}

/// Returns the times in a recording.
///
/// # Errors
/// No packets of a catching stack; settings of the recording's table that cannot be used; a recording that does not tell when the channels'
/// clock began.
pub fn timing(recording: &Recording) -> Result<Timing, RecordedError> {
    let settings = RoleSettings::of(&recording.table)?;
    // Only a calibrated stack has other stamps than its sensors.
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
    let beat_to_command: Vec<f64> = commands
        .iter()
        .map(|put| milliseconds(put.ns.saturating_sub(put.packet.command_ns)))
        .collect();
    let periods: Vec<f64> = states
        .windows(2)
        .filter(|pair| pair[1].packet.number == pair[0].packet.number + 1)
        .map(|pair| milliseconds(pair[1].ns.saturating_sub(pair[0].ns)))
        .collect();
    let samples: HashMap<u64, u64> = packets_of::<ImuSample>(recording, None)?
        .iter()
        .map(|put| (sample(&put.packet), put.ns))
        .collect();
    let poses: Vec<f64> = packets_of::<HeadPose>(recording, None)?
        .iter()
        .filter_map(|put| {
            Some(milliseconds(
                put.ns.saturating_sub(*samples.get(&put.packet.t_ns)?),
            ))
        })
        .collect();
    let commanded: HashMap<u64, u64> = commands
        .iter()
        .map(|put| (put.packet.command_ns, put.ns))
        .collect();
    let judged: Vec<f64> = packets_of::<SafetyState>(recording, None)?
        .iter()
        .filter_map(|put| {
            let commanded = commanded.get(&put.packet.command_ns)?;
            Some(milliseconds(put.ns.saturating_sub(*commanded)))
        })
        .collect();
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

/// The steps of a chain: name, process, begin, end.
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
        let times: Vec<f64> = chains
            .iter()
            .map(|chain| milliseconds(each(chain)))
            .collect();
        Milliseconds::of(&times)
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

fn milliseconds(ns: u64) -> f64 {
    ns as f64 * 1e-6
}
