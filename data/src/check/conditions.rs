//! Conditions that give the material away.

use super::finding;
use super::leaking_columns::leak;
use crate::{ConditionValues, Dataset, Finding, FindingKind, Place, Severity};

/// Share of sweeps whose material the condition alone tells, from which the finding is an error.
const TELLS: f64 = 0.95;
/// Minimum excess over guessing, in standard deviations of the number of sweeps right by chance.
const BEYOND_CHANCE: f64 = 4.0;

/// Returns a finding for each condition that tells the material: the nearest other value of all sweeps is that of a sweep
/// of the same material, far more often than by chance.
pub(super) fn that_follow_the_material(dataset: &Dataset) -> Vec<Finding> {
    let conditions = dataset.condition_values();
    conditions
        .iter()
        .filter_map(|of| that_follows(dataset, of))
        .collect()
}

fn that_follows(dataset: &Dataset, of: &ConditionValues) -> Option<Finding> {
    let sweeps = dataset.len() as f64;
    let counts = dataset.sweeps_per_label();
    let most = counts.iter().copied().max().unwrap_or(0) as f64;
    let guess = most / sweeps;
    let right = told_by_nearest(dataset, &of.values);
    let deviation = (sweeps * guess * (1.0 - guess)).sqrt();
    // A single material has no deviation, and nothing to tell.
    let is_beyond = deviation > 0.0 && right - most >= BEYOND_CHANCE * deviation;
    let severity = match leak(dataset, 0, &of.values) {
        Some(_) => Severity::Error,
        None if is_beyond && right >= TELLS * sweeps => Severity::Error,
        None if is_beyond => Severity::Warning,
        None => return None,
    };
    let (name, cure) = (
        of.condition.quantity.name(),
        match severity {
            Severity::Error => "leave it out, since it holds the answer instead of a condition",
            _ => "accuracy that is measured with it cannot be told from recognising it",
        },
    );
    let message = format!(
        "`{name}` alone tells the material of {:.0} % of the sweeps (guessing: {:.0} %): {cure}",
        100.0 * right / sweeps,
        100.0 * guess,
    );
    let at = Place::default();
    Some(finding(severity, FindingKind::LeakingColumn, at, message))
}

/// Returns the number of sweeps whose material is that of the sweep with the nearest value; of equally near ones, each
/// counts its share.
fn told_by_nearest(dataset: &Dataset, values: &[f32]) -> f64 {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let label = |place: usize| dataset.records()[order[place]].label;
    let value = |place: usize| values[order[place]];
    let told = |place: usize| {
        let below = place.checked_sub(1).map(|at| value(place) - value(at));
        let above = (place + 1 < order.len()).then(|| value(place + 1) - value(place));
        let Some(least) = [below, above].into_iter().flatten().reduce(f32::min) else {
            return 0.0;
        };
        let is_nearest = |at: &usize| (value(*at) - value(place)).abs() <= least;
        let before = (0..place).rev().take_while(is_nearest);
        let after = (place + 1..order.len()).take_while(is_nearest);
        let (mut same, mut all) = (0.0, 0.0);
        for near in before.chain(after) {
            all += 1.0;
            same += f64::from(u8::from(label(near) == label(place)));
        }
        same / f64::max(all, 1.0)
    };
    (0..order.len()).map(told).sum()
}
