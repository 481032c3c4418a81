//! A classifier as a safetensors file: weights and scaling by name.

use std::collections::BTreeMap;

use tactnet_models::{NamedTensor, Weights};

use super::properties::{network_setup, properties};
use crate::{Calibration, ClassifierConfig, PipelineError};

/// The bytes of a safetensors file with weights and scaling: the tensors of a run directory, `input.offset` and `input.gain` `[taxels]`, and
/// the same properties as an ONNX file.
///
/// # Errors
/// A classifier that is no network.
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
    let mut about = properties(config, setup, calibration, about);
    about.extend([
        (
            "kernel".to_owned(),
            serde_json::json!(network.architecture().kernel).to_string(),
        ),
        (
            "pools".into(),
            serde_json::json!(network.pools()).to_string(),
        ),
    ]);
    Ok(weights.to_safetensors(about)?)
}
