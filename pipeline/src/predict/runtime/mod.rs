//! Other runtimes for the network, compared with Burn's predictions of the same sweeps.

#[cfg(feature = "candle")]
mod candle;
#[cfg(feature = "onnxruntime")]
mod onnx_runtime;

use std::time::Instant;

use tactnet_data::SweepView;
use tactnet_models::MissingFeature;

use crate::{Classifier, OnlineClassifier, PipelineError, PredictionMethod, Predictions};

/// Runtime that computes the scores.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RuntimeKind {
    /// Burn, one sweep at a time.
    Burn,
    /// The online classifier, one frame at a time.
    Online,
    /// The exported ONNX file in ONNX Runtime; needs the cargo feature `onnxruntime`.
    OnnxRuntime,
    /// The exported weights in candle; needs the cargo feature `candle`.
    Candle,
}

impl RuntimeKind {
    /// Returns its name in arguments and results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Burn => "burn",
            Self::Online => "online",
            Self::OnnxRuntime => "onnxruntime",
            Self::Candle => "candle",
        }
    }

    /// Returns the error of a build without this runtime, whose cargo feature has the same name.
    fn missing(self) -> PipelineError {
        PipelineError::NoRuntime {
            source: MissingFeature {
                feature: self.name(),
            },
        }
    }
}

/// Predictions of another runtime, compared with Burn's of whole batches.
#[derive(Debug, Clone)]
pub struct RuntimeComparison {
    /// Predictions of the runtime.
    pub predictions: Predictions,
    /// Largest absolute difference of a probability.
    pub largest_difference: f64,
    /// Times from the last frame of a single sweep to its probabilities, in microseconds, ascending: `[sweeps]`.
    pub microseconds: Vec<f64>,
}

/// Network in another library.
#[cfg(any(feature = "onnxruntime", feature = "candle"))]
trait ExportedNetwork {
    /// Returns log-probabilities `[sweeps][materials]`.
    ///
    /// - `digits`: `[sweeps][steps][taxels]`
    ///
    /// # Errors
    /// Errors of the library.
    fn score(&mut self, digits: &[f32]) -> Result<Vec<f64>, RuntimeFailure>;
}

/// Error of a library that cannot load or run a network.
#[cfg(any(feature = "onnxruntime", feature = "candle"))]
type RuntimeFailure = Box<dyn std::error::Error + Send + Sync>;

/// Predicts every sweep separately with another runtime and compares the predictions with Burn's.
///
/// - `burn`: Burn's predictions of the same sweeps in whole batches
///
/// # Errors
/// A runtime that this build lacks; a model that the runtime does not support.
pub fn compare_runtime(
    kind: RuntimeKind,
    classifier: &Classifier,
    view: &SweepView<'_>,
    burn: &Predictions,
) -> Result<RuntimeComparison, PipelineError> {
    let mc_samples = burn.method.mc_samples_or(0);
    match kind {
        RuntimeKind::Burn => {
            let mut one = Vec::new();
            compare(kind, classifier, view, burn, |position, _| {
                let view = SweepView::new(view.dataset(), vec![view.indices()[position]]);
                let begun = Instant::now();
                let found = classifier.predict(&view, burn.method)?;
                let time = begun.elapsed().as_secs_f64() * 1e6;
                one.clone_from(&found.sweeps[0].log_probability);
                Ok((one.clone(), time))
            })
        }
        RuntimeKind::Online => {
            let mut online = OnlineClassifier::new(classifier, None, mc_samples)?;
            let (taxels, most) = (view.shape().taxels(), classifier.config().longest_trained());
            if view.longest() > most {
                let expected = format!("at most {most} steps for online classification");
                let found = format!("{} steps", view.longest());
                return Err(PipelineError::incompatible("sweeps", expected, found));
            }
            compare(kind, classifier, view, burn, |_, sweep| {
                let (before, last) = sweep.split_at(sweep.len() - taxels);
                online.begin();
                for frame in before.chunks_exact(taxels) {
                    online.push(frame);
                }
                let begun = Instant::now();
                online.push(last);
                let belief = match burn.method {
                    PredictionMethod::Plain => online.classify(),
                    PredictionMethod::McDropout { .. } => online.classify_by_dropout(),
                };
                let time = begun.elapsed().as_secs_f64() * 1e6;
                Ok((belief.log_probability.to_vec(), time))
            })
        }
        RuntimeKind::OnnxRuntime | RuntimeKind::Candle => {
            compare_exported(kind, classifier, view, burn, mc_samples)
        }
    }
}

#[cfg(any(feature = "onnxruntime", feature = "candle"))]
fn compare_exported(
    kind: RuntimeKind,
    classifier: &Classifier,
    view: &SweepView<'_>,
    burn: &Predictions,
    mc_samples: usize,
) -> Result<RuntimeComparison, PipelineError> {
    use std::collections::BTreeMap;

    let failed = |reason: RuntimeFailure| PipelineError::Runtime {
        runtime: kind.name(),
        reason: one_line(&*reason),
    };
    let (config, weights) = (classifier.config(), classifier.weights());
    if config.trained_steps.is_some() || view.dataset().lengths().is_some() {
        let (expected, found) = ("sweeps of one length for this runtime", "unequal lengths");
        return Err(PipelineError::incompatible("sweeps", expected, found));
    }
    let masks = masks_of(classifier, mc_samples)?;
    let about = BTreeMap::new();
    let mut network: Box<dyn ExportedNetwork> = match kind {
        #[cfg(feature = "onnxruntime")]
        RuntimeKind::OnnxRuntime => {
            let inputs = match mc_samples {
                0 => crate::OnnxInputs::Digits,
                _ => crate::OnnxInputs::DigitsAndMasks,
            };
            let model = crate::to_onnx(config, &weights, None, None, inputs, &about)?;
            let threads = std::thread::available_parallelism().map_or(1, usize::from);
            let network = onnx_runtime::OnnxRuntime::new(&model, config.shape, masks, threads);
            Box::new(network.map_err(failed)?)
        }
        #[cfg(feature = "candle")]
        RuntimeKind::Candle => {
            let bytes = crate::to_safetensors(config, &weights, None, &about)?;
            let masks = masks.into_iter().next().map_or(Vec::new(), |of| of.values);
            let network = candle::Candle::new(&bytes, config.shape, masks);
            Box::new(network.map_err(failed)?)
        }
        _ => {
            return Err(kind.missing());
        }
    };
    compare(kind, classifier, view, burn, |_, sweep| {
        let begun = Instant::now();
        let found = network.score(sweep).map_err(failed)?;
        Ok((found, begun.elapsed().as_secs_f64() * 1e6))
    })
}

/// Dropout masks of an exported network.
#[cfg(any(feature = "onnxruntime", feature = "candle"))]
#[cfg_attr(
    not(feature = "onnxruntime"),
    allow(dead_code, reason = "candle has one input")
)]
struct Masks {
    /// Name of the input.
    input: String,
    /// Number of masks.
    samples: usize,
    /// `[samples][features]`
    values: Vec<f32>,
}

/// Returns the masks of a network, or of every network of a committee; none for a plain prediction.
#[cfg(any(feature = "onnxruntime", feature = "candle"))]
fn masks_of(classifier: &Classifier, samples: usize) -> Result<Vec<Masks>, PipelineError> {
    if samples == 0 {
        return Ok(Vec::new());
    }
    let of = |input: String, network: &Classifier| {
        let values = network.masks(samples)?;
        Ok(Masks {
            input,
            samples,
            values,
        })
    };
    let Some(committee) = classifier.committee() else {
        return Ok(vec![of("masks".into(), classifier)?]);
    };
    let networks = committee.named_members();
    networks
        .filter(|(_, member)| member.has_dropout())
        .map(|(name, member)| of(format!("{name}/masks"), member))
        .collect()
}

/// Returns an error with those causes that its own text leaves out.
#[cfg(any(feature = "onnxruntime", feature = "candle"))]
fn one_line(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let said = error.to_string();
        if !text.contains(&said) {
            text = format!("{text}: {said}");
        }
        cause = error.source();
    }
    text
}

#[cfg(not(any(feature = "onnxruntime", feature = "candle")))]
fn compare_exported(
    kind: RuntimeKind,
    _: &Classifier,
    _: &SweepView<'_>,
    _: &Predictions,
    _: usize,
) -> Result<RuntimeComparison, PipelineError> {
    Err(kind.missing())
}

/// - `score`: returns the log-probabilities of a sweep and the time that they took in microseconds
fn compare(
    kind: RuntimeKind,
    classifier: &Classifier,
    view: &SweepView<'_>,
    burn: &Predictions,
    mut score: impl FnMut(usize, &[f32]) -> Result<(Vec<f64>, f64), PipelineError>,
) -> Result<RuntimeComparison, PipelineError> {
    let mut predictions = burn.clone();
    let mut times = Vec::with_capacity(view.len());
    let mut largest_difference = 0.0_f64;
    for (position, one) in predictions.sweeps.iter_mut().enumerate() {
        let mut sweep = view.sweep(position);
        classifier.dead().apply(&mut sweep, view.shape().taxels());
        let (found, time) = score(position, &sweep)?;
        if found.len() != one.log_probability.len() || found.iter().any(|score| score.is_nan()) {
            return Err(PipelineError::Runtime {
                runtime: kind.name(),
                reason: "a sweep has no scores, or others than of its materials".into(),
            });
        }
        times.push(time);
        for (burn, found) in one.log_probability.iter_mut().zip(found) {
            largest_difference = largest_difference.max((burn.exp() - found.exp()).abs());
            *burn = found;
        }
    }
    times.sort_by(f64::total_cmp);
    Ok(RuntimeComparison {
        predictions,
        largest_difference,
        microseconds: times,
    })
}
