//! Checks of a data set.
//!
//! | kind | severity | when |
//! |---|---|---|
//! | [`NotFinite`](FindingKind::NotFinite) | error | a NaN or an infinity |
//! | [`UnequalLengths`](FindingKind::UnequalLengths) | error | sweeps that are longer or shorter than most, see [`check_lengths`] |
//! | [`TellingLengths`](FindingKind::TellingLengths) | warning | the lengths of the sweeps alone separate the materials |
//! | [`ConstantSweep`](FindingKind::ConstantSweep) | error | all taxels of a sweep are constant |
//! | [`IdenticalSweeps`](FindingKind::IdenticalSweeps) | error | equal values in two sweeps, which would leak test data into training |
//! | [`Overlap`](FindingKind::Overlap) | error; warning within a block | two sweeps share a run of frames that is too long and too lively for chance, as windows of one recording do |
//! | [`NearDuplicate`](FindingKind::NearDuplicate) | error; warning within a block | a sweep is another one except for rounding, an offset or a gain |
//! | [`FewSweeps`](FindingKind::FewSweeps) | error; warning below 5 | fewer than two sweeps of a material; fewer than the usual 5 folds |
//! | [`DeadTaxel`](FindingKind::DeadTaxel) | warning | a taxel has the same value in all sweeps, except for a few single frames |
//! | [`LeakingColumn`](FindingKind::LeakingColumn) | error; warning below 95 % | a taxel is constant in every sweep and its value follows the material; a condition alone tells the material |
//! | [`ConstantTaxel`](FindingKind::ConstantTaxel) | warning; note at 0 | a taxel is constant during a sweep; 0 means no contact |
//! | [`Saturation`](FindingKind::Saturation) | warning | at least 1 % of a sweep is at the sensor's maximum |
//! | [`OutOfRange`](FindingKind::OutOfRange) | warning | values far larger than in other sweeps, or negative in few sweeps |
//! | [`FillValue`](FindingKind::FillValue) | error | values that programs write for missing ones, such as 1e20 or -9999, far from all others of the taxel |
//! | [`Spike`](FindingKind::Spike) | warning; error above 0.1 % of the values | values of at most 3 frames more than 5 times as far from the taxel's median as its usual largest ones |
//! | [`Dropout`](FindingKind::Dropout) | warning; error from 10 % of a sweep or 1 % of all frames | all taxels are zero or frozen for several frames in the middle of a motion |
//! | [`Padding`](FindingKind::Padding) | warning; error if its length separates the materials | sweeps begin or end with equal frames, or end with noise alone, and no sensor at rest explains it |
//! | [`UnbalancedMaterials`](FindingKind::UnbalancedMaterials) | warning | unequal numbers of sweeps |
//! | [`AssumedRate`](FindingKind::AssumedRate) | warning | the data does not name its sample rate |
//! | [`AssumedUnit`](FindingKind::AssumedUnit) | note | time stamps without a unit that are Unix time in ms, µs or ns by their size |
//! | [`NamedRate`](FindingKind::NamedRate) | warning | the caller named another sample rate than the data or its time stamps |
//! | [`IrregularRate`](FindingKind::IrregularRate) | warning | mean and median time between frames differ by more than 5 % |
//! | [`MixedRates`](FindingKind::MixedRates) | error | a sweep or file whose rate differs from that of most by more than 2 % |
//! | [`TimeGap`](FindingKind::TimeGap) | warning; error if the gaps exceed a tenth of the sweep | more than 5 frames are missing at once, or no frame comes for 2 s |
//! | [`LostFrames`](FindingKind::LostFrames) | warning; error above 3 % of the frames | at most 5 frames at once are missing, by the time stamps |
//! | [`ClockBackwards`](FindingKind::ClockBackwards) | error; warning with a named rate | a time stamp is earlier than the one before it |
//! | [`NumberedMaterials`](FindingKind::NumberedMaterials) | note | all names of materials are bare numbers |
//! | [`AxisOrder`](FindingKind::AxisOrder) | warning | a side of the patch has more than 32 taxels and more taxels than there are steps |
//! | [`ShortSweeps`](FindingKind::ShortSweeps) | warning | sweeps shorter than 50 ms |
//! | [`LongSweeps`](FindingKind::LongSweeps) | warning | sweeps longer than ten minutes, or fewer than 5 frames per second |
//! | [`ClockTaxel`](FindingKind::ClockTaxel) | warning | a taxel rises identically in all sweeps, or counts up |
//! | [`SingleMaterial`](FindingKind::SingleMaterial) | warning | only one material |
//! | [`AlikeNames`](FindingKind::AlikeNames) | warning | names that look alike: they differ only in case, white space, invisible characters or letters of another script |
//! | [`ConfoundedBlocks`](FindingKind::ConfoundedBlocks) | warning | materials whose sweeps are all in one block, with at most half of the materials |
//! | [`AssumedPatch`](FindingKind::AssumedPatch) | note | taxels in one row, because the data does not name their arrangement |
//! | [`FolderLayout`](FindingKind::FolderLayout) | note | folders `train`, `test` or `val` are a split, so the folders in them name the materials |
//! | [`NotRead`](FindingKind::NotRead) | note | a part of the file that is not read |

mod axes;
mod blocks;
mod clock_taxels;
mod conditions;
mod constant;
mod dead_taxels;
mod dropouts;
mod fill_values;
mod identical;
mod leaking_columns;
mod leaks;
mod lengths;
mod names;
mod near_duplicates;
mod noise;
mod not_finite;
mod out_of_range;
mod overlap;
mod padding;
mod rest;
mod run_evidence;
mod saturation;
mod series;
mod shared_frames;
mod spikes;
mod sweep_statistics;
mod sweeps_per_material;
mod taxel_limits;
mod taxel_names;

pub use blocks::Confounding;
pub use leaks::{refuse_leaks, shared_within_blocks};
pub use lengths::check_lengths;

use crate::format::UNLABELLED;
use crate::{DataError, Dataset, Finding, FindingKind, Place, Severity};
use fill_values::FillValues;
use rayon::prelude::*;
use rest::Rest;
use sweep_statistics::SweepStatistics;
use taxel_limits::TaxelLimits;

/// Returns all findings about a data set, sorted by severity, kind and sweep.
///
/// ```
/// use tactnet_data::twin;
/// use tactnet_data::{FindingKind, check};
///
/// let findings = check(&twin::small(2, 3, 100)?);
/// // Three sweeps per material are too few for the usual five folds.
/// assert!(findings.iter().any(|finding| finding.kind == FindingKind::FewSweeps));
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
pub fn check(dataset: &Dataset) -> Vec<Finding> {
    let conditions = conditions::that_follow_the_material(dataset);
    // Conditions are columns that do not change during a sweep, which would be a fault of a taxel.
    let dataset = dataset.without_conditions();
    let dataset = dataset.as_ref();
    let sweeps: Vec<SweepStatistics> = (0..dataset.len())
        .into_par_iter()
        .map(|index| SweepStatistics::of(dataset, index))
        .collect();
    let mut findings = of_values(dataset, &sweeps);
    findings.extend(sweeps_per_material::check(dataset));
    findings.extend(blocks::confounded(dataset));
    findings.extend(lengths::telling_lengths(dataset));
    findings.extend(names::numbered(dataset));
    findings.extend(names::that_mislead(dataset));
    findings.extend(clock_taxels::clock_taxels(dataset, &sweeps));
    findings.extend(axes::time_axis(dataset));
    // If the order of the axes is in doubt, so is the number of taxels.
    let axes_in_doubt = findings.iter().any(|of| of.kind == FindingKind::AxisOrder);
    findings.extend(axes::assumed_patch(dataset).filter(|_| !axes_in_doubt));
    findings.extend_from_slice(dataset.reading_findings());
    findings.extend(conditions);
    findings.sort_by_key(|finding| (finding.severity, finding.kind, finding.at.sweep));
    findings
}

/// Returns the findings about the values of the sweeps.
fn of_values(dataset: &Dataset, sweeps: &[SweepStatistics]) -> Vec<Finding> {
    let limits = TaxelLimits::of_taxels(dataset);
    let fills = FillValues::of(dataset, sweeps, &limits);
    let dead = dead_taxels::dead_taxels(dataset, sweeps, &limits);
    let is_dead = |taxel: usize| dead.contains_key(&taxel);
    let rest = Rest::of(dataset, sweeps, &limits);
    let spikes = spikes::spikes(dataset, sweeps, &limits, &fills, is_dead);
    let mut findings = not_finite::not_finite(dataset, sweeps);
    findings.extend(fills.findings(dataset, sweeps));
    let leaking = leaking_columns::leaking_columns(dataset, sweeps);
    let is_explained =
        |taxel: usize| is_dead(taxel) || leaking.iter().any(|of| of.taxel() == taxel);
    findings.extend(constant::constant(dataset, sweeps, is_explained));
    findings.extend(leaking.iter().map(|of| of.finding(dataset)));
    findings.extend(dead_taxels::findings(dataset, &dead));
    findings.extend(copies(dataset, sweeps));
    findings.extend(saturation::saturated(dataset, sweeps, &fills, is_explained));
    // Sweeps with fill values or spikes are out of range because of them.
    let is_sweep_explained = |sweep: usize| {
        fills.are_in(&sweeps[sweep]) || spikes.iter().any(|spike| spike.at.sweep == Some(sweep))
    };
    findings.extend(out_of_range::out_of_range(
        dataset,
        sweeps,
        is_sweep_explained,
    ));
    findings.extend(spikes);
    findings.extend(dropouts::dropouts(dataset, sweeps, &rest, &fills));
    findings.extend(padding::padding(dataset, sweeps, &rest, &fills));
    findings
}

/// Returns the findings about sweeps that are equal or share frames.
fn copies(dataset: &Dataset, sweeps: &[SweepStatistics]) -> Vec<Finding> {
    let mut findings = identical::identical(dataset, sweeps);
    let overlaps = overlap::overlaps(dataset, sweeps);
    findings.extend(overlap::findings(dataset, &overlaps));
    let mut copies = near_duplicates::near_duplicates(dataset, sweeps);
    // Sweeps with most of their frames in common are reported once.
    copies.retain(|copy| {
        let is_same = |of: &overlap::Overlap| (of.later, of.earlier) == (copy.later, copy.earlier);
        !overlaps.iter().any(is_same)
    });
    findings.extend(near_duplicates::findings(dataset, &copies));
    findings
}

/// Returns true if two sweeps are of one material and one recording block, so that a split by blocks keeps them together.
fn are_together(dataset: &Dataset, one: usize, other: usize) -> bool {
    let [one, other] = [one, other].map(|sweep| &dataset.records()[sweep]);
    one.block.is_some() && (one.block, one.label) == (other.block, other.label)
}

/// Returns the findings of [`check`] that do not concern materials, for unlabelled sweeps.
pub fn check_unlabelled(dataset: &Dataset) -> Vec<Finding> {
    let mut findings = check(dataset);
    findings.retain(|finding| !finding.kind.is_about_materials());
    let named = format!("`{UNLABELLED}` sweep ");
    for finding in &mut findings {
        finding.message = finding.message.replace(&named, "sweep ");
    }
    findings
}

/// Returns the findings of a data set without errors.
///
/// - `name`: name or file of the data set, for the message
///
/// # Errors
/// [`DataError::Unsound`] if there are findings of [`Severity::Error`].
///
/// ```
/// use tactnet_data::twin;
/// use tactnet_data::refuse_errors;
///
/// let error = refuse_errors(&twin::small(2, 1, 100)?, "small").unwrap_err();
/// assert!(error.to_string().starts_with("small: the data set has 2 errors"));
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
pub fn refuse_errors(dataset: &Dataset, name: &str) -> Result<Vec<Finding>, DataError> {
    let findings = check(dataset);
    let mut errors = findings
        .iter()
        .filter(|finding| finding.severity == Severity::Error);
    match errors.next() {
        None => Ok(findings),
        Some(first) => Err(DataError::Unsound {
            name: name.into(),
            errors: 1 + errors.count(),
            first: first.message.clone(),
        }),
    }
}

fn finding(severity: Severity, kind: FindingKind, at: Place, message: String) -> Finding {
    Finding::new(severity, kind, message).at(at)
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod foreign_values_tests;

#[cfg(test)]
mod copies_tests;

#[cfg(test)]
mod conditions_tests;
