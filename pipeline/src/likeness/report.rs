//! Verdict about sweeps as a whole and one by one.

use serde::Serialize;
use tactnet_data::{Seed, SweepView};

use super::constant_taxels::constant_taxels;
use super::reference::SweepSet;
use super::search::find_differences;
use super::{Difference, Likeness};

/// Level of the tests: the share of sweeps, or sets of sweeps, of the training data's kind that are called unlike.
const LEVEL: f64 = 0.05;
/// p-value of sweeps that differ clearly, even if recording blocks differ as much.
const CLEAR: f64 = 0.005;

/// Verdict about a set of sweeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LikenessVerdict {
    /// Like training sweeps of the same recording blocks.
    Like,
    /// Unlike them, but no more than the recording blocks of the training data differ from one another.
    OtherBlock,
    /// Unlike the training data.
    Unlike,
}

/// Comparison of a set of sweeps with the training sweeps.
#[derive(Debug, Clone, Serialize)]
pub struct LikenessReport {
    /// Verdict about all sweeps together.
    pub verdict: LikenessVerdict,
    /// p-value of all sweeps together: share of sets of held-out training sweeps that differ as much from the others.
    pub p: f64,
    /// The same for held-out recording blocks; absent if the training data have too few blocks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub p_other_block: Option<f64>,
    /// Number of sweeps with p-values of at most 0.05. Of sweeps like the training data, 5 % have one.
    pub unlike_sweeps: usize,
    /// p-value of every sweep.
    pub p_of_sweeps: Vec<f64>,
    /// What differs, most important first; empty for the verdict `like`, and for `other-block` if `p` is above 0.005.
    pub differences: Vec<Difference>,
}

impl LikenessReport {
    pub(super) fn of(likeness: &Likeness, view: &SweepView<'_>, seed: Seed) -> Self {
        let descriptions = likeness.descriptor.of_view(view);
        let constant = constant_taxels(view);
        let distances = likeness.distances_of(&descriptions, &constant);
        let mut rng = seed.rng("likeness, resamples");
        let scores = constant.iter().map(|of| likeness.constant.scores(of));
        let set = SweepSet {
            constant: scores.collect(),
            directions: likeness.distances.directions(&descriptions, &distances),
            distances: &distances,
        };
        let p = likeness.within.p_of_all(&set, &mut rng);
        let p_other_block = likeness
            .between
            .as_ref()
            .map(|between| between.p_of_all(&set, &mut rng));
        let verdict = if p > LEVEL {
            LikenessVerdict::Like
        } else if p_other_block.is_some_and(|p| p > LEVEL) {
            LikenessVerdict::OtherBlock
        } else {
            LikenessVerdict::Unlike
        };
        let p_of_sweeps: Vec<f64> = distances
            .iter()
            .map(|distance| likeness.within.p_of_sweep(distance))
            .collect();
        Self {
            differences: match verdict {
                LikenessVerdict::Unlike => find_differences(likeness, view, &constant),
                LikenessVerdict::OtherBlock if p <= CLEAR => {
                    find_differences(likeness, view, &constant)
                }
                _ => Vec::new(),
            },
            unlike_sweeps: p_of_sweeps.iter().filter(|p| **p <= LEVEL).count(),
            verdict,
            p,
            p_other_block,
            p_of_sweeps,
        }
    }
}
