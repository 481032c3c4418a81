//! Splits that put sweeps with shared frames on both sides.

use rayon::prelude::*;

use super::sweep_statistics::SweepStatistics;
use crate::{DataError, Dataset, Finding, FindingKind, Scheme, Severity};

/// Returns the warnings of [`check`](crate::check()) about sweeps of one block that share frames or are copies. It is much
/// faster than the whole check.
///
/// ```
/// use tactnet_data::shared_within_blocks;
/// use tactnet_data::twin;
///
/// assert!(shared_within_blocks(&twin::small(2, 5, 100)?).is_empty());
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
pub fn shared_within_blocks(dataset: &Dataset) -> Vec<Finding> {
    if !dataset.has_blocks() {
        return Vec::new();
    }
    let sweeps: Vec<SweepStatistics> = (0..dataset.len())
        .into_par_iter()
        .map(|index| SweepStatistics::of(dataset, index))
        .collect();
    let mut findings = super::copies(dataset, &sweeps);
    findings.retain(is_within_block);
    findings
}

fn is_within_block(finding: &Finding) -> bool {
    let kinds = [FindingKind::Overlap, FindingKind::NearDuplicate];
    finding.severity == Severity::Warning && kinds.contains(&finding.kind)
}

/// Returns an error if a split puts sweeps that share frames on both sides. A split by blocks keeps them together, and so
/// does the author's split if it divides no block.
///
/// - `findings`: those of [`check`](crate::check()) or of [`shared_within_blocks`]
/// - `name`: name or file of the data set, for the message
///
/// # Errors
/// [`DataError::Leak`], with the remedy [`Remedy::LeaveBlocksOut`](crate::Remedy::LeaveBlocksOut).
///
/// ```
/// use tactnet_data::twin;
/// use tactnet_data::{Scheme, refuse_errors, refuse_leaks};
///
/// let dataset = twin::small(2, 5, 100)?;
/// let findings = refuse_errors(&dataset, "twin")?;
/// refuse_leaks(&dataset, &findings, Scheme::default_for(&dataset), "twin")?;
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
pub fn refuse_leaks(
    dataset: &Dataset,
    findings: &[Finding],
    scheme: Scheme,
    name: &str,
) -> Result<(), DataError> {
    let leaks = |finding: &&Finding| {
        is_within_block(finding)
            && match scheme {
                Scheme::LeaveBlockOut | Scheme::GroupKFold { .. } | Scheme::TrainOnAll => false,
                Scheme::StratifiedKFold { .. } | Scheme::HoldOut { .. } => true,
                Scheme::TestFlag => finding
                    .at
                    .sweep
                    .is_none_or(|sweep| is_divided(dataset, sweep)),
            }
    };
    let mut leaks = findings.iter().filter(leaks);
    match leaks.next() {
        None => Ok(()),
        Some(first) => Err(DataError::Leak {
            name: name.into(),
            sweeps: 1 + leaks.count(),
            first: first.message.clone(),
        }),
    }
}

/// Returns true if the author's split divides the block of a sweep.
fn is_divided(dataset: &Dataset, sweep: usize) -> bool {
    let records = dataset.records();
    let mut together =
        (0..records.len()).filter(|&other| super::are_together(dataset, sweep, other));
    together.any(|other| records[other].test != records[sweep].test)
}
