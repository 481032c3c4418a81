//! Evaluation of one prediction method.

use serde::{Deserialize, Serialize};
use tactnet_data::{Seed, SweepView};

use crate::{
    Classifier, Estimate, FusedAccuracy, LengthAccuracy, PipelineError, PredictionMethod,
    Predictions,
};

/// Predicts `view` plainly and, if the model has dropout and `mc_samples` is above 0, by MC dropout; returns predictions and evaluations.
///
/// - `mc_samples`: number of Monte Carlo passes
/// - `sweeps`: number of sweeps that are fused into one decision
///
/// # Errors
/// Sweeps that do not match the classifier.
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
            let evaluation = Evaluation::of_view(view, &predictions, sweeps, seed);
            Ok((predictions, evaluation))
        })
        .collect()
}

/// Metrics of the predictions of one method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Prediction method.
    pub method: PredictionMethod,
    /// Accuracy on single sweeps.
    pub one_sweep: Estimate,
    /// Balanced accuracy on single sweeps; absent in results of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub balanced: Option<Estimate>,
    /// Accuracy for each quartile of the sweeps' lengths, the shortest first; absent if all sweeps have one length.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub by_length: Vec<LengthAccuracy>,
    /// Accuracy on fused sweeps; absent if no material has enough test sweeps.
    pub fused: Option<FusedAccuracy>,
    /// Mean negative log-likelihood, in nats.
    pub negative_log_likelihood: f64,
    /// Expected calibration error, 15 bins, 0 to 1.
    pub expected_calibration_error: f64,
    /// Brier score, 0 to 2.
    pub brier: f64,
}

impl Evaluation {
    /// Evaluates predictions of `view` as [`Evaluation::of`], also by length.
    pub(crate) fn of_view(
        view: &SweepView<'_>,
        predictions: &Predictions,
        sweeps: usize,
        seed: Seed,
    ) -> Self {
        Self {
            by_length: LengthAccuracy::quartiles(view.dataset(), predictions),
            ..Self::of(predictions, sweeps, seed)
        }
    }

    /// Evaluates `predictions`; `sweeps` sweeps are fused into one decision.
    ///
    /// # Panics
    /// If `predictions` is empty.
    pub fn of(predictions: &Predictions, sweeps: usize, seed: Seed) -> Self {
        Self {
            method: predictions.method,
            one_sweep: predictions.one_sweep(),
            balanced: Some(predictions.balanced()),
            by_length: Vec::new(),
            fused: predictions.fused(sweeps, seed),
            negative_log_likelihood: predictions.negative_log_likelihood(),
            expected_calibration_error: predictions.expected_calibration_error(),
            brier: predictions.brier(),
        }
    }
}
