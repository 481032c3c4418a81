//! Named arrays of fitted baselines, stored as `f32` tensors.

use tactnet_models::{ModelError, NamedTensor, Weights};

use crate::PipelineError;

/// Bound below which all whole numbers are exact as `f32`.
const LARGEST_INDEX: usize = 1 << 24;

/// Stores a vector.
pub(crate) fn put(weights: &mut Weights, name: &str, values: Vec<f32>) {
    let shape = vec![values.len()];
    weights.0.insert(name.into(), NamedTensor { shape, values });
}

/// Stores small whole numbers as `f32`.
///
/// # Panics
/// If one is not exact as `f32`.
pub(crate) fn put_indices(weights: &mut Weights, name: &str, indices: &[usize]) {
    let exact = |index: &usize| {
        assert!(*index < LARGEST_INDEX, "{name}: {index} is exact as f32");
        *index as f32
    };
    put(weights, name, indices.iter().map(exact).collect());
}

/// Stores double-precision numbers, each as a sum of two `f32`.
pub(crate) fn put_doubles(weights: &mut Weights, name: &str, values: &[f64]) {
    let high: Vec<f32> = values.iter().map(|v| *v as f32).collect();
    let low = values
        .iter()
        .zip(&high)
        .map(|(v, h)| (v - f64::from(*h)) as f32);
    let all = high.iter().copied().chain(low).collect();
    let shape = vec![2, values.len()];
    weights
        .0
        .insert(name.into(), NamedTensor { shape, values: all });
}

/// Returns a stored array.
///
/// # Errors
/// A missing array.
pub(crate) fn get<'a>(weights: &'a Weights, name: &str) -> Result<&'a NamedTensor, PipelineError> {
    weights.0.get(name).ok_or_else(|| {
        PipelineError::Model(ModelError::Weights {
            tensor: name.into(),
            expected: "an array of this model".into(),
            found: "none".into(),
        })
    })
}

/// Returns stored whole numbers.
///
/// # Errors
/// A missing array; a number that [`put_indices`] cannot have written.
pub(crate) fn get_indices(weights: &Weights, name: &str) -> Result<Vec<usize>, PipelineError> {
    get_indices_below(weights, name, LARGEST_INDEX)
}

/// Returns stored whole numbers below a limit.
///
/// # Errors
/// A missing array; a number that is fractional or too large.
pub(crate) fn get_indices_below(
    weights: &Weights,
    name: &str,
    limit: usize,
) -> Result<Vec<usize>, PipelineError> {
    let whole = |value: &f32| {
        let index = *value as usize;
        if index as f32 == *value && index < limit {
            return Ok(index);
        }
        Err(PipelineError::Model(ModelError::Weights {
            tensor: name.into(),
            expected: format!("whole numbers below {limit}"),
            found: value.to_string(),
        }))
    };
    get(weights, name)?.values.iter().map(whole).collect()
}

/// Returns stored double-precision numbers, accurate to about 48 bits.
///
/// # Errors
/// A missing array.
pub(crate) fn get_doubles(weights: &Weights, name: &str) -> Result<Vec<f64>, PipelineError> {
    let values = &get(weights, name)?.values;
    let (high, low) = values.split_at(values.len() / 2);
    Ok(high
        .iter()
        .zip(low)
        .map(|(h, l)| f64::from(*h) + f64::from(*l))
        .collect())
}

/// Succeeds if an array has the expected length.
///
/// # Errors
/// Another length.
pub(crate) fn of_length(name: &str, found: usize, expected: usize) -> Result<(), PipelineError> {
    if found == expected {
        return Ok(());
    }
    Err(PipelineError::Model(ModelError::Weights {
        tensor: name.into(),
        expected: format!("{expected} numbers"),
        found: found.to_string(),
    }))
}
