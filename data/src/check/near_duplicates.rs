//! Sweeps that are copies of another except for rounding, an offset or a gain.
//!
//! Two recordings of a material have different noise. A copy has the same noise: the difference of two copies is smaller
//! than the noise. Candidates are found by random projections.

use rayon::prelude::*;

use super::noise::{dot, noise, upper_quartile, without_mean};
use super::series::Series;
use super::sweep_statistics::SweepStatistics;
use super::taxel_names::in_sweep;
use super::{are_together, finding};
use crate::{Dataset, Finding, FindingKind, Place, Remedy, Severity};

/// Minimum length of sweeps that are compared, in frames.
const SHORTEST: usize = 24;
/// Number of projections of a sweep.
const PROJECTIONS: usize = 16;
/// Maximum distance of the projections of copies, root mean square; it is 1.4 for independent sweeps.
const DISTANCE: f32 = 0.1;
/// Maximum number of earlier sweeps, the nearest ones, that a sweep is compared with.
const COMPARED: usize = 4;
/// Minimum number of values that are compared: fewer may agree by chance.
const VALUES: usize = 64;
/// Maximum difference of copies, as a share of the noise: upper quartile by median. It is 2.4 for independent sweeps.
const DIFFERENCE: f64 = 0.35;
/// Maximum difference of copies, as a share of the lower quartile of the differences to other sweeps.
const UNUSUAL: f64 = 0.3;
/// Maximum number of other sweeps that copies are compared with.
const OTHERS: usize = 16;
/// Number of other sweeps of a material below which all materials are used.
const FEWEST_OTHERS: usize = 4;
/// Minimum share of a signal's frames that change: others have no noise to compare.
const CHANGING: f64 = 0.5;

/// Sweep that is nearly equal to an earlier one.
#[derive(Debug, Clone, Copy)]
pub(super) struct NearDuplicate {
    pub(super) later: usize,
    pub(super) earlier: usize,
}

/// Projections of a sweep that do not depend on offset and gain.
type Sketch = [f32; PROJECTIONS];

/// Returns each sweep that is nearly equal to an earlier one, with that sweep; not those with equal values.
pub(super) fn near_duplicates(dataset: &Dataset, sweeps: &[SweepStatistics]) -> Vec<NearDuplicate> {
    let sketch = |sweep: usize| {
        let statistics = &sweeps[sweep];
        let usable = statistics.steps >= SHORTEST
            && statistics.not_finite.is_none()
            && !statistics.is_constant();
        Some((
            sweep,
            sketch(dataset, &sweeps[sweep], sweep).filter(|_| usable)?,
        ))
    };
    let mut sketches: Vec<(usize, Sketch)> = (0..dataset.len())
        .into_par_iter()
        .filter_map(sketch)
        .collect();
    sketches.par_sort_unstable_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]));
    let mut pairs: Vec<NearDuplicate> = (0..sketches.len())
        .into_par_iter()
        .filter_map(|place| {
            let later = sketches[place].0;
            let near = near(&sketches, place);
            let earlier = near.into_iter().find(|&earlier| {
                sweeps[earlier].hash != sweeps[later].hash && are_copies(dataset, earlier, later)
            })?;
            Some(NearDuplicate { later, earlier })
        })
        .collect();
    pairs.sort_unstable_by_key(|pair| pair.later);
    pairs
}

/// Returns a finding for each pair: an error, or a warning if both sweeps are in one block.
pub(super) fn findings(dataset: &Dataset, pairs: &[NearDuplicate]) -> Vec<Finding> {
    let found = |&NearDuplicate { later, earlier }: &NearDuplicate| {
        let (a, b) = (dataset.describe(later), dataset.describe(earlier));
        let mut message = format!(
            "{a} (`X[{later}]`) is a copy of {b} (`X[{earlier}]`) except for rounding, an offset or a gain"
        );
        let together = are_together(dataset, earlier, later);
        let severity = match together {
            true => Severity::Warning,
            false => Severity::Error,
        };
        if together {
            message.push_str("; both are in one block, so a split has to leave whole blocks out");
        }
        let record = &dataset.records()[later];
        let place = Place {
            material: Some(dataset.labels().name(record.label).into()),
            ..in_sweep(later)
        };
        let found = finding(severity, FindingKind::NearDuplicate, place, message);
        match together {
            true => found.with_remedy(Remedy::LeaveBlocksOut),
            false => found,
        }
    };
    pairs.iter().map(found).collect()
}

/// Returns the earlier sweeps of similar sketches, the nearest first.
fn near(sketches: &[(usize, Sketch)], place: usize) -> Vec<usize> {
    let (later, own) = &sketches[place];
    // Of 16 distances with a root mean square below the limit, none exceeds four times the limit.
    let reach = DISTANCE * (PROJECTIONS as f32).sqrt();
    let near_by = |other: &&(usize, Sketch)| (other.1[0] - own[0]).abs() <= reach;
    let below = sketches[..place].iter().rev().take_while(near_by);
    let above = sketches[place + 1..].iter().take_while(near_by);
    let mut near: Vec<(f32, usize)> = below
        .chain(above)
        .filter(|(sweep, _)| sweep < later)
        .filter_map(|(sweep, sketch)| {
            let pairs = sketch.iter().zip(own);
            let square: f32 = pairs.map(|(a, b)| (a - b) * (a - b)).sum();
            let distance = (square / PROJECTIONS as f32).sqrt();
            (distance <= DISTANCE).then_some((distance, *sweep))
        })
        .collect();
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.truncate(COMPARED);
    near.into_iter().map(|(_, sweep)| sweep).collect()
}

/// Returns projections of the sum of all taxels, each with a random sign and scaled to a deviation of 1; `None` if no
/// taxel changes.
fn sketch(dataset: &Dataset, statistics: &SweepStatistics, sweep: usize) -> Option<Sketch> {
    let taxels = dataset.shape().taxels();
    let values = dataset.sweep(sweep);
    let mut means = vec![0.0_f64; taxels];
    let mut squares = vec![0.0_f64; taxels];
    let low = |taxel: usize| f64::from(statistics.taxels[taxel].0);
    for frame in values.chunks_exact(taxels) {
        for (taxel, &value) in frame.iter().enumerate() {
            let value = f64::from(value) - low(taxel);
            means[taxel] += value;
            squares[taxel] += value * value;
        }
    }
    let steps = statistics.steps as f64;
    let scale = |taxel: usize| {
        let mean = means[taxel] / steps;
        let deviation = (squares[taxel] / steps - mean * mean).max(0.0).sqrt();
        match deviation > 1e-6 * mean.abs() && deviation.is_finite() {
            true => f64::from(sign(taxel, PROJECTIONS)) / deviation,
            false => 0.0,
        }
    };
    let scales: Vec<f64> = (0..taxels).map(scale).collect();
    let offsets: Vec<f64> = (0..taxels)
        .map(|taxel| low(taxel) + means[taxel] / steps)
        .collect();
    let sum = |frame: &[f32]| -> f32 {
        let parts = frame.iter().zip(&offsets).zip(&scales);
        parts
            .map(|((value, offset), scale)| (f64::from(*value) - offset) * scale)
            .sum::<f64>() as f32
    };
    let series: Vec<f32> = values.chunks_exact(taxels).map(sum).collect();
    let norm = series.iter().map(|value| value * value).sum::<f32>().sqrt();
    let mut sketch = [0.0_f32; PROJECTIONS];
    for (step, value) in series.iter().enumerate() {
        for (projection, of_sketch) in sketch.iter_mut().enumerate() {
            *of_sketch += sign(step, projection) * value / norm;
        }
    }
    (norm > 0.0 && norm.is_finite()).then_some(sketch)
}

/// Returns 1 or -1 at random.
fn sign(place: usize, projection: usize) -> f32 {
    let number = (place as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let number = (number ^ (number >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let bit = (number >> (20 + projection)) & 1;
    if bit == 1 { 1.0 } else { -1.0 }
}

/// Returns true if one sweep is the other except for rounding and for an offset and a gain of each taxel.
fn are_copies(dataset: &Dataset, earlier: usize, later: usize) -> bool {
    let taxels = dataset.shape().taxels();
    let [one, other] = [earlier, later].map(|sweep| dataset.sweep(sweep));
    let compare = |series: Series| {
        let [a, b] = [&one, &other].map(|values| series.of(values, taxels));
        match (is_changing(&a), is_changing(&b)) {
            (false, false) => Likeness::Noiseless,
            (true, true) => likeness(&a, &b),
            _ => Likeness::Different,
        }
    };
    let mut compared = Vec::new();
    for series in Series::of_taxels(taxels) {
        match compare(series) {
            Likeness::Noiseless => {}
            Likeness::Copy => compared.push(series),
            Likeness::Different => return false,
        }
    }
    if compared.is_empty() && compare(Series::Sparse) == Likeness::Copy {
        compared.push(Series::Sparse);
    }
    compared.len() * dataset.steps_of(later) >= VALUES
        && is_unlike_others(dataset, &compared, earlier, later)
}

/// Returns true if two sweeps differ far less than other sweeps, in at least half of these signals. Otherwise all sweeps
/// are alike, as those of a simulation without noise.
fn is_unlike_others(dataset: &Dataset, compared: &[Series], earlier: usize, later: usize) -> bool {
    let records = dataset.records();
    let others = |is_wanted: &dyn Fn(usize) -> bool| -> Vec<usize> {
        (0..dataset.len())
            .filter(|&sweep| sweep != earlier && sweep != later && is_wanted(sweep))
            .collect()
    };
    let mut reference = others(&|sweep| records[sweep].label == records[later].label);
    if reference.len() < FEWEST_OTHERS {
        reference = others(&|_| true);
    }
    let stride = reference.len().div_ceil(OTHERS).max(1);
    let reference = reference.into_iter().step_by(stride);
    let reference: Vec<Vec<f32>> = reference.map(|sweep| dataset.sweep(sweep)).collect();
    let [one, other] = [earlier, later].map(|sweep| dataset.sweep(sweep));
    let is_far = |series: &&Series| {
        let signal = |values: &[f32]| series.of(values, dataset.shape().taxels());
        let own = signal(&other);
        let to = |values: &[f32]| difference(&signal(values), &own).unwrap_or(f64::INFINITY);
        let mut usual: Vec<f64> = reference.iter().map(|values| to(values)).collect();
        usual.sort_unstable_by(f64::total_cmp);
        let quartile = usual.get(usual.len() / 4).copied();
        quartile.is_none_or(|usual| to(&one) <= UNUSUAL * usual)
    };
    2 * compared.iter().filter(is_far).count() >= compared.len()
}

fn is_changing(values: &[f64]) -> bool {
    let changing = values.array_windows().filter(|[a, b]| a != b).count();
    !values.is_empty() && changing as f64 >= CHANGING * values.len() as f64
}

/// Result of a comparison of two signals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Likeness {
    /// The second signal is predictable: it has no noise to compare.
    Noiseless,
    /// Apart from offset and gain they differ less than the noise of the second.
    Copy,
    Different,
}

fn likeness(a: &[f64], b: &[f64]) -> Likeness {
    let Some(noise) = noise(b) else {
        return Likeness::Noiseless;
    };
    match difference(a, b) {
        Some(difference) if difference <= DIFFERENCE * noise => Likeness::Copy,
        _ => Likeness::Different,
    }
}

/// Returns the upper quartile of the absolute differences of two signals after the best offset and gain of the first; `None` if no
/// positive gain makes them alike.
fn difference(a: &[f64], b: &[f64]) -> Option<f64> {
    if a.len() != b.len() {
        return None;
    }
    let [a, b] = [a, b].map(without_mean);
    let gain = dot(&a, &b) / dot(&a, &a);
    let differences = a.iter().zip(&b).map(|(a, b)| (gain * a - b).abs());
    (gain > 0.0 && gain.is_finite()).then(|| upper_quartile(differences.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_has_the_same_noise() {
        let noise = |factor: u32| -> Vec<f64> {
            let noise = (0..200_u32).map(|at| at.wrapping_mul(factor) ^ (at << 7));
            noise
                .map(|at| f64::from(at.wrapping_mul(2_654_435_761) >> 20))
                .collect()
        };
        let sine: Vec<f64> = (0..200).map(|at| (f64::from(at) * 0.7).sin()).collect();
        assert_eq!(likeness(&noise(77), &noise(91)), Likeness::Different);
        assert_eq!(likeness(&noise(77), &sine), Likeness::Noiseless);
        let copy: Vec<f64> = noise(77).iter().map(|x| (x * 0.1).round() + 5.0).collect();
        assert_eq!(likeness(&noise(77), &copy), Likeness::Copy);
    }
}
