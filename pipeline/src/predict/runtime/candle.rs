//! Exported weights in candle, as a second implementation of the same layers.

use candle_core::{D, Device, Tensor};
use candle_nn::ops::log_softmax;
use std::collections::HashMap;
use tactnet_data::SweepShape;
use tactnet_models::{DEVIATION_EPSILON, ENERGY_FLOOR, LOG_GAIN, LOG_OFFSET, NORM_EPSILON};

use super::{ExportedNetwork, RuntimeFailure};

/// Network, layer by layer.
pub struct Candle {
    shape: SweepShape,
    levels_removed: bool,
    offset: Tensor,
    gain: Tensor,
    trunk: Trunk,
    hidden: Affine,
    output: Affine,
    /// `[mc_samples, features]`
    masks: Option<Tensor>,
}

/// Layers that compute features of scaled sweeps.
enum Trunk {
    Convolutions(Vec<Block>),
    Spectra(Box<Spectra>),
}

/// Convolution with folded batch normalisation, and its pooling.
struct Block {
    weight: Tensor,
    shift: Tensor,
    padding: [usize; 2],
    pool: usize,
}

struct Affine {
    /// `[inputs, outputs]`
    weight: Tensor,
    /// `[outputs]`
    shift: Tensor,
}

impl Affine {
    /// Returns a dense layer with folded batch normalisation.
    fn folded(tensors: &HashMap<String, Tensor>, layer: &str) -> Result<Self, RuntimeFailure> {
        let (scale, shift) = folded(tensors, layer)?;
        let weight = named(tensors, &format!("{layer}.weight"))?
            .broadcast_mul(&scale.unsqueeze(1)?)?
            .t()?
            .contiguous()?;
        Ok(Self { weight, shift })
    }

    fn apply(&self, rows: &Tensor) -> candle_core::Result<Tensor> {
        rows.matmul(&self.weight)?.broadcast_add(&self.shift)
    }
}

/// Returns factor and summand of a batch normalisation with frozen statistics, `[maps]` each.
fn folded(
    tensors: &HashMap<String, Tensor>,
    layer: &str,
) -> Result<(Tensor, Tensor), RuntimeFailure> {
    let of = |what: &str| named(tensors, &format!("{layer}.{what}"));
    let scale = (of("gamma")? / (of("running_variance")? + NORM_EPSILON)?.sqrt()?)?;
    let shift = (of("beta")? - (of("running_mean")? * &scale)?)?;
    Ok((scale, shift))
}

fn named(tensors: &HashMap<String, Tensor>, name: &str) -> Result<Tensor, RuntimeFailure> {
    tensors
        .get(name)
        .cloned()
        .ok_or_else(|| format!("no tensor `{name}`").into())
}

impl Candle {
    /// - `bytes`: exported safetensors file
    /// - `masks`: `[mc_samples][features]`; empty: plain prediction
    ///
    /// # Errors
    /// A file in another format.
    pub fn new(bytes: &[u8], shape: SweepShape, masks: Vec<f32>) -> Result<Self, RuntimeFailure> {
        let (_, header) = safetensors::SafeTensors::read_metadata(bytes)?;
        let about = header.metadata().clone().unwrap_or_default();
        let property = |name: &str| {
            about
                .get(name)
                .ok_or_else(|| format!("no property `{name}`"))
        };
        let device = Device::Cpu;
        let tensors = candle_core::safetensors::load_buffer(bytes, &device)?;
        let trunk = if about.contains_key("hop") {
            let hop = serde_json::from_str(property("hop")?)?;
            Trunk::Spectra(Box::new(Spectra::new(&tensors, hop)?))
        } else {
            let pools: Vec<usize> = serde_json::from_str(property("pools")?)?;
            let kernel: [usize; 2] = serde_json::from_str(property("kernel")?)?;
            Trunk::Convolutions(blocks(&tensors, &pools, kernel)?)
        };
        let hidden = Affine::folded(&tensors, "hidden")?;
        let output = Affine {
            weight: named(&tensors, "output.weight")?.t()?.contiguous()?,
            shift: named(&tensors, "output.bias")?,
        };
        let features = hidden.weight.dim(0)?;
        let masks = match masks.len() {
            0 => None,
            values if values % features == 0 => Some(Tensor::from_vec(
                masks,
                (values / features, features),
                &device,
            )?),
            values => {
                return Err(format!("{values} values of masks for {features} features").into());
            }
        };
        Ok(Self {
            shape,
            levels_removed: property("levels")? == "removed",
            offset: named(&tensors, "input.offset")?,
            gain: named(&tensors, "input.gain")?,
            trunk,
            hidden,
            output,
            masks,
        })
    }

    /// Returns features `[sweeps, features]`.
    fn features(&self, digits: &[f32]) -> candle_core::Result<Tensor> {
        let sweeps = digits.len() / self.shape.values();
        let shape = (sweeps, self.shape.steps, self.shape.taxels());
        let mut maps = Tensor::from_slice(digits, shape, &Device::Cpu)?;
        if self.levels_removed {
            maps = maps.broadcast_sub(&maps.mean_keepdim(1)?)?;
        }
        maps = maps
            .broadcast_sub(&self.offset)?
            .broadcast_mul(&self.gain)?;
        match &self.trunk {
            Trunk::Convolutions(blocks) => convolved(maps, blocks),
            Trunk::Spectra(spectra) => spectra.features(&maps),
        }
    }

    fn head(&self, features: &Tensor) -> candle_core::Result<Tensor> {
        let hidden = self.hidden.apply(features)?.relu()?;
        log_softmax(&self.output.apply(&hidden)?, D::Minus1)
    }
}

/// - `sweeps`: `[sweeps, steps, taxels]`
fn convolved(sweeps: Tensor, blocks: &[Block]) -> candle_core::Result<Tensor> {
    let mut maps = sweeps.unsqueeze(1)?;
    for block in blocks {
        // Candle pads both axes by the same amount.
        let [along, across] = block.padding;
        let padded = maps
            .pad_with_zeros(2, along, along)?
            .pad_with_zeros(3, across, across)?;
        let convolved = padded.conv2d(&block.weight, 0, 1, 1, 1)?;
        let rectified = convolved.broadcast_add(&block.shift)?.relu()?;
        // The remaining steps form a last, shorter window. Zeros do not change a maximum of rectified values.
        let steps = rectified.dim(2)?;
        let whole = steps.next_multiple_of(block.pool);
        maps = rectified
            .pad_with_zeros(2, 0, whole - steps)?
            .max_pool2d((block.pool, 1))?;
    }
    maps.flatten_from(1)
}

fn blocks(
    tensors: &HashMap<String, Tensor>,
    pools: &[usize],
    kernel: [usize; 2],
) -> Result<Vec<Block>, RuntimeFailure> {
    let block = |(number, pool): (usize, &usize)| {
        let layer = format!("conv{}", number + 1);
        let (scale, shift) = folded(tensors, &layer)?;
        let weight = named(tensors, &format!("{layer}.weight"))?
            .broadcast_mul(&scale.reshape(((), 1, 1, 1))?)?;
        Ok(Block {
            weight,
            shift: shift.reshape((1, (), 1, 1))?,
            padding: [kernel[0] / 2, kernel[1] / 2],
            pool: *pool,
        })
    };
    pools.iter().enumerate().map(block).collect()
}

/// Spectra of windows and the layers after them.
struct Spectra {
    /// `[2 x bins, 1, window]`
    fourier: Tensor,
    /// `[bands, bins]`
    bands: Tensor,
    /// `[1, 1, window]`
    average: Tensor,
    hop: usize,
    taxel: Affine,
    window: Affine,
}

impl Spectra {
    fn new(tensors: &HashMap<String, Tensor>, hop: usize) -> Result<Self, RuntimeFailure> {
        let fourier = named(tensors, "spectra.fourier")?.unsqueeze(1)?;
        let window = fourier.dim(2)?;
        let average = Tensor::full(1.0 / window as f32, (1, 1, window), &Device::Cpu)?;
        Ok(Self {
            fourier,
            bands: named(tensors, "spectra.bands")?,
            average,
            hop,
            taxel: Affine::folded(tensors, "taxel")?,
            window: Affine::folded(tensors, "window")?,
        })
    }

    /// Returns features `[sweeps, 2 x units]` of scaled sweeps `[sweeps, steps, taxels]`.
    fn features(&self, scaled: &Tensor) -> candle_core::Result<Tensor> {
        let (sweeps, steps, taxels) = scaled.dims3()?;
        let traces = scaled
            .transpose(1, 2)?
            .reshape((sweeps * taxels, 1, steps))?;
        let parts = traces.conv1d(&self.fourier, 0, self.hop, 1, 1)?;
        let (bins, windows) = (parts.dim(1)? / 2, parts.dim(2)?);
        let squares = parts.sqr()?;
        let powers = (squares.narrow(1, 0, bins)? + squares.narrow(1, bins, bins)?)?;
        // [traces, windows, bands]
        let energies = powers
            .transpose(1, 2)?
            .contiguous()?
            .reshape((sweeps * taxels * windows, bins))?
            .matmul(&self.bands.t()?)?;
        let logarithms = (energies + f64::from(ENERGY_FLOOR))?
            .log()?
            .affine(f64::from(LOG_GAIN), f64::from(LOG_OFFSET))?;
        let means = traces
            .conv1d(&self.average, 0, self.hop, 1, 1)?
            .reshape((sweeps * taxels * windows, 1))?;
        let spectra = Tensor::cat(&[logarithms, means], 1)?;
        let of_taxels = self.taxel.apply(&spectra)?.relu()?;
        let units = of_taxels.dim(1)?;
        let of_windows = of_taxels
            .reshape((sweeps, taxels, windows, units))?
            .transpose(1, 2)?
            .contiguous()?
            .reshape((sweeps * windows, taxels * units))?;
        let of_windows = self.window.apply(&of_windows)?.relu()?;
        let units = of_windows.dim(1)?;
        let of_windows = of_windows.reshape((sweeps, windows, units))?;
        let mean = of_windows.mean_keepdim(1)?;
        let variance = of_windows.broadcast_sub(&mean)?.sqr()?.mean_keepdim(1)?;
        let deviation = (variance + DEVIATION_EPSILON)?.sqrt()?;
        Tensor::cat(&[mean, deviation], 2)?.squeeze(1)
    }
}

impl ExportedNetwork for Candle {
    fn score(&mut self, digits: &[f32]) -> Result<Vec<f64>, RuntimeFailure> {
        let features = self.features(digits)?;
        let scores = match &self.masks {
            None => self.head(&features)?,
            Some(masks) => {
                let rows = (0..features.dim(0)?)
                    .map(|sweep| {
                        let dropped = masks.broadcast_mul(&features.narrow(0, sweep, 1)?)?;
                        let mc_samples = self.head(&dropped)?;
                        mc_samples
                            .log_sum_exp(0)?
                            .affine(1.0, -(masks.dim(0)? as f64).ln())
                    })
                    .collect::<candle_core::Result<Vec<_>>>()?;
                Tensor::stack(&rows, 0)?
            }
        };
        let scores: Vec<f32> = scores.flatten_all()?.to_vec1()?;
        Ok(scores.into_iter().map(f64::from).collect())
    }
}
