//! Checkpoints: safetensors files with the weights, the optimiser's bytes as a `u8` tensor, and the position in the metadata.

use std::collections::BTreeMap;

use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use sha2::{Digest, Sha256};
use tactnet_data::hex;
use tactnet_models::{Weights, safetensors_bytes};

use crate::{PipelineError, Position, TrainingState};

const OPTIMIZER: &str = "optimizer.burnpack";

/// Returns the bytes of a checkpoint; `seconds` is the training time so far.
///
/// # Errors
/// A state that safetensors cannot store.
pub(crate) fn encode_checkpoint(
    state: &TrainingState,
    seconds: f64,
) -> Result<Vec<u8>, PipelineError> {
    let bytes: BTreeMap<&str, (Dtype, Vec<usize>, Vec<u8>)> = state
        .weights
        .0
        .iter()
        .map(|(name, tensor)| {
            let raw = tensor.values.iter().flat_map(|v| v.to_le_bytes()).collect();
            (name.as_str(), (Dtype::F32, tensor.shape.clone(), raw))
        })
        .chain([(
            OPTIMIZER,
            (
                Dtype::U8,
                vec![state.optimizer.len()],
                state.optimizer.clone(),
            ),
        )])
        .collect();
    let failed = |error: safetensors::SafeTensorError| PipelineError::Optimizer(error.to_string());
    let mut views = Vec::with_capacity(bytes.len());
    for (name, (dtype, shape, raw)) in &bytes {
        views.push((
            *name,
            TensorView::new(*dtype, shape.clone(), raw).map_err(failed)?,
        ));
    }
    let position = serde_json::to_string(&state.position)
        .map_err(|error| PipelineError::Optimizer(error.to_string()))?;
    let seconds = seconds.to_string();
    let metadata = [
        ("sha256".to_string(), digest(state, &position, &seconds)),
        ("position".to_string(), position),
        ("train_seconds".to_string(), seconds),
    ];
    safetensors_bytes(views, metadata).map_err(failed)
}

/// Returns the SHA-256 of everything that a restart uses, to detect damaged checkpoints.
fn digest(state: &TrainingState, position: &str, seconds: &str) -> String {
    let mut hash = Sha256::new();
    let mut add = |bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    add(position.as_bytes());
    add(seconds.as_bytes());
    for (name, tensor) in &state.weights.0 {
        add(name.as_bytes());
        for extent in &tensor.shape {
            add(&(*extent as u64).to_le_bytes());
        }
        let values: Vec<u8> = tensor.values.iter().flat_map(|v| v.to_le_bytes()).collect();
        add(&values);
    }
    add(&state.optimizer);
    hex(hash.finalize())
}

/// Parses the bytes of [`encode_checkpoint`]; also returns the training time in seconds.
///
/// # Errors
/// A sentence about the damage.
pub(crate) fn decode_checkpoint(bytes: &[u8]) -> Result<(TrainingState, f64), String> {
    let damaged = |what: &str| format!("not a tactnet checkpoint: {what}");
    let file = SafeTensors::deserialize(bytes).map_err(|error| damaged(&error.to_string()))?;
    let (_, header) =
        SafeTensors::read_metadata(bytes).map_err(|error| damaged(&error.to_string()))?;
    let metadata = header
        .metadata()
        .as_ref()
        .ok_or_else(|| damaged("no metadata"))?;
    let field = |name: &str| {
        metadata
            .get(name)
            .ok_or_else(|| damaged(&format!("no `{name}`")))
    };
    let (position_text, seconds_text) = (field("position")?, field("train_seconds")?);
    let position: Position =
        serde_json::from_str(position_text).map_err(|error| damaged(&error.to_string()))?;
    let seconds = seconds_text
        .parse()
        .map_err(|_| damaged("`train_seconds` is no number"))?;
    let optimizer = file
        .tensor(OPTIMIZER)
        .map_err(|error| damaged(&error.to_string()))?
        .data()
        .to_vec();
    let weights = Weights::from_safetensors(bytes).map_err(|error| damaged(&error.to_string()))?;
    let state = TrainingState {
        position,
        weights,
        optimizer,
    };
    // Checkpoints of earlier versions have no digest.
    if let Some(known) = metadata.get("sha256")
        && *known != digest(&state, position_text, seconds_text)
    {
        return Err(damaged("its SHA-256 is not the one that it names"));
    }
    Ok((state, seconds))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tactnet_models::NamedTensor;

    fn state() -> TrainingState {
        let tensor = NamedTensor {
            shape: vec![2, 2],
            values: vec![1.0, -0.1, f32::MIN_POSITIVE, 3e7],
        };
        TrainingState {
            position: Position {
                epoch: 3,
                batch: 7,
                loss_sum: 0.1 + 0.2,
                correct: 5,
                adversarial_correct: 0,
                sweeps: 9,
            },
            weights: Weights([("a".to_string(), tensor)].into()),
            optimizer: vec![1, 2, 255],
        }
    }

    #[test]
    fn checkpoint_round_trip_is_exact() {
        let bytes = encode_checkpoint(&state(), 1.25).unwrap();
        let (read, seconds) = decode_checkpoint(&bytes).unwrap();
        assert_eq!(read.position, state().position);
        assert_eq!(read.weights, state().weights);
        assert_eq!(read.optimizer, state().optimizer);
        assert_eq!(seconds, 1.25);
    }

    proptest! {
        #[test]
        fn damaged_checkpoints_are_errors_never_panics(at in any::<prop::sample::Index>(), value in any::<u8>(), cut in 0_usize..300) {
            let mut bytes = encode_checkpoint(&state(), 1.25).unwrap();
            let at = at.index(bytes.len());
            bytes[at] = value;
            if let Ok((read, seconds)) = decode_checkpoint(&bytes) {
                // Nothing changed except spaces in the header.
                prop_assert_eq!(read.weights, state().weights);
                prop_assert_eq!(read.optimizer, state().optimizer);
                prop_assert_eq!((read.position, seconds), (state().position, 1.25));
            }
            bytes.truncate(cut);
            let _ = decode_checkpoint(&bytes);
        }
    }
}
