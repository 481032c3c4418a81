//! Values at the sensor's maximum.

use std::ops::RangeInclusive;

use rayon::prelude::*;

use super::fill_values::FillValues;
use super::finding;
use super::sweep_statistics::SweepStatistics;
use super::taxel_names::in_sweep;
use crate::{Dataset, Finding, FindingKind, Severity};

/// Minimum share of a sweep's values at the ceiling for the sweep to count as saturated.
const SATURATED_SHARE: f64 = 0.01;
/// Minimum share of all values that equal the largest value for that value to count as a ceiling.
const CEILING_SHARE: f64 = 0.001;
/// Width of the range below the ceiling, as a share of the data set's range. A signal is clipped if more values are at
/// the ceiling than in this range.
const NEAR_CEILING: f32 = 0.05;

/// Returns the sweeps that reach the ceiling. The ceiling is the maximum of the element type, or the largest value of the
/// data set if the number of equal values shows that it is clipped.
///
/// - `is_explained`: true for taxels with another finding, which are not considered
pub(super) fn saturated(
    dataset: &Dataset,
    sweeps: &[SweepStatistics],
    fills: &FillValues,
    is_explained: impl Fn(usize) -> bool + Sync,
) -> Vec<Finding> {
    let taxels = || {
        let of_sweep = |sweep: &'_ SweepStatistics| -> Vec<(f32, f32)> {
            let read = sweep.taxels.iter().enumerate();
            let read = read.filter(|(taxel, _)| !is_explained(*taxel));
            read.map(|(_, taxel)| (taxel.0, taxel.1)).collect()
        };
        sweeps.iter().flat_map(of_sweep)
    };
    let ceiling = taxels()
        .map(|taxel| taxel.1)
        .fold(f32::NEG_INFINITY, f32::max);
    if fills.contains_value(ceiling) {
        return Vec::new();
    }
    let floor = taxels().map(|taxel| taxel.0).fold(f32::INFINITY, f32::min);
    let step = if dataset.samples().element_max().is_some() {
        1.0
    } else {
        0.0
    };
    let near = ceiling - (NEAR_CEILING * (ceiling - floor)).max(step);
    let (at_ceiling, below): (Vec<usize>, Vec<usize>) = sweeps
        .par_iter()
        .enumerate()
        .map(|(index, sweep)| match sweep.max() < near {
            true => (0, 0),
            false => count_near(dataset, index, near..=ceiling, &is_explained),
        })
        .unzip();
    let taxels = dataset.shape().taxels();
    let all = (dataset.frames() * taxels) as f64;
    let at: usize = at_ceiling.iter().sum();
    let is_clip = at as f64 >= CEILING_SHARE * all && at > below.iter().sum() && near > floor;
    if dataset.samples().element_max() != Some(ceiling) && !is_clip {
        return Vec::new();
    }
    let mut findings = Vec::new();
    for (index, &count) in at_ceiling.iter().enumerate() {
        let per_sweep = (sweeps[index].steps * taxels) as f64;
        if sweeps[index].is_constant() || (count as f64) < SATURATED_SHARE * per_sweep {
            continue;
        }
        let message = format!(
            "{}: {:.1} % of the values are at the ceiling of {ceiling}",
            dataset.describe(index),
            100.0 * count as f64 / per_sweep
        );
        let (kind, at) = (FindingKind::Saturation, in_sweep(index));
        findings.push(finding(Severity::Warning, kind, at, message));
    }
    findings
}

/// Counts the values of a sweep at the ceiling, the end of `range`, and those in the range below it.
fn count_near(
    dataset: &Dataset,
    index: usize,
    range: RangeInclusive<f32>,
    is_explained: impl Fn(usize) -> bool,
) -> (usize, usize) {
    let taxels = dataset.shape().taxels();
    let values = dataset.sweep(index);
    let read = values.iter().enumerate();
    let read = read.filter(|(place, _)| !is_explained(place % taxels));
    let (mut at_ceiling, mut below) = (0, 0);
    for (_, value) in read.filter(|(_, value)| range.contains(value)) {
        match value == range.end() {
            true => at_ceiling += 1,
            false => below += 1,
        }
    }
    (at_ceiling, below)
}
