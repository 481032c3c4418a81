//! Sweeps of several lengths.

use super::finding;
use crate::format::OddLength;
use crate::{Dataset, Finding, FindingKind, Place, Remedy, Severity};

/// Number of standard deviations of guessing above which lengths separate the materials.
const SEPARATING: f64 = 3.0;

/// Returns the findings about sweeps that are longer or shorter than `steps` frames.
///
/// - `sweeps`: number of sweeps that have `steps` frames, or were cut to them
pub fn check_lengths(steps: usize, sweeps: usize, odd: &[OddLength]) -> Vec<Finding> {
    let short = odd.iter().filter(|sweep| sweep.frames < steps);
    let (short, shortest) = (
        short.clone().count(),
        short.map(|sweep| sweep.frames).min().unwrap_or(steps),
    );
    if odd.is_empty() {
        return Vec::new();
    }
    let say = |message| {
        finding(
            Severity::Error,
            FindingKind::UnequalLengths,
            Place::default(),
            message,
        )
    };
    let left_out = match short {
        0 => String::new(),
        short => format!(", {short} shorter (not checked further), the shortest {shortest}"),
    };
    let summary = format!(
        "{} of {} sweeps are not {steps} frames long: {} longer{left_out}",
        odd.len(),
        sweeps + short,
        odd.len() - short,
    );
    let each = odd
        .iter()
        .map(|OddLength { sweep, frames }| say(format!("sweep `{sweep}`: {frames} frames")));
    let summary = Finding {
        remedy: Some(Remedy::KeepLengths { steps: shortest }),
        ..say(summary)
    };
    std::iter::once(summary).chain(each).collect()
}

/// Materials that lengths alone tell apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Separation {
    /// Share of sweeps that the nearest length recognises.
    pub(super) right: f64,
    /// Share of sweeps of the most common material.
    pub(super) guessing: f64,
}

impl Separation {
    /// Returns the shares if the lengths separate the materials.
    ///
    /// - `lengths`: `[sweeps]`
    pub(super) fn by(dataset: &Dataset, lengths: &[usize]) -> Option<Self> {
        let labels: Vec<usize> = dataset.records().iter().map(|of| of.label).collect();
        let right = nearest_length(lengths, &labels);
        let all = labels.len() as f64;
        let most = dataset.sweeps_per_label().into_iter().max();
        let guessing = most.unwrap_or(0) as f64 / all;
        let chance = (guessing * (1.0 - guessing) / all).sqrt();
        (right > guessing + SEPARATING * chance).then_some(Self { right, guessing })
    }
}

/// Returns a warning if the lengths of the sweeps separate the materials.
pub(super) fn telling_lengths(dataset: &Dataset) -> Option<Finding> {
    let lengths = dataset.lengths().filter(|_| dataset.labels().len() > 1)?;
    let by_length = Separation::by(dataset, lengths)?;
    let message = format!(
        "the length of the sweeps alone separates the materials: {:.0} % of the sweeps are recognised by it, {:.0} % by guessing",
        100.0 * by_length.right,
        100.0 * by_length.guessing,
    );
    let kind = FindingKind::TellingLengths;
    Some(finding(Severity::Warning, kind, Place::default(), message))
}

/// Returns the expected share of sweeps whose material is that of the other sweep with the most similar length; of several
/// such sweeps one is drawn.
fn nearest_length(lengths: &[usize], labels: &[usize]) -> f64 {
    let mut right = 0.0;
    for (own, (length, label)) in lengths.iter().zip(labels).enumerate() {
        let others = || (0..lengths.len()).filter(|other| *other != own);
        let distance = |other: usize| lengths[other].abs_diff(*length);
        let Some(least) = others().map(distance).min() else {
            continue;
        };
        let nearest = || others().filter(|other| distance(*other) == least);
        let same = nearest().filter(|other| labels[*other] == *label).count();
        right += same as f64 / nearest().count() as f64;
    }
    right / lengths.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_that_follow_the_material_separate_and_others_do_not() {
        let labels = [0, 0, 0, 1, 1, 1];
        assert_eq!(nearest_length(&[10, 12, 11, 40, 41, 44], &labels), 1.0);
        assert!((nearest_length(&[7; 6], &labels) - 0.4).abs() < 1e-12);
        assert_eq!(nearest_length(&[10, 20, 30, 10, 20, 30], &labels), 0.0);
    }
}
