//! Taxels that hold the material instead of a measurement, such as a column `class` that is read as a taxel.

use std::collections::BTreeMap;

use super::finding;
use super::sweep_statistics::SweepStatistics;
use super::taxel_names::taxel_name;
use crate::{Dataset, Finding, FindingKind, Place, Severity};

/// Minimum share of sweeps with the usual value of their material.
const FOLLOWING: f64 = 0.95;
/// Minimum number of sweeps that repeat the value of another sweep of their material: fewer may agree by chance.
const REPEATS: usize = 2;

/// Taxel whose value follows the material.
pub(super) struct LeakingColumn {
    taxel: usize,
    /// Usual value of each material.
    values: Vec<f32>,
    /// Number of sweeps with the usual value of their material.
    following: usize,
}

/// Returns the taxels that are constant in every sweep and whose value follows the material.
pub(super) fn leaking_columns(dataset: &Dataset, sweeps: &[SweepStatistics]) -> Vec<LeakingColumn> {
    let is_constant = |&taxel: &usize| {
        let mut limits = sweeps.iter().map(|sweep| sweep.taxels[taxel]);
        limits.all(|(low, high)| low == high)
    };
    let taxels = dataset.shape().taxels();
    let constant: Vec<usize> = (0..taxels).filter(is_constant).collect();
    if constant.len() == taxels {
        return Vec::new();
    }
    let value = |sweep: &SweepStatistics, taxel: usize| sweep.taxels[taxel].0;
    let leaks = constant.into_iter().filter_map(|taxel| {
        let values: Vec<f32> = sweeps.iter().map(|sweep| value(sweep, taxel)).collect();
        leak(dataset, taxel, &values)
    });
    leaks.collect()
}

/// Returns a column whose value follows the material.
///
/// - `values`: value of each sweep
pub(super) fn leak(dataset: &Dataset, taxel: usize, values: &[f32]) -> Option<LeakingColumn> {
    let mut counts: Vec<BTreeMap<u32, usize>> = vec![BTreeMap::new(); dataset.labels().len()];
    for (record, value) in dataset.records().iter().zip(values) {
        // Adding zero makes a negative zero positive.
        let value = value + 0.0;
        *counts[record.label].entry(value.to_bits()).or_default() += 1;
    }
    counts.retain(|of_label| !of_label.is_empty());
    let usual = counts.iter().filter_map(|of_label| {
        let most = of_label.iter().max_by_key(|(_, count)| **count)?;
        Some((f32::from_bits(*most.0), *most.1))
    });
    let usual: Vec<(f32, usize)> = usual.collect();
    let following: usize = usual.iter().map(|(_, count)| count).sum();
    let repeats: usize = usual.iter().map(|(_, count)| count - 1).sum();
    let differs = usual.iter().any(|(value, _)| *value != usual[0].0);
    let follows = following as f64 >= FOLLOWING * dataset.len() as f64;
    (differs && follows && repeats >= REPEATS).then(|| LeakingColumn {
        taxel,
        values: usual.into_iter().map(|(value, _)| value).collect(),
        following,
    })
}

impl LeakingColumn {
    pub(super) fn taxel(&self) -> usize {
        self.taxel
    }

    /// Returns an error with the values of the first two materials that differ.
    pub(super) fn finding(&self, dataset: &Dataset) -> Finding {
        let sweeps_of = dataset.sweeps_per_label();
        let present: Vec<&str> = (0..sweeps_of.len())
            .filter(|&label| sweeps_of[label] > 0)
            .map(|label| dataset.labels().name(label))
            .collect();
        let other = self
            .values
            .iter()
            .position(|value| *value != self.values[0]);
        let other = other.unwrap_or(0);
        let message = format!(
            "taxel {} is constant in every sweep and follows the material ({} for `{}`, {} for `{}`) in {} of {} sweeps: leave this column out, since it holds the answer instead of a measurement",
            taxel_name(dataset.shape(), self.taxel),
            self.values[0],
            present[0],
            self.values[other],
            present[other],
            self.following,
            dataset.len(),
        );
        let at = Place {
            taxel: Some(self.taxel),
            ..Place::default()
        };
        finding(Severity::Error, FindingKind::LeakingColumn, at, message)
    }
}
