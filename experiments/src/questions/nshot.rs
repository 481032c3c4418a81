//! n-shot transfer: a network learns 30 materials from all and six new ones from a few sweeps each (thesis, section
//! 4.6.4).
//!
//! ```text
//! materials ─┬─ 30 known ─┬─ 80 % of their sweeps: train the network, covariance, prior
//!            │            └─ 20 %: select hyperparameters
//!            └─ 6 new ──── five folds: n sweeps of each material of 80 %, evaluated on 20 %
//! ```

mod efficiency;
mod few_shots;
mod knowledge;
mod method;
mod transfer;
mod tuning;

use serde::{Deserialize, Serialize};

use super::headline::{Headline, best};
use super::{Ask, Compared, Figure, Published, check_shots, draws, one, six, within};
use crate::answer::Answer;
use crate::context::{Cancelled, StudyContext};
use crate::one_or_many::one_or_many;
use crate::phrases::{in_percent, sweeps};
use crate::{Measure, Part, Row};
pub use efficiency::SampleEfficiency;
pub(crate) use efficiency::sample_efficiency;
pub use method::TransferMethod;
use transfer::transfer;

/// Number of folds of the new materials' sweeps.
const FOLDS: usize = 5;

/// Fields of the question about n-shot transfer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nshot {
    /// Number of draws of the new materials.
    #[serde(default = "one")]
    pub splits: usize,
    /// Numbers of support sweeps of each new material.
    #[serde(deserialize_with = "one_or_many")]
    pub shots: Vec<usize>,
    /// Methods of transfer; all by default.
    #[serde(
        default,
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "one_or_many"
    )]
    pub methods: Vec<TransferMethod>,
    /// Number of new materials.
    #[serde(default = "six")]
    pub new_materials: usize,
    /// Number of the five folds in which a complete network is trained from scratch.
    #[serde(default = "one")]
    pub scratch_folds: usize,
    /// Approximate number of optimiser steps of a network from scratch; one epoch of a single batch is one step. The
    /// recipe's number of epochs is the minimum.
    #[serde(default = "usual_steps", skip_serializing_if = "are_usual_steps")]
    pub scratch_steps: usize,
    /// Learning rate of a network from scratch; the recipe's by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scratch_learning_rate: Option<f64>,
}

/// Default number of steps of a network from scratch.
const USUAL_STEPS: usize = 300;

fn usual_steps() -> usize {
    USUAL_STEPS
}

// serde requires a reference.
#[expect(clippy::trivially_copy_pass_by_ref)]
fn are_usual_steps(steps: &usize) -> bool {
    *steps == USUAL_STEPS
}

impl Nshot {
    fn methods(&self) -> &[TransferMethod] {
        if self.methods.is_empty() {
            &TransferMethod::ALL
        } else {
            &self.methods
        }
    }
}

impl Ask for Nshot {
    fn validate(&self) -> Result<(), String> {
        within("splits", self.splits, 1, usize::MAX)?;
        within("new_materials", self.new_materials, 2, usize::MAX)?;
        within("scratch_folds", self.scratch_folds, 1, FOLDS)?;
        within("scratch_steps", self.scratch_steps, 1, 1_000_000)?;
        if let Some(rate) = self.scratch_learning_rate
            && !(rate > 0.0 && rate < 1.0)
        {
            return Err(format!(
                "`scratch_learning_rate`: expected a number above 0 and below 1, found {rate}"
            ));
        }
        check_shots(&self.shots)
    }

    fn parts(&self) -> Vec<Part> {
        draws(self.splits)
    }

    fn new_materials(&self) -> Option<usize> {
        Some(self.new_materials)
    }

    fn answer(&self, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
        transfer(self, context)
    }

    fn compared(&self, measure: Measure) -> Option<Compared> {
        (measure == Measure::Accuracy).then_some(Compared::With("ol-mean"))
    }

    /// Figure 4.12 and section 4.6.4 of the thesis.
    fn published(&self, row: &Row) -> Published {
        match (row.method.as_str(), row.shots) {
            ("ol-mean", Some(1)) => Published::robot(0.755),
            ("ol", Some(1)) => Published::robot(0.750),
            _ => Published::default(),
        }
    }

    fn headline(&self, rows: &[&Row]) -> Option<Headline> {
        let fewest = rows.iter().filter_map(|row| row.shots).min()?;
        let accuracies = || {
            let rows = rows.iter().copied();
            rows.filter(|row| row.measure == Measure::Accuracy && row.shots == Some(fewest))
        };
        let best = best(accuracies())?;
        let guessing = in_percent(1.0 / self.new_materials as f64);
        let scratch = accuracies().find(|row| row.method == "nk" && row.method != best.method);
        let qualifier = match scratch {
            Some(scratch) => format!(
                "A network from scratch reaches {}, guessing {guessing}.",
                in_percent(scratch.statistic.mean)
            ),
            None => format!("Guessing reaches {guessing}."),
        };
        let says = format!(
            "of sweeps recognised after {} of each of {} new materials, by {}",
            sweeps(fewest),
            self.new_materials,
            best.method
        );
        Some(Headline::of(best, says, qualifier))
    }

    fn figures(&self) -> Vec<Figure> {
        vec![
            Figure::Shots {
                title: "Methods of the thesis",
                methods: &[
                    "nk",
                    "ol",
                    "ol-fcl",
                    "ol-mean",
                    "nn",
                    "siamese",
                    "siamese-full",
                ],
            },
            Figure::Shots {
                title: "Beyond the thesis",
                methods: &["ol-mean", "simpleshot", "lda", "tuned-ol", "whitened-ol"],
            },
        ]
    }
}

/// Glossary of the report.
pub(super) const TERMS: [(&str, &str); 5] = [
    (
        "OL, OL-FCL, OL-mean",
        "Fine-tuning of the output layer (OL) or of the last two layers (OL-FCL) of a network trained on the known materials, or an output layer with a prior at the known materials' weights (OL-mean; thesis, section 4.6). A prior mean that all classes share does not change the softmax, so OL-mean differs from OL only by the strength of the prior.",
    ),
    (
        "NK",
        "No prior knowledge: a complete network is trained on the new materials alone, in one fold of every draw (or as many as the recipe sets); the other methods use all five.",
    ),
    (
        "SimpleShot, LDA, whitened OL, tuned OL",
        "Nearest class mean of centred, normalised features (Wang et al., 2019); nearest class mean, and an output layer, on features whitened with the known materials' covariance; an output layer on plain features. Strengths are selected on known materials.",
    ),
    (
        "NN, Siamese, Siamese-full",
        "Nearest neighbour in the embedding; the same after training the dense layer on pairs of known sweeps with a contrastive loss; the same for a network trained on pairs from the beginning, as in the thesis.",
    ),
    (
        "OL-FCL",
        "150 steps of Adam from the network's own dense layer; unlike fitting an output layer, this does not converge to a vanishing gradient.",
    ),
];
