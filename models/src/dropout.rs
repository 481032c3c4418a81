//! Dropout masks from a generator of the caller.

use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;

/// Returns Bernoulli masks for inverted dropout, `[rows, features]`: `1 / keep_probability` with probability `keep_probability`, else 0.
///
/// Training, Monte Carlo prediction and all exported forms of the network use the same masks. In Monte Carlo prediction all sweeps share
/// the row of a sample, so that a row is one draw of the weights (Gal & Ghahramani, 2016).
///
/// # Panics
/// If `keep_probability` is not in `(0, 1]`.
pub fn dropout_masks(
    rows: usize,
    features: usize,
    keep_probability: f64,
    device: &Device,
    rng: &mut impl Rng,
) -> Tensor<2> {
    let kept = (1.0 / keep_probability) as f32;
    let mut keep = keeper(keep_probability);
    let values: Vec<f32> = (0..rows * features)
        .map(|_| if keep(rng) { kept } else { 0.0 })
        .collect();
    Tensor::from_data(TensorData::new(values, [rows, features]), device)
}

/// Writes the masks of [`dropout_masks`] as bits to `words`, `[rows][ceil(features / 32)]`; 1 keeps a feature, the lowest bit is the first.
///
/// # Panics
/// If `keep_probability` is not in `(0, 1]`.
pub fn dropout_bits(words: &mut [u32], features: usize, keep_probability: f64, rng: &mut impl Rng) {
    const BITS: usize = u32::BITS as usize;
    let mut keep = keeper(keep_probability);
    for row in words.chunks_exact_mut(features.div_ceil(BITS)) {
        row.fill(0);
        for feature in 0..features {
            row[feature / BITS] |= u32::from(keep(rng)) << (feature % BITS);
        }
    }
}

/// Returns a function that draws true if a feature is kept.
fn keeper<R: Rng>(keep_probability: f64) -> impl FnMut(&mut R) -> bool {
    assert!(
        keep_probability > 0.0 && keep_probability <= 1.0,
        "keep probability {keep_probability} is not in (0, 1]"
    );
    let threshold = (keep_probability * (f64::from(u32::MAX) + 1.0)).round() as u64;
    move |rng| u64::from(rng.next_u32()) < threshold
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn bits_are_those_of_the_masks() {
        let rng = || rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let (rows, features) = (3, 70);
        let masks: Vec<f32> = dropout_masks(rows, features, 0.8, &Device::flex(), &mut rng())
            .into_data()
            .try_to_vec()
            .unwrap();
        let mut words = vec![u32::MAX; rows * 3];
        dropout_bits(&mut words, features, 0.8, &mut rng());
        for (row, mask) in masks.chunks(features).enumerate() {
            for (feature, value) in mask.iter().enumerate() {
                let bit = words[row * 3 + feature / 32] >> (feature % 32) & 1;
                assert_eq!(bit == 1, *value != 0.0, "{row} {feature}");
            }
        }
        assert_eq!(words[2] >> 6, 0, "no feature");
    }

    #[test]
    fn masks_keep_the_stated_share_and_the_mean() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let device = Device::flex();
        let values: Vec<f32> = dropout_masks(100, 2048, 0.8, &device, &mut rng)
            .into_data()
            .try_to_vec()
            .unwrap();
        let kept = values.iter().filter(|v| **v != 0.0).count() as f64 / values.len() as f64;
        let deviation = (0.8_f64 * 0.2 / values.len() as f64).sqrt();
        assert!((kept - 0.8).abs() < 4.0 * deviation, "kept {kept}");
        assert!(values.iter().all(|v| *v == 0.0 || *v == 1.25));
        let all: Vec<f32> = dropout_masks(2, 50, 1.0, &device, &mut rng)
            .into_data()
            .try_to_vec()
            .unwrap();
        assert!(
            all.iter().all(|v| *v == 1.0),
            "keep probability 1 drops nothing"
        );
    }
}
