//! Feature extraction from the spectra of short windows.
//!
//! ```text
//! sweeps [batch, steps, taxels] ─> log spectra [batch, windows, taxels, bands + 1]
//!    ─> Dense for each taxel, shared weights [batch, windows, taxels, taxel units]
//!    ─> Dense over all taxels of a window [batch, windows, units]
//!    ─> mean and deviation over windows [batch, 2 x units]
//! ```

use std::sync::Arc;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::block::BatchStatistics;
use crate::dense::NormalizedDense;
use crate::log_spectra::LogSpectra;
use crate::log_spectra_op::log_spectra;
use crate::spectral_shape::SpectralShape;

/// Added to the variance over windows before the square root, which bounds its gradient.
pub const DEVIATION_EPSILON: f64 = 1e-5;

/// Layers on sweeps `[batch, steps, taxels]`.
#[derive(Module, Debug)]
pub struct SpectralTrunk {
    pub(crate) taxel: NormalizedDense,
    pub(crate) window: NormalizedDense,
    #[module(skip)]
    pub(crate) spectra: Arc<LogSpectra>,
}

impl SpectralTrunk {
    /// Creates layers with random weights; each layer takes its first id from `next_id`.
    pub(crate) fn init(
        shape: &SpectralShape,
        mut next_id: impl FnMut() -> u64,
        device: &Device,
        rng: &mut impl Rng,
    ) -> Self {
        let (of_taxel, units) = (shape.taxel_units, shape.units);
        let taxel = NormalizedDense::init(shape.values(), of_taxel, next_id(), device, rng);
        let inputs = shape.taxels * of_taxel;
        let window = NormalizedDense::init(inputs, units, next_id(), device, rng);
        let spectra = LogSpectra::new(shape.window, shape.hop, shape.bands, shape.taxels);
        Self {
            taxel,
            window,
            spectra: Arc::new(spectra),
        }
    }

    /// Returns features `[batch, 2 x units]` with batch statistics, which it appends to `statistics`.
    pub(crate) fn forward_train(
        &self,
        sweeps: Tensor<3>,
        statistics: &mut Vec<BatchStatistics>,
    ) -> Tensor<2> {
        self.pass(sweeps, |layer, rows| {
            let (rows, batch) = layer.forward_train(rows);
            statistics.push(batch);
            rows
        })
    }

    /// Returns features with fixed statistics.
    pub(crate) fn forward(&self, sweeps: Tensor<3>) -> Tensor<2> {
        self.pass(sweeps, |layer, rows| layer.forward(rows))
    }

    /// Returns the batch statistics of a layer; the others use their running statistics.
    pub(crate) fn statistics_of(&self, layer: usize, sweeps: Tensor<3>) -> BatchStatistics {
        let (mut number, mut found) = (0, None);
        self.pass(sweeps, |dense, rows| {
            number += 1;
            if number != layer + 1 {
                return dense.forward(rows);
            }
            let (rows, statistics) = dense.forward_train(rows);
            found = Some(statistics);
            rows
        });
        found.unwrap_or_else(|| panic!("a trunk on spectra has a layer {layer}"))
    }

    fn pass(
        &self,
        sweeps: Tensor<3>,
        mut through: impl FnMut(&NormalizedDense, Tensor<2>) -> Tensor<2>,
    ) -> Tensor<2> {
        let spectra = log_spectra(sweeps, &self.spectra);
        let [batch, windows, taxels, values] = spectra.dims();
        let of_taxels = through(
            &self.taxel,
            spectra.reshape([batch * windows * taxels, values]),
        );
        let inputs = taxels * of_taxels.dims()[1];
        let of_windows = through(&self.window, of_taxels.reshape([batch * windows, inputs]));
        let units = of_windows.dims()[1];
        moments(of_windows.reshape([batch, windows, units]))
    }

    /// Returns the layers with their names, in the order of their statistics.
    pub(crate) fn layers_mut(&mut self) -> [(&'static str, &mut NormalizedDense); 2] {
        [("taxel", &mut self.taxel), ("window", &mut self.window)]
    }

    /// Returns the number of layers with running statistics.
    pub(crate) fn normalized_layers(&self) -> usize {
        [&self.taxel, &self.window].len()
    }

    /// - `statistics`: one entry for each layer
    pub(crate) fn update_running_stats(&mut self, statistics: &[BatchStatistics]) {
        for ((_, layer), batch) in self.layers_mut().into_iter().zip(statistics) {
            layer.update_running_stats(batch);
        }
    }
}

/// Returns mean and deviation over the middle axis: `[batch, windows, units] -> [batch, 2 x units]`.
fn moments(values: Tensor<3>) -> Tensor<2> {
    let mean = values.clone().mean_dim(1);
    let centred = values - mean.clone();
    let variance = (centred.clone() * centred).mean_dim(1);
    let deviation = variance.add_scalar(DEVIATION_EPSILON).sqrt();
    Tensor::cat(vec![mean, deviation], 2).squeeze_dim(1)
}
