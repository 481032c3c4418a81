//! Checks of the values.

use super::finding;
use crate::{Dataset, Finding, FindingKind, Place, Remedy, Severity, SweepShape};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::collections::hash_map::DefaultHasher;
use std::hash::Hasher;

/// Minimum share of a sweep's values at the ceiling for the sweep to count as saturated.
const SATURATED_SHARE: f64 = 0.01;
/// Minimum share of all values that equal the largest value for that value to count as a ceiling.
const CEILING_SHARE: f64 = 0.001;
/// Width of the range below the ceiling, as a share of the data set's range. A signal is clipped if more values are at
/// the ceiling than in this range.
const NEAR_CEILING: f32 = 0.05;
/// Ratio of a sweep's largest value to that of the median sweep above which the sweep is out of range.
const OUTLIER_FACTOR: f32 = 20.0;
/// Maximum share of sweeps with negative values for which negative values count as out of range.
const SIGNED_SHARE: f64 = 0.1;

/// Statistics of one sweep.
pub(super) struct SweepRange {
    /// Smallest and largest finite value of each taxel; positive and negative infinity if all values are not finite.
    taxels: Vec<(f32, f32)>,
    /// Number of values that are not finite, and the index of the first within the sweep.
    not_finite: Option<(usize, usize)>,
    negative: usize,
    hash: u64,
}

impl SweepRange {
    pub(super) fn of(dataset: &Dataset, index: usize) -> Self {
        let values = dataset.sweep(index);
        let taxels = dataset.shape().taxels();
        let mut low = vec![f32::INFINITY; taxels];
        let mut high = vec![f32::NEG_INFINITY; taxels];
        let mut all_finite = true;
        for frame in values.chunks_exact(taxels) {
            for ((&value, low), high) in frame.iter().zip(&mut low).zip(&mut high) {
                all_finite &= value.is_finite();
                *low = low.min(if value.is_finite() {
                    value
                } else {
                    f32::INFINITY
                });
                *high = high.max(if value.is_finite() {
                    value
                } else {
                    f32::NEG_INFINITY
                });
            }
        }
        let not_finite = || {
            values
                .iter()
                .enumerate()
                .filter(|(_, value)| !value.is_finite())
        };
        let first = if all_finite {
            None
        } else {
            not_finite().next()
        };
        Self {
            not_finite: first.map(|(first, _)| (not_finite().count(), first)),
            negative: if low.iter().any(|&low| low < 0.0) {
                values.iter().filter(|&&value| value < 0.0).count()
            } else {
                0
            },
            taxels: low.into_iter().zip(high).collect(),
            hash: hash(&values),
        }
    }

    fn max(&self) -> f32 {
        self.taxels
            .iter()
            .map(|taxel| taxel.1)
            .fold(f32::NEG_INFINITY, f32::max)
    }

    fn is_constant(&self) -> bool {
        self.not_finite.is_none() && self.taxels.iter().all(|(low, high)| low == high)
    }
}

fn hash(values: &[f32]) -> u64 {
    let mut hash = DefaultHasher::new();
    for pair in values.chunks(2) {
        let low = u64::from(pair[0].to_bits());
        hash.write_u64(low | pair.get(1).map_or(0, |x| u64::from(x.to_bits())) << 32);
    }
    hash.finish()
}

fn in_sweep(sweep: usize) -> Place {
    Place {
        sweep: Some(sweep),
        ..Place::default()
    }
}

fn taxel_name(shape: SweepShape, taxel: usize) -> String {
    format!("({}, {})", taxel / shape.cols, taxel % shape.cols)
}

fn taxel_names(shape: SweepShape, taxels: &[usize]) -> String {
    let names: Vec<String> = taxels
        .iter()
        .map(|&taxel| taxel_name(shape, taxel))
        .collect();
    format!(
        "taxel{} {}",
        if names.len() == 1 { "" } else { "s" },
        names.join(", ")
    )
}

pub(super) fn not_finite(dataset: &Dataset, sweeps: &[SweepRange]) -> Vec<Finding> {
    let shape = dataset.shape();
    let mut findings = Vec::new();
    for (index, sweep) in sweeps.iter().enumerate() {
        let Some((count, first)) = sweep.not_finite else {
            continue;
        };
        let (step, taxel) = (first / shape.taxels(), first % shape.taxels());
        // NaN from one step to the end of the sweep is most likely padding.
        let is_padded = step > 0 && count == shape.values() - step * shape.taxels();
        let message = format!(
            "{} (`X[{index}]`): {count} not finite, the first at step {step}, taxel {}{}",
            dataset.describe(index),
            taxel_name(shape, taxel),
            if is_padded { "; padded?" } else { "" }
        );
        let at = Place {
            sweep: Some(index),
            taxel: Some(taxel),
            step: Some(step),
            ..Place::default()
        };
        findings.push(Finding {
            remedy: is_padded.then_some(Remedy::KeepSteps { steps: step }),
            ..finding(Severity::Error, FindingKind::NotFinite, at, message)
        });
    }
    findings
}

/// Returns the taxels that have one value in all sweeps, with that value; an empty map if all taxels are constant.
pub(super) fn dead_taxels(sweeps: &[SweepRange]) -> BTreeMap<usize, f32> {
    let count = sweeps[0].taxels.len();
    let dead: BTreeMap<usize, f32> = (0..count)
        .filter_map(|taxel| {
            let value = sweeps[0].taxels[taxel].0;
            let same = |sweep: &SweepRange| sweep.taxels[taxel] == (value, value);
            sweeps.iter().all(same).then_some((taxel, value))
        })
        .collect();
    if dead.len() == count {
        BTreeMap::new()
    } else {
        dead
    }
}

pub(super) fn dead_findings(shape: SweepShape, dead: &BTreeMap<usize, f32>) -> Vec<Finding> {
    dead.iter()
        .map(|(&taxel, value)| {
            let name = taxel_name(shape, taxel);
            let message = format!("taxel {name} is {value} at every step of every sweep");
            let at = Place {
                taxel: Some(taxel),
                ..Place::default()
            };
            finding(Severity::Warning, FindingKind::DeadTaxel, at, message)
        })
        .collect()
}

pub(super) fn constant(
    dataset: &Dataset,
    sweeps: &[SweepRange],
    dead: &BTreeMap<usize, f32>,
) -> Vec<Finding> {
    let shape = dataset.shape();
    let mut findings = Vec::new();
    for (index, sweep) in sweeps.iter().enumerate() {
        if sweep.is_constant() {
            let message = format!("{}: no taxel ever changes", dataset.describe(index));
            let at = in_sweep(index);
            findings.push(finding(
                Severity::Error,
                FindingKind::ConstantSweep,
                at,
                message,
            ));
            continue;
        }
        let still = |at_zero: bool| -> Vec<usize> {
            let taxels = sweep.taxels.iter().enumerate();
            taxels
                .filter(|(taxel, (low, high))| {
                    low == high && (*low == 0.0) == at_zero && !dead.contains_key(taxel)
                })
                .map(|(taxel, _)| taxel)
                .collect()
        };
        let kinds = [
            (Severity::Warning, still(false), "no change at"),
            (Severity::Note, still(true), "no contact at"),
        ];
        for (severity, taxels, what) in kinds {
            let Some(&first) = taxels.first() else {
                continue;
            };
            let names = taxel_names(shape, &taxels);
            let message = format!("{}: {what} {names}", dataset.describe(index));
            let at = Place {
                sweep: Some(index),
                taxel: Some(first),
                ..Place::default()
            };
            findings.push(finding(severity, FindingKind::ConstantTaxel, at, message));
        }
    }
    findings
}

pub(super) fn identical(dataset: &Dataset, sweeps: &[SweepRange]) -> Vec<Finding> {
    let mut by_hash: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
    let mut findings = Vec::new();
    for (index, sweep) in sweeps
        .iter()
        .enumerate()
        .filter(|(_, sweep)| !sweep.is_constant())
    {
        let same_hash = by_hash.entry(sweep.hash).or_default();
        let values = if same_hash.is_empty() {
            Vec::new()
        } else {
            dataset.sweep(index)
        };
        let equals = |&&earlier: &&usize| {
            let earlier = dataset.sweep(earlier);
            earlier
                .iter()
                .zip(&values)
                .all(|(a, b)| a.to_bits() == b.to_bits())
        };
        match same_hash.iter().find(equals) {
            Some(&earlier) => {
                let (a, b) = (dataset.describe(index), dataset.describe(earlier));
                let message =
                    format!("{a} (`X[{index}]`) has the same values as {b} (`X[{earlier}]`)");
                let at = in_sweep(index);
                findings.push(finding(
                    Severity::Error,
                    FindingKind::IdenticalSweeps,
                    at,
                    message,
                ));
            }
            None => same_hash.push(index),
        }
    }
    findings
}

/// Returns the sweeps that reach the ceiling. The ceiling is the maximum of the element type, or the largest value of the
/// data set if the number of equal values shows that it is clipped.
pub(super) fn saturated(dataset: &Dataset, sweeps: &[SweepRange]) -> Vec<Finding> {
    let taxels = || sweeps.iter().flat_map(|sweep| &sweep.taxels);
    let ceiling = taxels()
        .map(|taxel| taxel.1)
        .fold(f32::NEG_INFINITY, f32::max);
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
        .map(|(index, sweep)| {
            if sweep.max() < near {
                return (0, 0);
            }
            let values = dataset.sweep(index);
            let at_ceiling = values.iter().filter(|&&value| value == ceiling).count();
            let not_below = values
                .iter()
                .filter(|&&value| value >= near && value <= ceiling);
            (at_ceiling, not_below.count() - at_ceiling)
        })
        .unzip();
    let per_sweep = dataset.shape().values() as f64;
    let at: usize = at_ceiling.iter().sum();
    let is_clip = at as f64 >= CEILING_SHARE * per_sweep * sweeps.len() as f64
        && at > below.iter().sum()
        && near > floor;
    if dataset.samples().element_max() != Some(ceiling) && !is_clip {
        return Vec::new();
    }
    let mut findings = Vec::new();
    for (index, &count) in at_ceiling.iter().enumerate() {
        if sweeps[index].is_constant() || (count as f64) < SATURATED_SHARE * per_sweep {
            continue;
        }
        let message = format!(
            "{}: {:.1} % of the values are at the ceiling of {ceiling}",
            dataset.describe(index),
            100.0 * count as f64 / per_sweep
        );
        let at = in_sweep(index);
        findings.push(finding(
            Severity::Warning,
            FindingKind::Saturation,
            at,
            message,
        ));
    }
    findings
}

pub(super) fn out_of_range(dataset: &Dataset, sweeps: &[SweepRange]) -> Vec<Finding> {
    let mut findings = Vec::new();
    let signed = sweeps.iter().filter(|sweep| sweep.negative > 0).count();
    let odd_if_negative = (signed as f64) <= SIGNED_SHARE * sweeps.len() as f64;
    let mut peaks: Vec<f32> = sweeps
        .iter()
        .map(SweepRange::max)
        .filter(|peak| peak.is_finite())
        .collect();
    peaks.sort_by(f32::total_cmp);
    let usual = peaks.get(peaks.len() / 2).copied().unwrap_or(0.0);
    for (index, sweep) in sweeps.iter().enumerate() {
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

/// Returns the taxels that rise identically in all sweeps, which are most likely clocks or counters.
pub(super) fn clock_taxels(dataset: &Dataset, sweeps: &[SweepRange]) -> Vec<Finding> {
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
        let same = |sweep: &SweepRange| sweep.taxels[*taxel] == sweeps[0].taxels[*taxel];
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
