//! Taxels that have one value in all sweeps, except for a few odd frames.

use std::collections::BTreeMap;

use super::finding;
use super::sweep_statistics::SweepStatistics;
use super::taxel_limits::TaxelLimits;
use super::taxel_names::taxel_name;
use crate::{Dataset, Finding, FindingKind, Place, Severity};

/// Maximum share of frames in which a dead taxel shows another value: faults of the transmission are rarer.
const ODD_SHARE: f64 = 0.001;
/// Number of odd frames that a dead taxel may have in a short recording.
const FEW_ODD: usize = 5;
/// Maximum number of odd frames in a row: a contact lasts longer.
const ODD_FRAMES: usize = 3;
/// Maximum share of sampled frames with another value for a taxel to be looked at; a small sample may show more odd frames
/// than the whole.
const STILL_SHARE: f64 = 0.01;
/// Minimum share of frames in which the other taxels move: among the taxels of an event camera or of a skin that is
/// rarely touched, one that moves in a few frames is sound.
const LIVELY_SHARE: f64 = 0.5;

/// Taxel without a signal.
pub(super) struct DeadTaxel {
    /// Value of all frames but the odd ones.
    value: f32,
    /// Number of frames with another value.
    odd: usize,
    /// Sweep and step of the first of them.
    first: Option<(usize, usize)>,
}

/// Returns the dead taxels; an empty map if all taxels are constant.
pub(super) fn dead_taxels(
    dataset: &Dataset,
    sweeps: &[SweepStatistics],
    limits: &[TaxelLimits],
) -> BTreeMap<usize, DeadTaxel> {
    let is_still = |limits: &&TaxelLimits| limits.activity <= STILL_SHARE;
    let mut others: Vec<f64> = limits
        .iter()
        .filter(|limits| !is_still(limits))
        .map(|limits| limits.activity)
        .collect();
    others.sort_by(f64::total_cmp);
    let is_lively = others
        .get(others.len() / 2)
        .is_some_and(|activity| *activity >= LIVELY_SHARE);
    let frames = dataset.frames();
    let most_odd = match is_lively {
        true => FEW_ODD.max((ODD_SHARE * frames as f64) as usize),
        false => 0,
    };
    let still = limits.iter().enumerate().filter(|(_, of)| is_still(of));
    let dead: BTreeMap<usize, DeadTaxel> = still
        .filter_map(|(taxel, limits)| {
            let dead = odd_frames(dataset, sweeps, taxel, limits.median, most_odd)?;
            Some((taxel, dead))
        })
        .collect();
    if dead.len() == limits.len() {
        BTreeMap::new()
    } else {
        dead
    }
}

/// Counts the frames in which a taxel has another value; `None` if there are more than `most` or too many in a row.
fn odd_frames(
    dataset: &Dataset,
    sweeps: &[SweepStatistics],
    taxel: usize,
    value: f32,
    most: usize,
) -> Option<DeadTaxel> {
    let mut dead = DeadTaxel {
        value,
        odd: 0,
        first: None,
    };
    let mut constant = 0;
    for (index, sweep) in sweeps.iter().enumerate() {
        if sweep.taxels[taxel] == (value, value) {
            constant += 1;
            continue;
        }
        if most == 0 {
            return None;
        }
        let values = dataset.sweep(index);
        let mut in_a_row = 0;
        let of_taxel = values[taxel..].iter().step_by(dataset.shape().taxels());
        for (step, &found) in of_taxel.enumerate() {
            if found == value || !found.is_finite() {
                in_a_row = 0;
                continue;
            }
            in_a_row += 1;
            dead.odd += 1;
            dead.first = dead.first.or(Some((index, step)));
            if dead.odd > most || in_a_row > ODD_FRAMES {
                return None;
            }
        }
    }
    (constant > 0 || dead.odd > 0).then_some(dead)
}

/// Returns a warning for each dead taxel.
pub(super) fn findings(dataset: &Dataset, dead: &BTreeMap<usize, DeadTaxel>) -> Vec<Finding> {
    let finding_of = |(&taxel, dead): (&usize, &DeadTaxel)| {
        let name = taxel_name(dataset.shape(), taxel);
        let value = dead.value;
        let message = match dead.first {
            None => format!("taxel {name} is {value} at every step of every sweep"),
            Some((sweep, step)) => format!(
                "taxel {name} is {value} at every step of every sweep except {}, the first in {}, step {step}",
                dead.odd,
                dataset.describe(sweep)
            ),
        };
        let at = Place {
            taxel: Some(taxel),
            ..Place::default()
        };
        finding(Severity::Warning, FindingKind::DeadTaxel, at, message)
    };
    dead.iter().map(finding_of).collect()
}
