//! The exported weights in candle, a second implementation of the same layers.

use candle_core::{D, Device, Tensor};
use candle_nn::ops::log_softmax;
use std::collections::HashMap;
use tactnet_data::SweepShape;

use super::{ExportedNetwork, RuntimeFailure};

/// Added to variances by batch normalisation.
const EPSILON: f64 = 1e-5;

/// The network, layer by layer.
pub struct Candle {
    shape: SweepShape,
    levels_removed: bool,
    offset: Tensor,
    gain: Tensor,
    blocks: Vec<Block>,
    hidden: Affine,
    output: Affine,
    /// `[mc_samples, features]`
    masks: Option<Tensor>,
}

/// Convolution with its batch normalisation folded in, and its pool.
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
    fn apply(&self, rows: &Tensor) -> candle_core::Result<Tensor> {
        rows.matmul(&self.weight)?.broadcast_add(&self.shift)
    }
}

/// Factor and summand of a batch normalisation with frozen statistics: `[maps]` each.
fn folded(
    tensors: &HashMap<String, Tensor>,
    layer: &str,
) -> Result<(Tensor, Tensor), RuntimeFailure> {
    let of = |what: &str| named(tensors, &format!("{layer}.{what}"));
    let scale = (of("gamma")? / (of("running_variance")? + EPSILON)?.sqrt()?)?;
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
    /// - `bytes`: a safetensors file as `tactnet export` writes it
    /// - `masks`: `[mc_samples][features]`; empty: plain prediction
    ///
    /// # Errors
    /// A file that is none of ours.
    pub fn new(bytes: &[u8], shape: SweepShape, masks: Vec<f32>) -> Result<Self, RuntimeFailure> {
        let (_, header) = safetensors::SafeTensors::read_metadata(bytes)?;
        let about = header.metadata().clone().unwrap_or_default();
        let property = |name: &str| {
            about
                .get(name)
                .ok_or_else(|| format!("no property `{name}`"))
        };
        let pools: Vec<usize> = serde_json::from_str(property("pools")?)?;
        let kernel: [usize; 2] = serde_json::from_str(property("kernel")?)?;
        let device = Device::Cpu;
        let tensors = candle_core::safetensors::load_buffer(bytes, &device)?;
        let blocks = pools
            .into_iter()
            .enumerate()
            .map(|(number, pool)| {
                let layer = format!("conv{}", number + 1);
                let (scale, shift) = folded(&tensors, &layer)?;
                let weight = named(&tensors, &format!("{layer}.weight"))?
                    .broadcast_mul(&scale.reshape(((), 1, 1, 1))?)?;
                Ok(Block {
                    weight,
                    shift: shift.reshape((1, (), 1, 1))?,
                    padding: [kernel[0] / 2, kernel[1] / 2],
                    pool,
                })
            })
            .collect::<Result<Vec<_>, RuntimeFailure>>()?;
        let (scale, shift) = folded(&tensors, "hidden")?;
        let hidden = Affine {
            weight: named(&tensors, "hidden.weight")?
                .broadcast_mul(&scale.unsqueeze(1)?)?
                .t()?
                .contiguous()?,
            shift,
        };
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
            blocks,
            hidden,
            output,
            masks,
        })
    }

    /// `[sweeps, features]`
    fn features(&self, digits: &[f32]) -> candle_core::Result<Tensor> {
        let sweeps = digits.len() / self.shape.values();
        let shape = (sweeps, self.shape.steps, self.shape.taxels());
        let mut maps = Tensor::from_slice(digits, shape, &Device::Cpu)?;
        if self.levels_removed {
            maps = maps.broadcast_sub(&maps.mean_keepdim(1)?)?;
        }
        maps = maps
            .broadcast_sub(&self.offset)?
            .broadcast_mul(&self.gain)?
            .unsqueeze(1)?;
        for block in &self.blocks {
            // Candle pads both axes alike.
            let [along, across] = block.padding;
            let padded = maps
                .pad_with_zeros(2, along, along)?
                .pad_with_zeros(3, across, across)?;
            let convolved = padded.conv2d(&block.weight, 0, 1, 1, 1)?;
            let rectified = convolved.broadcast_add(&block.shift)?.relu()?;
            // What is left at the end is a pool of its own; values are not negative.
            let steps = rectified.dim(2)?;
            let whole = steps.next_multiple_of(block.pool);
            maps = rectified
                .pad_with_zeros(2, 0, whole - steps)?
                .max_pool2d((block.pool, 1))?;
        }
        maps.flatten_from(1)
    }

    fn head(&self, features: &Tensor) -> candle_core::Result<Tensor> {
        let hidden = self.hidden.apply(features)?.relu()?;
        log_softmax(&self.output.apply(&hidden)?, D::Minus1)
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
