//! Sweeps of several lengths.

use super::finding;
use crate::format::OddLength;
use crate::{Finding, FindingKind, Place, Remedy, Severity};

/// Returns the findings about sweeps that are longer or shorter than `steps` frames.
///
/// - `sweeps`: number of sweeps that have `steps` frames, or were cut to them
pub fn check_lengths(steps: usize, sweeps: usize, odd: &[OddLength]) -> Vec<Finding> {
    let short = odd.iter().filter(|sweep| sweep.frames < steps);
    let (short, shortest) = (
        short.clone().count(),
        short.map(|sweep| sweep.frames).min().unwrap_or(steps),
    );
    if odd.is_empty() {
        return Vec::new();
    }
    let say = |message| {
        finding(
            Severity::Error,
            FindingKind::UnequalLengths,
            Place::default(),
            message,
        )
    };
    let left_out = match short {
        0 => String::new(),
        short => format!(", {short} shorter (not checked further), the shortest {shortest}"),
    };
    let summary = format!(
        "{} of {} sweeps are not {steps} frames long: {} longer{left_out}",
        odd.len(),
        sweeps + short,
        odd.len() - short,
    );
    let each = odd
        .iter()
        .map(|OddLength { sweep, frames }| say(format!("sweep `{sweep}`: {frames} frames")));
    let summary = Finding {
        remedy: Some(Remedy::KeepSteps { steps: shortest }),
        ..say(summary)
    };
    std::iter::once(summary).chain(each).collect()
}
