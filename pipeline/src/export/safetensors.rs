//! Export of a network as a safetensors file: weights and scaling by name.

use std::collections::BTreeMap;

use tactnet_models::{NamedTensor, Weights};

use super::properties::{network_setup, properties};
use crate::{Calibration, ClassifierConfig, PipelineError};

/// Returns the bytes of a safetensors file with weights and scaling.
///
/// It holds the tensors of a run directory and `input.offset` and `input.gain`, `[taxels]`. A spectral network adds `spectra.fourier` and
/// `spectra.bands` (see [`tactnet_models::SpectralTables`]). The properties are those of an ONNX file.
///
/// # Errors
/// A classifier that is not a network.
pub fn to_safetensors(
    config: &ClassifierConfig,
    weights: &Weights,
    calibration: Option<&Calibration>,
    about: &BTreeMap<String, String>,
) -> Result<Vec<u8>, PipelineError> {
    let setup = network_setup(config)?;
    let mut weights = weights.clone();
    for (name, values) in [
        ("input.offset", setup.normalizer.offset()),
        ("input.gain", setup.normalizer.gain()),
    ] {
        let tensor = NamedTensor {
            shape: vec![values.len()],
            values: values.to_vec(),
        };
        weights.0.insert(name.into(), tensor);
    }
    let network = config.network_config(setup)?;
    let mut about = properties(config, calibration, about);
    let json = |value: serde_json::Value| value.to_string();
    if let Some((kernel, pools)) = network.convolutions() {
        about.insert("kernel".into(), json(kernel.into()));
        about.insert("pools".into(), json(pools.into()));
    }
    if let Some(spectra) = network.spectra() {
        let tables = spectra.tables();
        let mut put = |name: &str, shape: [usize; 2], values| {
            let shape = shape.to_vec();
            weights.0.insert(name.into(), NamedTensor { shape, values });
        };
        let (window, bins) = (spectra.window(), tables.bins);
        put("spectra.fourier", [2 * bins, window], tables.fourier);
        put("spectra.bands", [spectra.bands(), bins], tables.bands);
        about.insert("window".into(), json(spectra.window().into()));
        about.insert("hop".into(), json(spectra.hop().into()));
    }
    Ok(weights.to_safetensors(about)?)
}
