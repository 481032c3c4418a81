//! Checks of the numbers of sweeps per material.

use super::finding;
use crate::{Dataset, Finding, FindingKind, Place, Remedy, Severity};

/// Number of folds of the published cross-validation.
const USUAL_FOLDS: usize = 5;

/// Returns findings about materials with few sweeps and about unequal numbers of sweeps.
pub(super) fn check(dataset: &Dataset) -> Vec<Finding> {
    let counts = dataset.sweeps_per_label();
    let mut findings = Vec::new();
    let nowhere = Place::default;
    for (label, &count) in counts.iter().enumerate().filter(|&(_, &count)| count < 2) {
        let name = dataset.labels().name(label);
        let message =
            format!("`{name}`: found {count} of the 2 sweeps that training and testing need");
        findings.push(finding(
            Severity::Error,
            FindingKind::FewSweeps,
            nowhere(),
            message,
        ));
    }
    let extreme = |by: fn(&usize, &usize) -> bool| {
        let best = |best: usize, label: usize| {
            if by(&counts[label], &counts[best]) {
                label
            } else {
                best
            }
        };
        (1..counts.len()).fold(0, best)
    };
    findings.extend(few_sweeps(&counts, findings.is_empty()));
    let (least, most) = (extreme(|a, b| a < b), extreme(|a, b| a > b));
    if counts[least] != counts[most] {
        let (few, many) = (dataset.labels().name(least), dataset.labels().name(most));
        let message = format!(
            "from {} (`{few}`) to {} (`{many}`) sweeps per material: accuracy is dominated by those with more; record more of `{few}`, or omit some of the others",
            counts[least], counts[most]
        );
        let kind = FindingKind::UnbalancedMaterials;
        findings.push(finding(Severity::Warning, kind, nowhere(), message));
    }
    findings
}

/// Returns a warning of materials with fewer sweeps than a cross-validation has folds.
///
/// - `can_split`: true if every material has two sweeps, so that cross-validation is possible
fn few_sweeps(counts: &[usize], can_split: bool) -> Option<Finding> {
    let few = counts
        .iter()
        .filter(|count| (2..USUAL_FOLDS).contains(*count));
    let fewest = few.clone().min()?;
    let folds = match can_split {
        true => {
            format!("cross-validation uses {fewest} folds instead of {USUAL_FOLDS}; ")
        }
        false => String::new(),
    };
    let message = format!(
        "{} of {} materials have fewer than {USUAL_FOLDS} sweeps: {folds}studies of few sweeps refuse them",
        few.count(),
        counts.len()
    );
    Some(Finding {
        remedy: can_split.then_some(Remedy::ChooseFolds),
        ..finding(
            Severity::Warning,
            FindingKind::FewSweeps,
            Place::default(),
            message,
        )
    })
}
