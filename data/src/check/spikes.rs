//! Single values far outside the usual range of their taxel.

use super::fill_values::FillValues;
use super::finding;
use super::sweep_statistics::SweepStatistics;
use super::taxel_limits::TaxelLimits;
use super::taxel_names::taxel_name;
use crate::{Dataset, Finding, FindingKind, Place, Severity};

/// Distance of a spike from the usual values of its taxel, in their largest usual deviations. Honest peaks of skins,
/// accelerometers and microphones reach 3.
const FAR: f32 = 5.0;
/// Distance of a spike in the largest usual deviations of all taxels of the same unit. Single electrodes of a BioTac jump
/// to values that its other electrodes show often; 2.5 is the largest such jump of the recordings tried.
const FAR_OF_ALIKE: f32 = 3.0;
/// Maximum duration of a spike, in frames: a longer excursion may be a contact.
const SPIKE_FRAMES: usize = 3;
/// Maximum height of the frames before and after a spike, as a share of the spike: the flanks of an honest peak are
/// higher.
const FLANK_SHARE: f32 = 1.0 / 3.0;
/// Share of all values above which spikes change what is learnt.
const MANY_SHARE: f64 = 0.001;
/// Number of spikes that a sensor may have in a short recording.
const FEW_SPIKES: usize = 2;

/// Spikes of one sweep.
struct Spikes {
    sweep: usize,
    count: usize,
    /// Step, taxel and value of the largest.
    largest: (usize, usize, f32),
    distance: f32,
}

/// Returns a finding for each sweep with spikes.
///
/// - `is_dead`: true for taxels that are dead
pub(super) fn spikes(
    dataset: &Dataset,
    sweeps: &[SweepStatistics],
    limits: &[TaxelLimits],
    fills: &FillValues,
    is_dead: impl Fn(usize) -> bool,
) -> Vec<Finding> {
    let is_far = |taxel: usize, value: f32| {
        let limits = &limits[taxel];
        value.is_finite()
            && limits.distance(value) > FAR
            && limits.distance_of_alike(value) > FAR_OF_ALIKE
            && !fills.contains(taxel, value)
    };
    let mut found = Vec::new();
    for (index, sweep) in sweeps.iter().enumerate() {
        let extremes = sweep.taxels.iter().enumerate();
        let far: Vec<usize> = extremes
            .filter(|&(taxel, &(low, high))| {
                let holds_fill = fills.contains(taxel, low) || fills.contains(taxel, high);
                (holds_fill || is_far(taxel, low) || is_far(taxel, high)) && !is_dead(taxel)
            })
            .map(|(taxel, _)| taxel)
            .collect();
        if !far.is_empty() {
            let values = dataset.sweep(index);
            found.extend(in_sweep(index, &values, &far, limits, &is_far));
        }
    }
    let total: usize = found.iter().map(|spikes| spikes.count).sum();
    let values = dataset.frames() * dataset.shape().taxels();
    let is_many = total > FEW_SPIKES && total as f64 > MANY_SHARE * values as f64;
    let severity = if is_many {
        Severity::Error
    } else {
        Severity::Warning
    };
    let finding_of = |spikes: Spikes| {
        let (step, taxel, value) = spikes.largest;
        let count = match spikes.count {
            1 => "a spike".into(),
            count => format!("{count} spikes, the largest"),
        };
        let message = format!(
            "{}: {count} of {value} at step {step}, taxel {}, {:.0} times as far from the median {} as usual values",
            dataset.describe(spikes.sweep),
            taxel_name(dataset.shape(), taxel),
            spikes.distance,
            limits[taxel].median,
        );
        let at = Place {
            sweep: Some(spikes.sweep),
            taxel: Some(taxel),
            step: Some(step),
            ..Place::default()
        };
        finding(severity, FindingKind::Spike, at, message)
    };
    found.into_iter().map(finding_of).collect()
}

fn in_sweep(
    sweep: usize,
    values: &[f32],
    taxels: &[usize],
    limits: &[TaxelLimits],
    is_far: &impl Fn(usize, f32) -> bool,
) -> Option<Spikes> {
    let mut found: Option<Spikes> = None;
    for &taxel in taxels {
        let of_taxel = values[taxel..].iter().step_by(limits.len()).copied();
        let of_taxel: Vec<f32> = of_taxel.collect();
        let mut step = 0;
        while step < of_taxel.len() {
            let far = of_taxel[step..].iter().take_while(|v| is_far(taxel, **v));
            let frames = far.count();
            let (start, end) = (step, step + frames);
            step = end + 1;
            if !(1..=SPIKE_FRAMES).contains(&frames) {
                continue;
            }
            let distances = of_taxel[start..end].iter().enumerate();
            let distances = distances.map(|(place, v)| (start + place, limits[taxel].distance(*v)));
            let top = distances.max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((peak, distance)) = top else {
                continue;
            };
            let flanks = [start.checked_sub(1), Some(end)].into_iter().flatten();
            let is_steep = flanks
                .filter_map(|flank| of_taxel.get(flank))
                .all(|flank| limits[taxel].distance(*flank) <= FLANK_SHARE * distance);
            if !is_steep {
                continue;
            }
            let spikes = found.get_or_insert(Spikes {
                sweep,
                count: 0,
                largest: (peak, taxel, of_taxel[peak]),
                distance,
            });
            spikes.count += frames;
            if distance > spikes.distance {
                spikes.distance = distance;
                spikes.largest = (peak, taxel, of_taxel[peak]);
            }
        }
    }
    found
}
