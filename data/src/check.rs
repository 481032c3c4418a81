//! Checks of a data set.
//!
//! | kind | severity | when |
//! |---|---|---|
//! | [`NotFinite`](FindingKind::NotFinite) | error | a NaN or an infinity |
//! | [`UnequalLengths`](FindingKind::UnequalLengths) | error | sweeps that are longer or shorter than most, see [`check_lengths`] |
//! | [`ConstantSweep`](FindingKind::ConstantSweep) | error | all taxels of a sweep are constant |
//! | [`IdenticalSweeps`](FindingKind::IdenticalSweeps) | error | equal values in two sweeps, which would leak test data into training |
//! | [`FewSweeps`](FindingKind::FewSweeps) | error; warning below 5 | fewer than two sweeps of a material; fewer than the usual 5 folds |
//! | [`DeadTaxel`](FindingKind::DeadTaxel) | warning | a taxel has the same value in all sweeps |
//! | [`ConstantTaxel`](FindingKind::ConstantTaxel) | warning; note at 0 | a taxel is constant during a sweep; 0 means no contact |
//! | [`Saturation`](FindingKind::Saturation) | warning | at least 1 % of a sweep is at the sensor's maximum |
//! | [`OutOfRange`](FindingKind::OutOfRange) | warning | values far larger than in other sweeps, or negative in few sweeps |
//! | [`UnbalancedMaterials`](FindingKind::UnbalancedMaterials) | warning | unequal numbers of sweeps |
//! | [`AssumedRate`](FindingKind::AssumedRate) | warning | the data does not name its sample rate |
//! | [`NumberedMaterials`](FindingKind::NumberedMaterials) | note | all names of materials are bare numbers |
//! | [`AxisOrder`](FindingKind::AxisOrder) | warning | a side of the patch has more than 32 taxels and more taxels than there are steps |
//! | [`ShortSweeps`](FindingKind::ShortSweeps) | warning | sweeps shorter than 50 ms |
//! | [`LongSweeps`](FindingKind::LongSweeps) | warning | sweeps longer than ten minutes, or fewer than 5 frames per second |
//! | [`ClockTaxel`](FindingKind::ClockTaxel) | warning | a taxel rises identically in all sweeps, or counts up |
//! | [`SingleMaterial`](FindingKind::SingleMaterial) | warning | only one material |
//! | [`AlikeNames`](FindingKind::AlikeNames) | warning | names that differ only in case or white space |
//! | [`AssumedPatch`](FindingKind::AssumedPatch) | note | taxels in one row, because the data does not name their arrangement |
//! | [`NotRead`](FindingKind::NotRead) | note | a part of the file that is not read |

mod axes;
mod lengths;
mod names;
mod sweeps_per_material;
mod values;

pub use lengths::check_lengths;

use crate::format::UNLABELLED;
use crate::{DataError, Dataset, Finding, FindingKind, Place, Severity};
use rayon::prelude::*;
use values::SweepRange;

/// Returns all findings about a data set, sorted by severity, kind and sweep.
///
/// ```
/// use tactnet_data::twin::{self, TwinConfig};
/// use tactnet_data::{FindingKind, check};
///
/// let config = TwinConfig { materials: 2, sweeps: 3, steps: 100, ..TwinConfig::default() };
/// let findings = check(&twin::generate(&config)?);
/// // Three sweeps per material are too few for the usual five folds.
/// assert!(findings.iter().any(|finding| finding.kind == FindingKind::FewSweeps));
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
pub fn check(dataset: &Dataset) -> Vec<Finding> {
    let sweeps: Vec<SweepRange> = (0..dataset.len())
        .into_par_iter()
        .map(|index| SweepRange::of(dataset, index))
        .collect();
    let dead = values::dead_taxels(&sweeps);
    let mut findings = values::not_finite(dataset, &sweeps);
    findings.extend(values::constant(dataset, &sweeps, &dead));
    findings.extend(values::dead_findings(dataset.shape(), &dead));
    findings.extend(values::identical(dataset, &sweeps));
    findings.extend(values::saturated(dataset, &sweeps));
    findings.extend(values::out_of_range(dataset, &sweeps));
    findings.extend(sweeps_per_material::check(dataset));
    findings.extend(names::numbered(dataset));
    findings.extend(names::that_mislead(dataset));
    findings.extend(values::clock_taxels(dataset, &sweeps));
    findings.extend(axes::time_axis(dataset));
    // If the order of the axes is in doubt, so is the number of taxels.
    let axes_in_doubt = findings.iter().any(|of| of.kind == FindingKind::AxisOrder);
    findings.extend(axes::assumed_patch(dataset).filter(|_| !axes_in_doubt));
    findings.extend_from_slice(dataset.reading_findings());
    findings.sort_by_key(|finding| (finding.severity, finding.kind, finding.at.sweep));
    findings
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
/// use tactnet_data::twin::{self, TwinConfig};
/// use tactnet_data::refuse_errors;
///
/// let config = TwinConfig { materials: 2, sweeps: 1, steps: 100, ..TwinConfig::default() };
/// let error = refuse_errors(&twin::generate(&config)?, "small").unwrap_err();
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
