//! Sweeps and taxels that do not change.

use super::finding;
use super::sweep_statistics::SweepStatistics;
use super::taxel_names::{in_sweep, taxel_names};
use crate::{Dataset, Finding, FindingKind, Place, Severity};

pub(super) fn constant(
    dataset: &Dataset,
    sweeps: &[SweepStatistics],
    is_dead: impl Fn(usize) -> bool,
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
                    low == high && (*low == 0.0) == at_zero && !is_dead(*taxel)
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
