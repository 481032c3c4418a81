//! Other forms of the network, judged on the same sweeps.

use std::time::Instant;

use clap::ValueEnum;
use serde::Serialize;
use tactnet_data::SweepView;
use tactnet_pipeline::{Classifier, OnlineClassifier, PredictionMethod, Predictions};
use tactnet_serving::percentile;

/// What computes the scores.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum RuntimeChoice {
    /// Burn, batch by batch: what training uses
    #[default]
    Burn,
    /// Frame by frame: what `tactnet serve` uses
    Online,
}

/// How another form compares with Burn's, and how fast it is.
#[derive(Debug, Serialize)]
pub struct Compared {
    /// Name of the form.
    runtime: &'static str,
    /// Largest difference of a probability.
    largest_difference: f64,
    /// From the last frame to the probabilities of a sweep, microseconds.
    p50_us: f64,
    p99_us: f64,
    max_us: f64,
}

impl std::fmt::Display for Compared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}: probabilities differ from Burn's by at most {:.1e}; {:.0} us after the last frame, 99 % below {:.0}",
            self.runtime, self.largest_difference, self.p50_us, self.p99_us
        )
    }
}

/// Predicts frame by frame.
///
/// - `burn`: what Burn says of the same sweeps
pub fn online(
    classifier: &Classifier,
    view: &SweepView<'_>,
    burn: &Predictions,
) -> anyhow::Result<(Predictions, Compared)> {
    let runs = match burn.method {
        PredictionMethod::Plain => 0,
        PredictionMethod::McDropout { runs } => runs,
    };
    let mut online = OnlineClassifier::new(classifier, None, runs)?;
    let mut predictions = burn.clone();
    let mut sweep = vec![0.0; view.shape().values()];
    let mut times = Vec::with_capacity(view.len());
    let mut largest_difference = 0.0_f64;
    for (position, score) in predictions.sweeps.iter_mut().enumerate() {
        view.copy_batch(&[position], &mut sweep);
        online.begin();
        for frame in sweep.chunks_exact(view.shape().taxels()) {
            online.push(frame);
        }
        let begun = Instant::now();
        let belief = match burn.method {
            PredictionMethod::Plain => online.judge(),
            PredictionMethod::McDropout { .. } => online.judge_by_dropout(),
        };
        times.push(begun.elapsed().as_secs_f64() * 1e6);
        for (burn, found) in score.log_probability.iter_mut().zip(belief.log_probability) {
            largest_difference = largest_difference.max((burn.exp() - found.exp()).abs());
            *burn = *found;
        }
    }
    times.sort_by(f64::total_cmp);
    let at = |share| percentile(&times, share).unwrap_or(0.0);
    let compared = Compared {
        runtime: "online",
        largest_difference,
        p50_us: at(0.5),
        p99_us: at(0.99),
        max_us: at(1.0),
    };
    Ok((predictions, compared))
}
