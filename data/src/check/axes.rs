//! Checks of the time axis and of the arrangement of the taxels.

use super::finding;
use crate::{Dataset, Finding, FindingKind, Place, Remedy, Severity};

/// Duration below which sweeps count as short, in s: a finger that slides at 50 mm/s has moved 2.5 mm.
const SHORT_SECONDS: f64 = 0.05;
/// Duration above which sweeps count as long, in s: most likely the period was given as the rate.
const LONG_SECONDS: f64 = 600.0;
/// Minimum sample rate, in Hz: slower recordings show no texture.
const SLOW_HZ: f64 = 5.0;
/// Number of taxels on one side of the patch above which the side may be the time axis.
const WIDE_PATCH: usize = 32;

/// Returns findings about the number of steps and the sample rate.
pub(super) fn time_axis(dataset: &Dataset) -> Vec<Finding> {
    let shape = dataset.shape();
    let mut findings = Vec::new();
    let rate = dataset.sample_rate_hz();
    if dataset.is_rate_assumed() {
        let message = format!(
            "the data does not name its sample rate, {rate} Hz is assumed; an array `sample_rate_hz` or, in tables, a column `time` would name it"
        );
        let (kind, at) = (FindingKind::AssumedRate, Place::default());
        findings.push(Finding {
            remedy: Some(Remedy::NameRate),
            ..finding(Severity::Warning, kind, at, message)
        });
    }
    let mut warn = |kind, message| {
        findings.push(finding(Severity::Warning, kind, Place::default(), message));
    };
    let side = shape.rows.max(shape.cols);
    if side > WIDE_PATCH && side > shape.steps {
        warn(
            FindingKind::AxisOrder,
            format!(
                "{shape}: if {side} is the number of time steps, the axes are in another order than [sweeps][steps][rows][cols]; \
                 `np.moveaxis(X, -1, 1)` moves a last axis of time to its place"
            ),
        );
    }
    let seconds = shape.steps as f64 / rate;
    if seconds < SHORT_SECONDS {
        warn(
            FindingKind::ShortSweeps,
            format!(
                "a sweep of {} steps at {rate} Hz lasts {:.0} ms; textures need a finger that moves for longer",
                shape.steps,
                1e3 * seconds
            ),
        );
    }
    if seconds > LONG_SECONDS || rate < SLOW_HZ {
        warn(
            FindingKind::LongSweeps,
            format!(
                "a sweep of {} steps at {rate} Hz lasts {seconds:.0} s: is the rate a period, or is `time` in ms (then name it `time_ms`)?",
                shape.steps
            ),
        );
    }
    findings
}

/// Returns a note about taxels in one row that may be a grid.
pub(super) fn assumed_patch(dataset: &Dataset) -> Option<Finding> {
    let taxels = dataset.shape().taxels();
    if !dataset.is_patch_assumed() {
        return None;
    }
    // The grid closest to a square has the largest side up to the root.
    let sides = (2..taxels).take_while(|side| side * side <= taxels);
    let rows = sides.filter(|side| taxels.is_multiple_of(*side)).last()?;
    let message = format!(
        "one row of {taxels} taxels is assumed, since the data does not name their arrangement"
    );
    let (kind, at) = (FindingKind::AssumedPatch, Place::default());
    Some(Finding {
        remedy: Some(Remedy::NameShape {
            rows,
            cols: taxels / rows,
        }),
        ..finding(Severity::Note, kind, at, message)
    })
}
