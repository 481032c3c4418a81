//! What an experiment found, made from what its tasks left: the numbers behind the report.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{Audit, Comparison, Grouping, Statistic, StudySummary};

/// Everything an experiment found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Version of this layout, [`Summary::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name of the recipe.
    pub name: String,
    /// One line for people.
    pub title: String,
    /// What the recipe's author expects.
    pub expects: String,
    /// The call that leads here.
    pub command: String,
    /// Commits of the programs that ran the tasks.
    pub git: Vec<String>,
    /// Names every random choice.
    pub seed: u64,
    /// Tasks that have ended.
    pub tasks_done: usize,
    /// Tasks there are.
    pub tasks: usize,
    /// Training time of all tasks together, seconds.
    pub train_seconds: f64,
    /// Processor models that were used.
    pub processors: Vec<String>,
    /// Data sets: name to SHA-256 of the content.
    pub data_sha256: BTreeMap<String, String>,
    /// One entry for each data set, model and way of predicting.
    pub rows: Vec<Row>,
    /// Pairs of rows on the same folds.
    pub comparisons: Vec<Comparison>,
    /// What each data set gives away.
    pub audits: Vec<Audit>,
    /// Materials in groups, by row (see [`Row::key`]).
    pub groups: BTreeMap<String, Grouping>,
    /// What a study found; `rows` and what is made of them are then empty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub study: Option<StudySummary>,
}

impl Summary {
    /// Version written by this program.
    pub const SCHEMA_VERSION: u32 = 1;
}

/// One line of the table: one model on one data set, asked one way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Unique within the summary.
    pub key: String,
    /// Name of the data set; "twin" is synthetic.
    pub data: String,
    /// Name of the model's recipe.
    pub model: String,
    /// `kept` or `removed`.
    pub levels: String,
    /// How the data set was split.
    pub split: String,
    /// `plain` or `mc_dropout`.
    pub prediction: String,
    /// Time steps of a sweep.
    pub steps: usize,
    /// Whether this is a probe (means, permuted labels) rather than a contender.
    pub probe: bool,
    /// Materials in label order.
    pub materials: Vec<String>,
    /// Accuracy of single sweeps, 0 to 1.
    pub one_sweep: Statistic,
    /// Accuracy of three sweeps fused (Bayes).
    pub three_sweeps: Option<Statistic>,
    /// Standard deviation of one fold's accuracy that its finite number of test sweeps alone explains: `sqrt(a (1 - a) / n)`.
    pub sigma_test: f64,
    /// Mean negative log-likelihood, nats.
    pub negative_log_likelihood: Statistic,
    /// Expected calibration error, 15 bins, 0 to 1.
    pub expected_calibration_error: Statistic,
    /// Brier score, 0 to 2.
    pub brier: Statistic,
    /// Training time of one fold, seconds.
    pub train_seconds: Statistic,
    /// Training sweeps of a fold.
    pub n_train: usize,
    /// Test sweeps of a fold.
    pub n_test: usize,
    /// Counts `[true][predicted]`, all folds together.
    pub confusion: Vec<Vec<usize>>,
    /// Fifteen equally wide bins of confidence.
    pub reliability: Vec<ReliabilityBin>,
    /// Error among the most confident share of the sweeps, all folds together.
    pub risk_coverage: Vec<RiskCoverage>,
    /// What was published for this row, if anything was.
    pub published: Option<Published>,
    /// Folds in the order of the statistics.
    pub folds: Vec<FoldRecord>,
}

impl Row {
    /// Runs of the cross-validation: how often every sweep was tested.
    pub(crate) fn repeats(&self) -> usize {
        let repeats: std::collections::BTreeSet<usize> =
            self.folds.iter().map(|fold| fold.repeat).collect();
        repeats.len().max(1)
    }
}

/// One bin of a reliability diagram.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReliabilityBin {
    /// Mean confidence, 0 to 1.
    pub confidence: f64,
    /// Share that was right, 0 to 1.
    pub accuracy: f64,
    /// Sweeps in the bin; bins without any are left out.
    pub count: usize,
}

/// One point of a risk-coverage curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RiskCoverage {
    /// Share of the sweeps that are answered, most confident first.
    pub coverage: f64,
    /// Share of the answers that are wrong.
    pub risk: f64,
}

/// A published accuracy on TactMat, %.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Published {
    /// What it was published for.
    pub classifier: String,
    /// One sweep.
    pub one_sweep: f64,
    /// Three sweeps.
    pub three_sweeps: f64,
}

/// Where the numbers of one fold come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoldRecord {
    /// Run of the cross-validation.
    #[serde(alias = "run")]
    pub repeat: usize,
    /// Fold of the repeat.
    pub fold: usize,
    /// The call that repeats this fold.
    pub command: String,
    /// Commit of the program.
    pub git: String,
    /// SHA-256 of the split.
    pub split_sha256: String,
    /// SHA-256 of the recipe.
    pub recipe_sha256: String,
    /// Predictions file, relative to the experiment's folder.
    pub predictions: String,
    /// Accuracy of single sweeps.
    pub one_sweep: f64,
}
