//! Cross-validation: the accuracy of classifiers on held-out sweeps. Each task is one training with its evaluation.

mod audit;
mod confidence;
mod contenders;
mod scored;
mod training;

use serde::{Deserialize, Serialize};
use tactnet_data::{Scheme, SplitManifest};
use tactnet_pipeline::{RunConfig, SplitKind};

use super::{Ask, Compared, FOLDS, Named, REPEATS, five, one, within};
use crate::context::{Cancelled, StudyContext};
use crate::one_or_many::one_or_many;
use crate::plan::Grid;
use crate::result::Answer;
use crate::summarise::FinishedTask;
use crate::tasks::ExperimentDir;
use crate::{ExperimentError, Measure, Part, Summary, Task, grouping_of_counts};

pub use audit::Audit;
pub(crate) use audit::LevelShare;
pub use confidence::{ReliabilityBin, RiskCoverage};
pub use contenders::{Contender, FoldRecord, PublishedContender};
pub(crate) use scored::{Scored, few_steps, scored};
pub(crate) use training::read_training;

/// Fields of a cross-validation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Crossval {
    /// Kinds of split.
    #[serde(default = "k_fold", deserialize_with = "one_or_many")]
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
            split: k_fold(),
            folds: five(),
            repeats: one(),
            probes: Vec::new(),
            watch_test: false,
            groups: 0,
        }
    }
}

impl Crossval {
    /// Returns the description of a split with the trained folds: "2 of 5 random folds".
    fn folds_text(&self, split: &SplitManifest, config: &RunConfig) -> String {
        let whole = training::split_name(split, config);
        let Scheme::StratifiedKFold { folds, .. } = split.scheme else {
            return whole;
        };
        let part = if self.folds < folds {
            format!("{} of {whole}", self.folds)
        } else {
            whole
        };
        match self.repeats {
            0 | 1 => part,
            repeats => format!("{part}, {repeats} times"),
        }
    }
}

fn k_fold() -> Vec<SplitKind> {
    vec![SplitKind::KFold]
}

/// A classifier that measures the information in a data set other than texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, PartialOrd, Ord)]
#[serde(rename_all = "kebab-case")]
pub enum Probe {
    /// Nearest neighbour on taxel means.
    Means,
    /// MiniRocket on permuted labels, which must score chance.
    Permuted,
}

impl Probe {
    /// All probes.
    pub(crate) const ALL: [Self; 2] = [Self::Means, Self::Permuted];

    /// Returns the name in recipes of experiments.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Means => "means",
            Self::Permuted => "permuted",
        }
    }

    /// Returns the recipe of the probe's model.
    pub(crate) fn recipe(self) -> &'static str {
        match self {
            Self::Means => "means",
            Self::Permuted => "minirocket",
        }
    }
}

impl Ask for Crossval {
    fn validate(&self) -> Result<(), String> {
        if self.split.is_empty() {
            return Err("`split`: expected at least one, found none".into());
        }
        // Random folds are always two repeats of five; `folds` and `repeats` select some of them.
        let random = self.split == [SplitKind::KFold];
        within(
            "folds",
            self.folds,
            1,
            if random { FOLDS } else { usize::MAX },
        )?;
        within("repeats", self.repeats, 1, REPEATS)
    }

    /// Plans the tasks fold by fold, so that a partly finished experiment has the same folds of every model.
    fn tasks(&self, grid: &Grid<'_>) -> Result<Vec<Task>, String> {
        let mut tasks = Vec::new();
        for repeat in 0..self.repeats {
            for fold in 0..self.folds {
                for point in grid.points() {
                    for &split in &self.split {
                        // Only random splits differ between repeats; the author's split and a hold-out have one fold.
                        let random = matches!(split, SplitKind::KFold | SplitKind::HoldOut);
                        let single = matches!(split, SplitKind::TestFlag | SplitKind::HoldOut);
                        if repeat > 0 && !random || fold > 0 && single {
                            continue;
                        }
                        let place = (split, repeat, fold);
                        tasks.extend(self.probes.iter().map(|probe| point.probe(*probe, place)));
                        tasks.extend(grid.models().iter().map(|model| {
                            let mut task = point.training(model, place);
                            task.job.spec_mut().watch_test = self.watch_test;
                            task
                        }));
                    }
                }
            }
        }
        Ok(tasks)
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

    fn complete(
        &self,
        dir: &ExperimentDir,
        summary: &mut Summary,
        finished: &[FinishedTask<'_>],
    ) -> Result<(), ExperimentError> {
        summary.contenders = contenders::contenders(dir, summary, finished, self)?;
        for row in &mut summary.rows {
            let published = summary
                .contenders
                .iter()
                .find(|contender| contender.key == row.contender)
                .and_then(|contender| contender.published.as_ref());
            row.published = match (published, row.measure, row.sweeps) {
                (Some(published), Measure::Accuracy, Some(1)) => Some(published.one_sweep / 100.0),
                (Some(published), Measure::Accuracy, Some(3)) => {
                    Some(published.three_sweeps / 100.0)
                }
                _ => None,
            };
        }
        let scored = scored(summary);
        let audits = audit::audits(&scored);
        let mut groups = std::collections::BTreeMap::new();
        for contender in scored.iter().filter(|contender| {
            self.groups > 0 && !contender.probe && contender.materials.len() > self.groups
        }) {
            groups.insert(
                contender.key.to_string(),
                grouping_of_counts(
                    contender.confusion,
                    self.groups,
                    contender.repeats(),
                    summary.seed,
                )
                .with_three_sweeps(contender.fused_confusion),
            );
        }
        (summary.audits, summary.groups) = (audits, groups);
        Ok(())
    }

    fn terms(&self) -> &'static [(&'static str, &'static str)] {
        &TERMS
    }
}

/// Glossary of the report.
const TERMS: [(&str, &str); 13] = [
    (
        "1 sweep",
        "The material is told from one stroke of the sensor over it.",
    ),
    (
        "3 sweeps",
        "Three sweeps of one material are judged one by one, and their scores are fused by Bayes' rule as if independent.",
    ),
    (
        "3 sweeps, vote",
        "Each of the three has one vote; a tie goes to the larger sum of evidence. Votes of independent sweeps of accuracy p, of which two \
         suffice, would give p\u{b3} + 3p\u{b2}(1 \u{2212} p): 94.3, 94.7 and 94.9 % for the published 85.5, 86.1 and 86.3 %, beside \
         which the publication states 94.3, 94.5 and 95.0 % for three sweeps.",
    ),
    (
        "sd and 95 % interval",
        "The standard deviation is that over folds. The interval is the mean's, widened because training sets of different folds \
         overlap (Nadeau and Bengio, 2003).",
    ),
    (
        "\u{3c3}<sub>test</sub>",
        "How much one fold's accuracy would scatter merely because its test sweeps are finite in number: \
         \u{221a}(a (1 \u{2212} a) / n). An sd near it says that folds differ by little else.",
    ),
    (
        "Random draws",
        "Every fold of every model starts from the same seed: initial weights, order of sweeps, dropout and random kernels are drawn alike \
         in all folds. Means and intervals hold for these draws; another seed would move them a little.",
    ),
    (
        "Corrected resampled t-test",
        "A paired t-test over folds whose variance is widened in the same way. A small p says that a difference this large would be \
         rare if the two were equally good.",
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
        "Whether the mean of each taxel stays in a sweep. With levels removed each taxel's mean is subtracted from every sweep; \
         what goes with the level, such as how strongly it fluctuates, stays.",
    ),
    (
        "Probe",
        "A deliberately poor classifier, or one trained on permuted labels: it shows what a score is worth on this data set.",
    ),
];
