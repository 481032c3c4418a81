//! Sweeps with equal values.

use std::collections::BTreeMap;

use super::finding;
use super::sweep_statistics::SweepStatistics;
use super::taxel_names::in_sweep;
use crate::{Dataset, Finding, FindingKind, Severity};

pub(super) fn identical(dataset: &Dataset, sweeps: &[SweepStatistics]) -> Vec<Finding> {
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
            let mut pairs = earlier.iter().zip(&values);
            earlier.len() == values.len() && pairs.all(|(a, b)| a.to_bits() == b.to_bits())
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
