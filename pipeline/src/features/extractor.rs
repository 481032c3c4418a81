//! Extraction of feature vectors for classical classifiers.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use tactnet_data::{Seed, SweepShape, SweepView, TrainSplit};
use tactnet_models::{Features, Weights};

use crate::features::arrays::{get, get_indices, get_indices_below, of_length, put, put_indices};
use crate::features::hydra::Hydra;
use crate::features::log_spectra::LogSpectra;
use crate::features::quant::Quant;
use crate::features::rocket::{IN_STEPS, Kernels, Order, Pooling, WAYS, Workspace};
use crate::features::series::Series;
use crate::features::spectrum::{HighFeatures, LowFeatures};
use crate::{DeadTaxels, MeanRemoval, PipelineError};

/// Number of features of MiniRocket before rounding down to a multiple of 84 (Dempster et al., 2021).
const MINIROCKET_FEATURES: usize = 10_000;
/// Number of biases of MultiRocket for each of two series; four features are pooled per bias (Tan et al., 2022).
const MULTIROCKET_BIASES: usize = 6_250;

/// Features computed from a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FeatureSet {
    /// Mean digit of every taxel.
    Means,
    /// Digits of the first frame.
    FirstFrame,
    /// Digits of the last frame.
    LastFrame,
    /// Three numbers: roughness and two spectral centroids.
    L,
    /// Short-time spectrum.
    H,
    /// Mean digit and logarithmic power spectrum of every taxel.
    LogSpectra,
    /// MiniRocket.
    MiniRocket,
    /// MultiRocket, then Hydra.
    MultiRocketHydra,
    /// Quantiles over intervals, as in QUANT.
    Quant,
}

impl FeatureSet {
    /// Succeeds if the features exist for sweeps of this shape and rate.
    ///
    /// # Errors
    /// Sweeps that are too short; a rate that is too low.
    pub fn check(self, shape: SweepShape, rate: f64) -> Result<(), PipelineError> {
        match self {
            Self::Means | Self::FirstFrame | Self::LastFrame => Ok(()),
            Self::L => LowFeatures::check(shape, rate),
            Self::H => HighFeatures::check(shape, rate),
            Self::LogSpectra => LogSpectra::check(shape, rate),
            Self::MiniRocket | Self::MultiRocketHydra => enough_steps(shape),
            Self::Quant => Quant::check(shape),
        }
    }
}

/// Feature extractor, fitted to training sweeps if the feature set requires it.
///
/// Sweeps of any length have the same number of features.
pub(crate) struct Extractor {
    /// Shape of the longest sweep of the data set.
    shape: SweepShape,
    levels: MeanRemoval,
    kind: Kind,
}

enum Kind {
    Means,
    FirstFrame,
    LastFrame,
    Low(LowFeatures),
    High(HighFeatures),
    LogSpectra(LogSpectra),
    MiniRocket(Kernels),
    MultiRocketHydra {
        base: Kernels,
        difference: Kernels,
        hydra: Hydra,
    },
    Quant(Quant),
}

impl Extractor {
    /// Fits the extractor. Only the biases of random kernels depend on the training sweeps.
    ///
    /// # Errors
    /// Sweeps that are too short for the feature set.
    pub fn fit(
        set: FeatureSet,
        levels: MeanRemoval,
        train: &TrainSplit<'_>,
        seed: Seed,
    ) -> Result<Self, PipelineError> {
        let shape = train.shape();
        let rate = train.dataset().sample_rate_hz();
        let steps = train.lengths().min().unwrap_or(shape.steps);
        set.check(SweepShape { steps, ..shape }, rate)?;
        let extents = [shape.taxels(), shape.steps];
        let series = |position: usize| {
            let mut values = train.sweep(position);
            let steps = train.steps(position);
            levels.apply(&mut values, SweepShape { steps, ..shape });
            Series::from_frames(&values, shape.taxels())
        };
        let kernels = |order: Order, biases: usize, stream: &str| {
            let extents = match order {
                Order::Base => extents,
                Order::Difference => [extents[0], extents[1] - 1],
            };
            let read = |position| match order {
                Order::Base => series(position),
                Order::Difference => series(position).difference(),
            };
            let rng = &mut seed.rng(stream);
            Kernels::fit(extents, order, biases, train.len(), read, rng)
        };
        let kind = match set {
            FeatureSet::MiniRocket => {
                Kind::MiniRocket(kernels(Order::Base, MINIROCKET_FEATURES, "minirocket"))
            }
            FeatureSet::MultiRocketHydra => Kind::MultiRocketHydra {
                base: kernels(Order::Base, MULTIROCKET_BIASES, "multirocket"),
                difference: kernels(
                    Order::Difference,
                    MULTIROCKET_BIASES,
                    "multirocket difference",
                ),
                hydra: Hydra::draw(extents, &mut seed.rng("hydra")),
            },
            _ => {
                return Self::unfitted(set, levels, shape, rate);
            }
        };
        Ok(Self {
            shape,
            levels,
            kind,
        })
    }

    /// Returns an extractor of features that need no fit.
    ///
    /// # Errors
    /// Sweeps that are too short for the feature set.
    pub fn unfitted(
        set: FeatureSet,
        levels: MeanRemoval,
        shape: SweepShape,
        rate: f64,
    ) -> Result<Self, PipelineError> {
        let kind = match set {
            FeatureSet::L => Kind::Low(LowFeatures::new(shape, rate, levels)?),
            FeatureSet::H => Kind::High(HighFeatures::new(shape, rate, levels)?),
            FeatureSet::LogSpectra => Kind::LogSpectra(LogSpectra::new(shape, rate)?),
            FeatureSet::Quant => Kind::Quant(Quant::new(shape)?),
            FeatureSet::FirstFrame => Kind::FirstFrame,
            FeatureSet::LastFrame => Kind::LastFrame,
            _ => Kind::Means,
        };
        Ok(Self {
            shape,
            levels,
            kind,
        })
    }

    /// Restores the extractor written by [`Extractor::save`].
    ///
    /// # Errors
    /// Tensors that are missing or inconsistent.
    pub fn load(
        set: FeatureSet,
        levels: MeanRemoval,
        shape: SweepShape,
        rate: f64,
        weights: &Weights,
    ) -> Result<Self, PipelineError> {
        set.check(shape, rate)?;
        let kernels = |name: &str| {
            let kernels = load_kernels(weights, name, shape.taxels())?;
            kernels.check(name, shape.steps)?;
            Ok::<_, PipelineError>(kernels)
        };
        let kind = match set {
            FeatureSet::MiniRocket => Kind::MiniRocket(kernels("minirocket")?),
            FeatureSet::MultiRocketHydra => Kind::MultiRocketHydra {
                base: kernels("multirocket")?,
                difference: kernels("multirocket_difference")?,
                hydra: Hydra::of(
                    get(weights, "hydra.weights")?.values.clone(),
                    load_lists(weights, "hydra", shape.taxels())?,
                    shape.steps,
                )?,
            },
            _ => {
                return Self::unfitted(set, levels, shape, rate);
            }
        };
        Ok(Self {
            shape,
            levels,
            kind,
        })
    }

    /// Writes the fitted numbers into `weights`.
    pub fn save(&self, weights: &mut Weights) {
        match &self.kind {
            Kind::Means
            | Kind::FirstFrame
            | Kind::LastFrame
            | Kind::Low(_)
            | Kind::High(_)
            | Kind::LogSpectra(_)
            | Kind::Quant(_) => {}
            Kind::MiniRocket(kernels) => save_kernels(weights, "minirocket", kernels),
            Kind::MultiRocketHydra {
                base,
                difference,
                hydra,
            } => {
                save_kernels(weights, "multirocket", base);
                save_kernels(weights, "multirocket_difference", difference);
                put(weights, "hydra.weights", hydra.weights.clone());
                save_lists(weights, "hydra", &hydra.taxels);
            }
        }
    }

    /// Returns the number of features.
    pub fn width(&self) -> usize {
        match &self.kind {
            Kind::Means | Kind::FirstFrame | Kind::LastFrame => self.shape.taxels(),
            Kind::Low(_) => LowFeatures::WIDTH,
            Kind::High(features) => features.width(),
            Kind::LogSpectra(features) => features.width(),
            Kind::MiniRocket(kernels) => kernels.len(),
            Kind::MultiRocketHydra {
                base,
                difference,
                hydra,
            } => WAYS * (base.len() + difference.len()) + hydra.width(),
            Kind::Quant(features) => features.width(),
        }
    }

    /// Returns the number of Hydra's features, which are the last ones.
    pub fn hydra_width(&self) -> usize {
        match &self.kind {
            Kind::MultiRocketHydra { hydra, .. } => hydra.width(),
            _ => 0,
        }
    }

    /// Returns the taxel that a feature depends on; `None` if several do.
    pub fn taxel_of(&self, feature: usize) -> Option<usize> {
        let taxels = self.shape.taxels();
        match &self.kind {
            Kind::Means | Kind::FirstFrame | Kind::LastFrame => Some(feature),
            Kind::LogSpectra(_) if feature < taxels => Some(feature),
            Kind::LogSpectra(features) => Some((feature - taxels) / features.bands()),
            Kind::Quant(features) => Some(feature / features.width_of_taxel()),
            Kind::Low(_) | Kind::High(_) | Kind::MiniRocket(_) | Kind::MultiRocketHydra { .. } => {
                None
            }
        }
    }

    /// Returns the features of every sweep of `view`: `[sweeps][width]`.
    ///
    /// - `dead`: dead taxels with their readings
    pub fn features(&self, view: &SweepView<'_>, dead: &DeadTaxels) -> Features {
        let mut all = vec![0.0; view.len() * self.width()];
        all.par_chunks_exact_mut(self.width())
            .enumerate()
            .for_each_init(
                || (Vec::new(), Workspace::default()),
                |(sweep, workspace), (position, out)| {
                    let shape = SweepShape {
                        steps: view.steps(position),
                        ..self.shape
                    };
                    sweep.resize(shape.values(), 0.0);
                    view.copy_sweep(position, sweep);
                    dead.apply(sweep, shape.taxels());
                    self.levels.apply(sweep, shape);
                    match self.at_length(shape.steps) {
                        Some(own) => own.write(sweep, workspace, out),
                        None => self.write(sweep, workspace, out),
                    }
                },
            );
        Features::new(self.width(), all)
    }

    /// Returns the extractor of sweeps of `steps` steps, if it differs from this one.
    ///
    /// # Panics
    /// If sweeps of this length do not have these features.
    fn at_length(&self, steps: usize) -> Option<Self> {
        if steps == self.shape.steps {
            return None;
        }
        let kind = match &self.kind {
            Kind::Low(features) => Kind::Low(features.at_length(steps)),
            Kind::LogSpectra(features) => Kind::LogSpectra(features.at_length(steps)),
            Kind::Quant(features) => Kind::Quant(features.at_length(steps)),
            _ => return None,
        };
        Some(Self { kind, ..*self })
    }

    fn write(&self, sweep: &[f32], workspace: &mut Workspace, out: &mut [f32]) {
        let taxels = self.shape.taxels();
        match &self.kind {
            Kind::Means => write_means(sweep, self.levels, out),
            Kind::FirstFrame => out.copy_from_slice(&sweep[..taxels]),
            Kind::LastFrame => out.copy_from_slice(&sweep[sweep.len() - taxels..]),
            Kind::Low(features) => out.copy_from_slice(&features.of(sweep)),
            Kind::High(features) => features.write(sweep, out),
            Kind::LogSpectra(features) => {
                let (means, spectra) = out.split_at_mut(taxels);
                write_means(sweep, self.levels, means);
                features.write(sweep, spectra);
            }
            Kind::Quant(features) => features.write(sweep, out),
            Kind::MiniRocket(kernels) => {
                let series = Series::from_frames(sweep, taxels);
                kernels.transform(&series, Order::Base, Pooling::Share, workspace, out);
            }
            Kind::MultiRocketHydra {
                base,
                difference: of_difference,
                hydra,
            } => {
                let series = Series::from_frames(sweep, taxels);
                let difference = series.difference();
                let (first, rest) = out.split_at_mut(WAYS * base.len());
                let (second, third) = rest.split_at_mut(WAYS * of_difference.len());
                base.transform(&series, Order::Base, Pooling::FourWays, workspace, first);
                of_difference.transform(
                    &difference,
                    Order::Difference,
                    Pooling::FourWays,
                    workspace,
                    second,
                );
                hydra.transform(&series, &difference, third);
                if series.steps() != self.shape.steps {
                    let scale = self.shape.steps as f32 / series.steps() as f32;
                    scale_steps(first, scale);
                    scale_steps(second, scale);
                    third.iter_mut().for_each(|feature| *feature *= scale);
                }
            }
        }
    }
}

/// Multiplies the features of [`Pooling::FourWays`] that are numbers of steps, as if the sweep had another length.
fn scale_steps(features: &mut [f32], scale: f32) {
    let each = features.len() / WAYS;
    for (way, values) in features.chunks_exact_mut(each).enumerate() {
        if IN_STEPS.contains(&way) {
            // -1 stands for no step.
            let values = values.iter_mut().filter(|value| **value > 0.0);
            values.for_each(|value| *value *= scale);
        }
    }
}

/// Writes the mean of every taxel; exactly zero if means are removed, so that rounding errors carry no information.
fn write_means(sweep: &[f32], levels: MeanRemoval, out: &mut [f32]) {
    if levels == MeanRemoval::PerSweep {
        out.fill(0.0);
        return;
    }
    let mut sums = vec![0.0_f64; out.len()];
    for frame in sweep.chunks_exact(out.len()) {
        sums.iter_mut()
            .zip(frame)
            .for_each(|(sum, v)| *sum += f64::from(*v));
    }
    let steps = (sweep.len() / out.len()) as f64;
    out.iter_mut()
        .zip(sums)
        .for_each(|(out, sum)| *out = (sum / steps) as f32);
}

fn enough_steps(shape: SweepShape) -> Result<(), PipelineError> {
    const LEAST: usize = 10;
    if shape.steps >= LEAST {
        return Ok(());
    }
    Err(PipelineError::incompatible(
        "sweeps",
        format!("at least {LEAST} steps for random convolution kernels"),
        format!("{} steps", shape.steps),
    ))
}

fn save_kernels(weights: &mut Weights, name: &str, kernels: &Kernels) {
    put_indices(weights, &format!("{name}.dilations"), &kernels.dilations);
    put_indices(
        weights,
        &format!("{name}.biases_per_kernel"),
        &kernels.biases_per_kernel,
    );
    put(weights, &format!("{name}.biases"), kernels.biases.clone());
    save_lists(weights, name, &kernels.taxels);
}

/// - `taxels`: number of taxels of a sweep
pub(crate) fn load_kernels(
    weights: &Weights,
    name: &str,
    taxels: usize,
) -> Result<Kernels, PipelineError> {
    let indices = |part: &str| get_indices(weights, &format!("{name}.{part}"));
    Ok(Kernels {
        dilations: indices("dilations")?,
        biases_per_kernel: indices("biases_per_kernel")?,
        taxels: load_lists(weights, name, taxels)?,
        biases: get(weights, &format!("{name}.biases"))?.values.clone(),
    })
}

fn save_lists(weights: &mut Weights, name: &str, lists: &[Vec<usize>]) {
    let counts: Vec<usize> = lists.iter().map(Vec::len).collect();
    put_indices(weights, &format!("{name}.taxel_counts"), &counts);
    put_indices(weights, &format!("{name}.taxels"), &lists.concat());
}

/// - `taxels`: number of taxels of a sweep
pub(crate) fn load_lists(
    weights: &Weights,
    name: &str,
    taxels: usize,
) -> Result<Vec<Vec<usize>>, PipelineError> {
    let counts = get_indices(weights, &format!("{name}.taxel_counts"))?;
    let name = format!("{name}.taxels");
    let all = get_indices_below(weights, &name, taxels)?;
    of_length(&name, all.len(), counts.iter().sum())?;
    let mut rest = all.as_slice();
    Ok(counts
        .into_iter()
        .map(|count| {
            let (list, after) = rest.split_at(count);
            rest = after;
            list.to_vec()
        })
        .collect())
}
