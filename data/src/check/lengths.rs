//! Sweeps of several lengths.

use super::finding;
use crate::format::OddLength;
use crate::{Finding, FindingKind, Place, Severity};

/// Returns what is to be said of sweeps that are longer or shorter than `steps` frames: nothing where there are none.
///
/// - `sweeps`: those that are `steps` frames long, or were cut to them
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
        short => format!(
            ", {short} shorter (not looked at further; `--steps {steps}` and without them, or `--steps {shortest}` for all)"
        ),
    };
    let summary = format!(
        "{} of {} sweeps are not {steps} frames long: {} longer{left_out}; `tactnet data import FILE --out NEW.npz --steps N` cuts all alike",
        odd.len(),
        sweeps + short,
        odd.len() - short,
    );
    let each = odd
        .iter()
        .map(|OddLength { sweep, frames }| say(format!("sweep `{sweep}`: {frames} frames")));
    std::iter::once(say(summary)).chain(each).collect()
}
