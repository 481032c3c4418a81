//! Other forms of the network, judged on the same sweeps.

#[cfg(feature = "candle")]
mod candle;
#[cfg(feature = "onnxruntime")]
mod onnx_runtime;

use std::time::Instant;

use clap::ValueEnum;
use serde::Serialize;
use tactnet_channel::percentile;
use tactnet_data::SweepView;
use tactnet_pipeline::{Classifier, OnlineClassifier, PredictionMethod, Predictions};

/// What computes the scores.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RuntimeChoice {
    /// Burn, batch by batch: what training uses
    Burn,
    /// Frame by frame: what `tactnet serve` uses
    Online,
    /// The exported ONNX file in ONNX Runtime (a build with `--features onnxruntime`)
    Onnxruntime,
    /// The exported weights in candle (a build with `--features candle`)
    Candle,
}

/// How a form compares with Burn's predictions of whole batches, and how fast it is.
#[derive(Debug, Serialize)]
pub struct Compared {
    /// Name of the form.
    runtime: &'static str,
    /// Largest difference of a probability.
    largest_difference: f64,
    /// From the last frame to the probabilities of a sweep that comes alone, microseconds.
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

/// Something that gives log-probabilities of whole sweeps.
pub trait Scorer {
    /// Its name.
    fn name(&self) -> &'static str;

    /// - `digits`: `[sweeps][steps][taxels]`
    ///
    /// Gives `[sweeps][materials]`.
    ///
    /// # Errors
    /// What the runtime says.
    fn score(&mut self, digits: &[f32]) -> anyhow::Result<Vec<f64>>;
}

/// Predicts every sweep by itself.
///
/// - `burn`: what Burn says of the same sweeps, whole batches at once
///
/// # Errors
/// A form that this program was built without; a model that the form cannot be made of.
pub fn compare(
    choice: RuntimeChoice,
    classifier: &Classifier,
    view: &SweepView<'_>,
    burn: &Predictions,
) -> anyhow::Result<(Predictions, Compared)> {
    let mc_samples = match burn.method {
        PredictionMethod::Plain => 0,
        PredictionMethod::McDropout { mc_samples } => mc_samples,
    };
    match choice {
        RuntimeChoice::Burn => {
            let mut one = Vec::new();
            judge("burn", view, burn, |position, _| {
                let view = SweepView::new(view.dataset(), vec![view.indices()[position]]);
                let begun = Instant::now();
                let found = classifier.predict(&view, burn.method)?;
                let time = begun.elapsed().as_secs_f64() * 1e6;
                one.clone_from(&found.sweeps[0].log_probability);
                Ok((one.clone(), time))
            })
        }
        RuntimeChoice::Online => {
            let mut online = OnlineClassifier::new(classifier, None, mc_samples)?;
            let taxels = view.shape().taxels();
            judge("online", view, burn, |_, sweep| {
                let (before, last) = sweep.split_at(sweep.len() - taxels);
                online.begin();
                for frame in before.chunks_exact(taxels) {
                    online.push(frame);
                }
                let begun = Instant::now();
                online.push(last);
                let belief = match burn.method {
                    PredictionMethod::Plain => online.judge(),
                    PredictionMethod::McDropout { .. } => online.judge_by_dropout(),
                };
                let time = begun.elapsed().as_secs_f64() * 1e6;
                Ok((belief.log_probability.to_vec(), time))
            })
        }
        RuntimeChoice::Onnxruntime | RuntimeChoice::Candle => {
            let mut scorer = exported(choice, classifier, mc_samples)?;
            judge(scorer.name(), view, burn, |_, sweep| {
                let begun = Instant::now();
                let found = scorer.score(sweep)?;
                Ok((found, begun.elapsed().as_secs_f64() * 1e6))
            })
        }
    }
}

#[cfg(any(feature = "onnxruntime", feature = "candle"))]
fn exported(
    choice: RuntimeChoice,
    classifier: &Classifier,
    mc_samples: usize,
) -> anyhow::Result<Box<dyn Scorer>> {
    use std::collections::BTreeMap;

    let weights = classifier.network()?.weights();
    let config = classifier.config();
    let masks = match mc_samples {
        0 => Vec::new(),
        mc_samples => classifier.masks(mc_samples)?,
    };
    let about = BTreeMap::new();
    match choice {
        #[cfg(feature = "onnxruntime")]
        RuntimeChoice::Onnxruntime => {
            let model = tactnet_pipeline::to_onnx(config, &weights, None, &about)?;
            let threads = std::thread::available_parallelism().map_or(1, usize::from);
            let features = weights.0["hidden.weight"].shape[1];
            Ok(Box::new(onnx_runtime::OnnxRuntime::new(
                &model,
                config.shape,
                features,
                masks,
                threads,
            )?))
        }
        #[cfg(feature = "candle")]
        RuntimeChoice::Candle => {
            let bytes = tactnet_pipeline::to_safetensors(config, &weights, None, &about)?;
            Ok(Box::new(candle::Candle::new(&bytes, config.shape, masks)?))
        }
        other => without(other),
    }
}

#[cfg(not(any(feature = "onnxruntime", feature = "candle")))]
fn exported(
    choice: RuntimeChoice,
    _classifier: &Classifier,
    _runs: usize,
) -> anyhow::Result<Box<dyn Scorer>> {
    without(choice)
}

fn without(choice: RuntimeChoice) -> anyhow::Result<Box<dyn Scorer>> {
    let name = choice.to_possible_value();
    let name = name.as_ref().map_or("", |name| name.get_name());
    anyhow::bail!("this program was built without `{name}`; build it with `--features {name}`")
}

/// - `score`: log-probabilities of a sweep, and how long they took, microseconds
fn judge(
    runtime: &'static str,
    view: &SweepView<'_>,
    burn: &Predictions,
    mut score: impl FnMut(usize, &[f32]) -> anyhow::Result<(Vec<f64>, f64)>,
) -> anyhow::Result<(Predictions, Compared)> {
    let mut predictions = burn.clone();
    let mut sweep = vec![0.0; view.shape().values()];
    let mut times = Vec::with_capacity(view.len());
    let mut largest_difference = 0.0_f64;
    for (position, one) in predictions.sweeps.iter_mut().enumerate() {
        view.copy_batch(&[position], &mut sweep);
        let (found, time) = score(position, &sweep)?;
        if found.len() != one.log_probability.len() || found.iter().any(|score| score.is_nan()) {
            anyhow::bail!("{runtime}: a sweep has no scores, or others than of its materials");
        }
        times.push(time);
        for (burn, found) in one.log_probability.iter_mut().zip(found) {
            largest_difference = largest_difference.max((burn.exp() - found.exp()).abs());
            *burn = found;
        }
    }
    times.sort_by(f64::total_cmp);
    let at = |share| percentile(&times, share).unwrap_or(0.0);
    let compared = Compared {
        runtime,
        largest_difference,
        p50_us: at(0.5),
        p99_us: at(0.99),
        max_us: at(1.0),
    };
    Ok((predictions, compared))
}
