//! Cross-validation: the accuracy of classifiers on held-out sweeps. Each task is one training with its evaluation.

use serde::{Deserialize, Serialize};
use tactnet_pipeline::SplitKind;

use super::{Ask, Compared, FOLDS, Named, REPEATS, check_counts, five, one, within};
use crate::answer::Answer;
use crate::context::{Cancelled, StudyContext};
use crate::error::ExperimentError;
use crate::measure::Measure;
use crate::one_or_many::one_or_many;
use crate::part::Part;
use crate::probe::Probe;

/// Fields of a cross-validation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Crossval {
    /// Kinds of split; empty: folds of whole blocks and random folds, or random folds where the data has no blocks.
    #[serde(default, deserialize_with = "one_or_many")]
    pub split: Vec<SplitKind>,
    /// Number of folds of each repeat that are trained.
    #[serde(default = "five")]
    pub folds: usize,
    /// Number of repeats of the cross-validation.
    #[serde(default = "one", alias = "runs")]
    pub repeats: usize,
    /// Probes that run in addition to the models.
    #[serde(default, deserialize_with = "one_or_many")]
    pub probes: Vec<Probe>,
    /// Numbers of training sweeps of each material; models are also trained on so few, drawn from each fold.
    #[serde(default, deserialize_with = "one_or_many")]
    pub shots: Vec<usize>,
    /// Records the networks' accuracy on the test sweeps after every epoch; nothing is selected by it.
    #[serde(default)]
    pub watch_test: bool,
    /// Number of groups of confused materials; 0 for none.
    #[serde(default)]
    pub groups: usize,
}

impl Default for Crossval {
    fn default() -> Self {
        Self {
            split: Vec::new(),
            folds: five(),
            repeats: one(),
            probes: Vec::new(),
            shots: Vec::new(),
            watch_test: false,
            groups: 0,
        }
    }
}

impl Ask for Crossval {
    fn validate(&self) -> Result<(), String> {
        // Random folds are always two repeats of five; `folds` and `repeats` select some of them.
        let random = matches!(self.split[..], [] | [SplitKind::KFold]);
        within(
            "folds",
            self.folds,
            1,
            if random { FOLDS } else { usize::MAX },
        )?;
        check_counts("shots", &self.shots)?;
        within("repeats", self.repeats, 1, REPEATS)
    }

    fn parts(&self) -> Vec<Part> {
        Vec::new()
    }

    fn answer(&self, _context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
        Err(Cancelled::Failed(ExperimentError::Recipe {
            origin: self.name().into(),
            reason: "its tasks are trainings".into(),
        }))
    }

    /// Unused: every training records its own numbers of sweeps.
    fn test_share(&self) -> f64 {
        0.25
    }

    fn compared(&self, measure: Measure) -> Option<Compared> {
        (measure == Measure::Accuracy).then_some(Compared::WithEachOther { sweeps: 1 })
    }
}

/// Glossary of the report.
pub(super) const TERMS: [(&str, &str); 13] = [
    (
        "1 sweep",
        "The material is predicted from one stroke of the sensor over it.",
    ),
    (
        "3 sweeps",
        "Three sweeps of one material are classified separately, and Bayes' rule fuses their scores as if they were independent.",
    ),
    (
        "3 sweeps, vote",
        "Each of the three has one vote; a tie goes to the larger sum of evidence. Votes of independent sweeps of accuracy p, of which two \
         suffice, would give p\u{b3} + 3p\u{b2}(1 \u{2212} p): 94.3, 94.7 and 94.9 % for the published 85.5, 86.1 and 86.3 %, while \
         the publication states 94.3, 94.5 and 95.0 % for three sweeps.",
    ),
    (
        "sd and 95 % interval",
        "The standard deviation is that over folds. The interval is the mean's, widened because training sets of different folds \
         overlap (Nadeau and Bengio, 2003).",
    ),
    (
        "\u{3c3}<sub>test</sub>",
        "Standard deviation of one fold's accuracy due to its finite number of test sweeps alone: \
         \u{221a}(a (1 \u{2212} a) / n). If the sd is similar, folds hardly differ otherwise.",
    ),
    (
        "Random draws",
        "Every fold of every model starts from the same seed: initial weights, order of sweeps, dropout and random kernels are equal \
         in all folds. Means and intervals hold for these draws; another seed changes them slightly.",
    ),
    (
        "Corrected resampled t-test",
        "A paired t-test over folds whose variance is widened in the same way. A small p means that a difference this large would be \
         rare between equally accurate models.",
    ),
    (
        "MC dropout",
        "Dropout stays on while predicting; the scores are the mean over many random passes.",
    ),
    (
        "NLL",
        "Negative log-likelihood of the true material, in nats, mean over sweeps. Confident mistakes cost most.",
    ),
    (
        "ECE",
        "Expected calibration error: the mean gap between confidence and accuracy over 15 bins of confidence, weighted by sweeps.",
    ),
    (
        "Brier",
        "Squared distance between the scores and the truth, summed over materials, 0 to 2, mean over sweeps.",
    ),
    (
        "Levels kept, removed",
        "With levels removed, each taxel's mean is subtracted from every sweep. Properties that depend on the level, \
         such as the strength of fluctuations, remain.",
    ),
    (
        "Probe",
        "A deliberately poor classifier, or one trained on permuted labels, as a reference for scores on this data set.",
    ),
];
