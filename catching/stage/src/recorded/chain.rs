//! Chain of packets from an exposure to its path.

use std::collections::HashMap;

use tactnet_catching_packets::packets::{
    ArmPath, BallPredictions, Circles, PlanRequest, PlanResult,
};
use tactnet_recording::Recording;

use super::{RecordedError, packets_of};

/// Publication time of each packet, in ns of the channels' clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Chain {
    pub exposure: u64,
    /// Time of the circles of the later picture of the pair.
    pub circles: u64,
    pub prediction: u64,
    pub request: u64,
    pub result: u64,
    pub path: u64,
    /// Start of the motion of the path.
    pub start: u64,
}

/// Returns the chain of the first path of every arm and exposure, and the number of paths with a missing packet in
/// their chain.
///
/// - `corrected`: maps a camera timestamp to the calibrated one that the stack uses after the tracker
pub(crate) fn chains(
    recording: &Recording,
    corrected: impl Fn(u64) -> u64,
) -> Result<(Vec<Chain>, usize), RecordedError> {
    let mut circles: HashMap<u64, [Option<u64>; 2]> = HashMap::new();
    for put in packets_of::<Circles>(recording, None)? {
        let seen = circles
            .entry(corrected(put.packet.exposure_ns))
            .or_default();
        if let Some(place) = seen.get_mut(put.packet.camera as usize) {
            place.get_or_insert(put.ns);
        }
    }
    let mut predictions = HashMap::new();
    for put in packets_of::<BallPredictions>(recording, None)? {
        predictions.entry(put.packet.exposure_ns).or_insert(put.ns);
    }
    // Identity of a plan request.
    let of = |asked: &PlanRequest| (asked.arm, asked.ball, asked.exposure_ns, asked.head_ns);
    let mut requests = HashMap::new();
    for put in packets_of::<PlanRequest>(recording, None)? {
        requests.entry(of(&put.packet)).or_insert(put.ns);
    }
    let mut results = HashMap::new();
    for put in packets_of::<PlanResult>(recording, None)? {
        results.entry(of(&put.packet.request)).or_insert(put.ns);
    }
    let (mut chains, mut incomplete) = (Vec::new(), 0);
    let mut last = HashMap::new();
    for put in packets_of::<ArmPath>(recording, Some("arm/path"))? {
        let path = put.packet;
        // A last correction uses a newer head pose, but the same picture.
        if path.exposure_ns == 0
            || last.insert(path.arm, path.exposure_ns) == Some(path.exposure_ns)
        {
            continue;
        }
        let asked = (path.arm, path.ball, path.exposure_ns, path.head_ns);
        let chain = || {
            let [left, right] = *circles.get(&path.exposure_ns)?;
            Some(Chain {
                exposure: path.exposure_ns,
                circles: left?.max(right?),
                prediction: *predictions.get(&path.exposure_ns)?,
                request: *requests.get(&asked)?,
                result: *results.get(&asked)?,
                path: put.ns,
                start: path.start_ns,
            })
        };
        match chain() {
            Some(chain) => chains.push(chain),
            None => incomplete += 1,
        }
    }
    Ok((chains, incomplete))
}
