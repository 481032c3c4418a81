//! Values that are not finite.

use super::finding;
use super::sweep_statistics::SweepStatistics;
use super::taxel_names::taxel_name;
use crate::{Dataset, Finding, FindingKind, Place, Remedy, Severity};

pub(super) fn not_finite(dataset: &Dataset, sweeps: &[SweepStatistics]) -> Vec<Finding> {
    let shape = dataset.shape();
    let mut findings = Vec::new();
    for (index, sweep) in sweeps.iter().enumerate() {
        let Some((count, first)) = sweep.not_finite else {
            continue;
        };
        let (step, taxel) = (first / shape.taxels(), first % shape.taxels());
        // NaN from one step to the end of the sweep is most likely padding.
        let is_padded = step > 0 && count == (sweep.steps - step) * shape.taxels();
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
