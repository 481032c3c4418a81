//! One way of predicting, evaluated.

use serde::{Deserialize, Serialize};
use tactnet_data::{Seed, SweepView};

use crate::{Classifier, Estimate, FusedAccuracy, PipelineError, PredictionMethod, Predictions};

/// Predicts `view` plainly and, where the model has dropout, with `mc_samples` passes of MC dropout, unless that is 0; returns predictions
/// and what they are worth, both of which name their method.
///
/// # Errors
/// Sweeps that do not fit the classifier.
pub fn evaluate_all_ways(
    classifier: &Classifier,
    view: &SweepView<'_>,
    mc_samples: usize,
    sweeps: usize,
    seed: Seed,
) -> Result<Vec<(Predictions, Evaluation)>, PipelineError> {
    let mut methods = vec![PredictionMethod::Plain];
    if classifier.has_dropout() && mc_samples > 0 {
        methods.push(PredictionMethod::McDropout { mc_samples });
    }
    methods
        .into_iter()
        .map(|method| {
            let predictions = classifier.predict(view, method)?;
            let evaluation = Evaluation::of(&predictions, sweeps, seed);
            Ok((predictions, evaluation))
        })
        .collect()
}

/// Everything measured on the predictions of one method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// How the probabilities were computed.
    pub method: PredictionMethod,
    /// Accuracy of single sweeps.
    pub one_sweep: Estimate,
    /// Accuracy of fused sweeps; absent where no material has enough test sweeps.
    pub fused: Option<FusedAccuracy>,
    /// Mean negative log-likelihood, nats.
    pub negative_log_likelihood: f64,
    /// Expected calibration error, 15 bins, 0 to 1.
    pub expected_calibration_error: f64,
    /// Brier score, 0 to 2.
    pub brier: f64,
}

impl Evaluation {
    /// Judges `predictions`, fusing `sweeps` sweeps.
    ///
    /// # Panics
    /// If there is no prediction.
    pub fn of(predictions: &Predictions, sweeps: usize, seed: Seed) -> Self {
        Self {
            method: predictions.method,
            one_sweep: predictions.one_sweep(),
            fused: predictions.fused(sweeps, seed),
            negative_log_likelihood: predictions.negative_log_likelihood(),
            expected_calibration_error: predictions.expected_calibration_error(),
            brier: predictions.brier(),
        }
    }
}
