//! Sweeps whose values are unlike those of the others.

use super::finding;
use super::sweep_statistics::SweepStatistics;
use super::taxel_names::in_sweep;
use crate::{Dataset, Finding, FindingKind, Severity};

/// Ratio of a sweep's largest value to that of the median sweep above which the sweep is out of range.
const OUTLIER_FACTOR: f32 = 20.0;
/// Maximum share of sweeps with negative values for which negative values count as out of range.
const SIGNED_SHARE: f64 = 0.1;

/// Returns the sweeps that reach far larger values than most, and those with negative values if hardly any other has them.
///
/// - `is_explained`: true for sweeps with other findings about single values
pub(super) fn out_of_range(
    dataset: &Dataset,
    sweeps: &[SweepStatistics],
    is_explained: impl Fn(usize) -> bool,
) -> Vec<Finding> {
    let mut findings = Vec::new();
    let signed = sweeps.iter().filter(|sweep| sweep.negative > 0).count();
    let odd_if_negative = (signed as f64) <= SIGNED_SHARE * sweeps.len() as f64;
    let mut peaks: Vec<f32> = sweeps
        .iter()
        .map(SweepStatistics::max)
        .filter(|peak| peak.is_finite())
        .collect();
    peaks.sort_by(f32::total_cmp);
    let usual = peaks.get(peaks.len() / 2).copied().unwrap_or(0.0);
    for (index, sweep) in sweeps.iter().enumerate() {
        if is_explained(index) {
            continue;
        }
        let name = dataset.describe(index);
        let at = in_sweep(index);
        if sweep.negative > 0 && odd_if_negative {
            let message = format!("{name}: {} negative", sweep.negative);
            findings.push(finding(
                Severity::Warning,
                FindingKind::OutOfRange,
                at.clone(),
                message,
            ));
        }
        if usual > 0.0 && sweep.max() > OUTLIER_FACTOR * usual {
            let peak = sweep.max();
            let message = format!("{name}: reaches {peak}, the median sweep {usual}");
            findings.push(finding(
                Severity::Warning,
                FindingKind::OutOfRange,
                at,
                message,
            ));
        }
    }
    findings
}
