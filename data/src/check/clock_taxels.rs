//! Clocks and counters among the taxels.

use super::finding;
use super::sweep_statistics::SweepStatistics;
use super::taxel_names::taxel_name;
use crate::{Dataset, Finding, FindingKind, Place, Severity};

/// Returns the taxels that rise identically in all sweeps, which are most likely clocks or counters.
pub(super) fn clock_taxels(dataset: &Dataset, sweeps: &[SweepStatistics]) -> Vec<Finding> {
    let shape = dataset.shape();
    if dataset.len() < 2 || shape.steps < 8 {
        return Vec::new();
    }
    let first = dataset.sweep(0);
    let last = dataset.sweep(dataset.len() - 1);
    let counts = |sweep: &[f32], taxel: usize| {
        let values: Vec<f32> = sweep[taxel..]
            .iter()
            .step_by(shape.taxels())
            .copied()
            .collect();
        values.array_windows().all(|&[a, b]| b == a + 1.0)
    };
    let rises = |taxel: &usize| {
        let values = first[*taxel..].iter().step_by(shape.taxels());
        let same = |sweep: &SweepStatistics| sweep.taxels[*taxel] == sweeps[0].taxels[*taxel];
        let counts_on = || counts(&first, *taxel) && counts(&last, *taxel);
        values.is_sorted_by(|a, b| a < b) && (sweeps.iter().all(same) || counts_on())
    };
    (0..shape.taxels())
        .filter(rises)
        .map(|taxel| {
            let name = taxel_name(shape, taxel);
            let message = format!(
                "taxel {name} rises from {} to {} in the first sweep, and in the same way in the others: is it a clock? A column of times is recognised as `time` or `time_ms`, one of numbers as `frame`",
                sweeps[0].taxels[taxel].0, sweeps[0].taxels[taxel].1
            );
            let at = Place {
                taxel: Some(taxel),
                ..Place::default()
            };
            finding(Severity::Warning, FindingKind::ClockTaxel, at, message)
        })
        .collect()
}
