//! Pixel noise.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::stream::Stream;

/// Size of the noise table. Each row of each picture starts at a random index.
const TABLE: usize = 1 << 18;

/// Normally distributed noise from a table.
#[derive(Debug, Clone)]
pub(super) struct Noise {
    /// The table twice in a row, so that no row wraps around.
    table: std::sync::Arc<[f32]>,
}

impl Noise {
    /// - `deviation`: standard deviation in grey levels
    pub(super) fn new(deviation: f64, seed: u64) -> Self {
        let mut rng = Stream::PictureNoise.rng(seed, u64::MAX);
        let once: Vec<f32> = (0..TABLE)
            .map(|_| {
                let normal: f64 = StandardNormal.sample(&mut rng);
                (normal * deviation) as f32
            })
            .collect();
        let table = [once.as_slice(), once.as_slice()].concat();
        Self {
            table: table.into(),
        }
    }

    /// Writes a row of brightness with noise, in grey levels.
    pub(super) fn add(&self, row: &[f32], pixels: &mut [u8], rng: &mut ChaCha8Rng) {
        let from = (rng.random::<f64>() * TABLE as f64) as usize % TABLE;
        for (start, (row, pixels)) in row.chunks(TABLE).zip(pixels.chunks_mut(TABLE)).enumerate() {
            let from = (from + start) % TABLE;
            let noise = &self.table[from..from + row.len()];
            for ((pixel, value), noise) in pixels.iter_mut().zip(row).zip(noise) {
                // The cast saturates.
                *pixel = (value + noise + 0.5) as u8;
            }
        }
    }
}
