//! What `tactnet eval --json` prints.

use std::collections::BTreeMap;

use serde::Serialize;
use tactnet_channel::percentile;
use tactnet_data::Seed;
use tactnet_pipeline::{
    Evaluation, PredictionMethod, RuntimeComparison, RuntimeKind, Verdicts, serialize_by_method,
};

/// The document.
#[derive(Serialize)]
pub(super) struct EvalResult {
    pub(super) schema_version: u32,
    pub(super) run: String,
    pub(super) git: &'static str,
    pub(super) seed: Seed,
    pub(super) split_sha256: String,
    /// False while the run has not ended; the weights are then those of its last checkpoint.
    pub(super) finished: bool,
    pub(super) data: String,
    pub(super) data_sha256: String,
    pub(super) tested: String,
    pub(super) n_test: usize,
    #[serde(serialize_with = "serialize_by_method")]
    pub(super) evaluations: BTreeMap<PredictionMethod, Evaluation>,
    /// By way of predicting; only with `--runtime`.
    #[serde(
        skip_serializing_if = "BTreeMap::is_empty",
        serialize_with = "serialize_by_method"
    )]
    pub(super) runtimes: BTreeMap<PredictionMethod, RuntimeSummary>,
    /// Only after `train --calibrate`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) verdicts: Option<Verdicts>,
}

/// How another form compares with Burn's predictions of whole batches, and how fast it is.
#[derive(Debug, Serialize)]
pub(super) struct RuntimeSummary {
    runtime: &'static str,
    /// Largest difference of a probability.
    largest_difference: f64,
    /// From the last frame to the probabilities of a sweep that comes alone, microseconds.
    p50_us: f64,
    p99_us: f64,
    max_us: f64,
}

impl RuntimeSummary {
    pub(super) fn of(kind: RuntimeKind, compared: &RuntimeComparison) -> Self {
        let at = |share| percentile(&compared.microseconds, share).unwrap_or(0.0);
        Self {
            runtime: kind.name(),
            largest_difference: compared.largest_difference,
            p50_us: at(0.5),
            p99_us: at(0.99),
            max_us: at(1.0),
        }
    }
}

impl std::fmt::Display for RuntimeSummary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}: probabilities differ from Burn's by at most {:.1e}; {:.0} us after the last frame, 99 % below {:.0}",
            self.runtime, self.largest_difference, self.p50_us, self.p99_us
        )
    }
}
