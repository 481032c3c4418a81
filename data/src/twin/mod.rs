//! The TactMat twin: seeded sweeps that look like TactMat's where its signal is known.
//!
//! The real recordings cannot ship with the project. The twin is calibrated on four published sweeps (the figures are
//! in [`statistics`]) and on the published confusion matrix ([`published_confusions`]); what it says beyond them is a
//! prediction, and results on it are results on the twin, never on TactMat.
//!
//! # Signal
//! Taxel `i` reads at step `t`, with `u` the steps since that taxel started to slip (0 before):
//!
//! ```text
//! x_i = round(L_i (1 + m_i (f + q_i + p_i)) + n_i)   0 where below 3, at most 154
//! L_i = S_i + (O_i - S_i) w_i                        level: rest O, sliding S
//! w_i = 0.45 exp(-u / 12 s) + 0.55 exp(-u / 400 s)   slip, fast and slow; s is the material's
//! m_i = 1 - exp(-u / 8)                              texture sets in
//! q_i = g_i sum_b a_b OU(tau_b / v)                  texture: four Ornstein-Uhlenbeck processes of unit variance
//! f   = 0.012 OU(60)                                 force, common to all taxels
//! p_i = r sin(2 pi (v t 0.04 mm - y_i) / pitch)      ridges across the stroke, for three materials
//! n_i : variance 0.057^2 + c L_i                     sensor noise and fine grain
//! ```
//!
//! `O` and `S` are the published mean levels times log-normal factors: per taxel, a common force, and a tilt of the
//! patch, some of it drawn per block of ten sweeps and the rest per sweep. They swamp what materials do to the levels. `v`
//! is the speed of the stroke (3 cm/s +-3 %), `y_i` the taxel's row times 2.5 mm.
//!
//! # Materials
//! The published confusions become points `z` in a six-dimensional latent space (see `embedding.rs`), where one unit is
//! the standard deviation of a class that is confused as published. A sweep has its own point
//!
//! ```text
//! z_sweep = z_material / difficulty + 0.35 e_block + 0.65 e_sweep      e: standard normal in six dimensions
//! ```
//!
//! and an orthonormal mixture of its coordinates sets the logarithms of the texture's undulation (`a_1`), coarse
//! (`a_2`) and fine bands (`a_4`, `c`), its correlation times, and how `g_i` changes along rows and columns; the medium band
//! (`a_3`), the slip ratio, `s` and the column levels follow weakly. Static levels tell little about a material.
//!
//! # Difficulty
//! [`TwinConfig::difficulty`] divides the distances between the materials' points and touches nothing else: neither the
//! variability of one material nor the random streams. 2 halves every difference between materials. The figures of
//! [`statistics`] are fitted at 1; at 0.8 the wider spread of textures already takes the standard deviation of the steps
//! out of its tolerance.

mod embedding;
mod gaussian;
mod materials;
mod signal;
mod spectra;
pub mod statistics;

pub use embedding::published_confusions;
pub use materials::NAMES;

use crate::{DataError, Dataset, LabelSet, Samples, Seed, SweepRecord, SweepShape};
use embedding::Latent;
use gaussian::normal;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use signal::{Contact, Drift, SAMPLE_RATE_HZ, TAXELS};

/// Sweeps of one material that are recorded in one go.
pub const SWEEPS_PER_BLOCK: usize = 10;

/// Standard deviation, in latent units, that a block adds to its material's point.
const BLOCK_WANDER: f64 = 0.35;
/// The same of a sweep within its block.
const SWEEP_WANDER: f64 = 0.65;

/// How large a twin, how hard, and which one; `Default` is TactMat's size.
///
/// Sweeps have their own random streams, so a smaller twin of the same seed is a part of the larger one: the first
/// materials, the first sweeps of each, the first steps of each sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TwinConfig {
    /// Materials, the first of [`NAMES`]: 1 to 36.
    pub materials: usize,
    /// Sweeps of each material, in blocks of [`SWEEPS_PER_BLOCK`].
    pub sweeps: usize,
    /// Time steps of a sweep, at 750 Hz.
    pub steps: usize,
    /// Decides every random number of the sweeps; the materials are the same for every seed.
    pub seed: u64,
    /// Divides the distances between materials in the latent space: larger is harder.
    pub difficulty: f64,
}

impl Default for TwinConfig {
    fn default() -> Self {
        Self {
            materials: NAMES.len(),
            sweeps: 100,
            steps: 1000,
            seed: 1,
            difficulty: 1.0,
        }
    }
}

impl TwinConfig {
    fn check(&self) -> Result<(), DataError> {
        let wrong = |item: &str, expected: &str, found: String| {
            Err(DataError::inconsistent(item, expected, found))
        };
        if !(1..=NAMES.len()).contains(&self.materials) {
            return wrong("twin materials", "1 to 36", self.materials.to_string());
        }
        if self.sweeps == 0 {
            return wrong("twin sweeps", "at least 1", "0".into());
        }
        if self.steps == 0 {
            return wrong("twin steps", "at least 1", "0".into());
        }
        if !(self.difficulty.is_finite() && self.difficulty > 0.0) {
            return wrong(
                "twin difficulty",
                "a positive number",
                self.difficulty.to_string(),
            );
        }
        Ok(())
    }
}

/// Generates the twin: `u8` digits of 4x4 taxels at 750 Hz, ordered by material and then by sweep, called "twin".
///
/// The block of a sweep is its number divided by [`SWEEPS_PER_BLOCK`]; materials have drifts of their own in a block of
/// the same number. No test split is given. The values depend on `config` alone, not on the number of threads. The full
/// size takes about two seconds of one core and 58 MB.
///
/// # Errors
/// More materials than there are names, nothing to generate, or a difficulty that is not a positive number.
pub fn generate(config: &TwinConfig) -> Result<Dataset, DataError> {
    config.check()?;
    let shape = SweepShape {
        steps: config.steps,
        rows: 4,
        cols: TAXELS / 4,
    };
    let materials = embedding::embed();
    let place = |index: usize| (index / config.sweeps, index % config.sweeps);
    let mut digits = vec![0u8; config.materials * config.sweeps * shape.values()];
    digits
        .par_chunks_mut(shape.values())
        .enumerate()
        .for_each(|(index, out)| {
            let (label, sweep) = place(index);
            generate_sweep(config, label, &materials[label], sweep, out);
        });
    let records = (0..config.materials * config.sweeps)
        .map(|index| {
            let (label, sweep) = place(index);
            SweepRecord {
                label,
                sweep,
                block: Some((sweep / SWEEPS_PER_BLOCK) as u32),
                test: None,
            }
        })
        .collect();
    let labels = LabelSet::new(NAMES[..config.materials].iter().copied())?;
    Dataset::new(
        "twin",
        SAMPLE_RATE_HZ,
        shape,
        labels,
        records,
        Samples::U8(digits),
    )
    .map(Dataset::into_synthetic)
}

fn generate_sweep(
    config: &TwinConfig,
    label: usize,
    material: &Latent,
    sweep: usize,
    out: &mut [u8],
) {
    let seed = Seed(config.seed);
    let mut block_rng = seed.rng(("twin-block", label, sweep / SWEEPS_PER_BLOCK));
    let mut rng = seed.rng(("twin-sweep", label, sweep));
    let drift = Drift::draw(&mut block_rng);
    let contact = Contact::draw(&drift, &mut rng);
    let latent: Latent = std::array::from_fn(|axis| {
        material[axis] / config.difficulty
            + BLOCK_WANDER * normal(&mut block_rng)
            + SWEEP_WANDER * normal(&mut rng)
    });
    signal::record(&materials::surface(label, &latent), &contact, &mut rng, out);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn digits(dataset: &Dataset) -> &[u8] {
        match dataset.samples() {
            Samples::U8(digits) => digits,
            other => panic!("the twin is u8, not {}", other.element()),
        }
    }

    #[test]
    fn smaller_twin_is_a_part_of_the_larger_one() {
        let large = TwinConfig {
            materials: 3,
            sweeps: 13,
            steps: 120,
            seed: 5,
            ..TwinConfig::default()
        };
        let small = TwinConfig {
            materials: 2,
            sweeps: 12,
            steps: 70,
            ..large.clone()
        };
        let (large, small) = (generate(&large).unwrap(), generate(&small).unwrap());
        for label in 0..2 {
            for sweep in 0..12 {
                let whole = large.sweep(label * 13 + sweep);
                assert_eq!(small.sweep(label * 12 + sweep), whole[..70 * TAXELS]);
            }
        }
    }

    #[test]
    fn values_do_not_depend_on_the_number_of_threads() {
        let config = TwinConfig {
            materials: 4,
            sweeps: 3,
            steps: 50,
            ..TwinConfig::default()
        };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| generate(&config).unwrap().sha256().to_owned())
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn seed_decides_the_sweeps() {
        let config = TwinConfig {
            materials: 2,
            sweeps: 2,
            steps: 50,
            ..TwinConfig::default()
        };
        let other = TwinConfig {
            seed: 2,
            ..config.clone()
        };
        assert_ne!(
            digits(&generate(&config).unwrap()),
            digits(&generate(&other).unwrap())
        );
    }

    #[test]
    fn records_say_material_sweep_and_block() {
        let config = TwinConfig {
            materials: 2,
            sweeps: 11,
            steps: 5,
            ..TwinConfig::default()
        };
        let twin = generate(&config).unwrap();
        assert_eq!(
            (twin.name(), twin.sample_rate_hz(), twin.len()),
            ("twin", 750.0, 22)
        );
        assert_eq!(
            twin.records()[21],
            SweepRecord {
                label: 1,
                sweep: 10,
                block: Some(1),
                test: None
            }
        );
        assert_eq!(twin.labels().name(1), "synthetic leather smooth reverse");
    }

    #[test]
    fn impossible_configs_are_refused_by_name() {
        let good = TwinConfig {
            materials: 1,
            sweeps: 1,
            steps: 1,
            ..TwinConfig::default()
        };
        assert!(generate(&good).is_ok());
        for (config, named) in [
            (
                TwinConfig {
                    materials: 37,
                    ..good.clone()
                },
                "materials: expected 1 to 36, found 37",
            ),
            (
                TwinConfig {
                    materials: 0,
                    ..good.clone()
                },
                "materials",
            ),
            (
                TwinConfig {
                    sweeps: 0,
                    ..good.clone()
                },
                "sweeps",
            ),
            (
                TwinConfig {
                    steps: 0,
                    ..good.clone()
                },
                "steps",
            ),
            (
                TwinConfig {
                    difficulty: 0.0,
                    ..good.clone()
                },
                "difficulty",
            ),
            (
                TwinConfig {
                    difficulty: f64::NAN,
                    ..good.clone()
                },
                "difficulty",
            ),
        ] {
            let error = generate(&config).unwrap_err().to_string();
            assert!(error.contains(named), "{error}");
        }
    }

    #[test]
    fn config_refuses_unknown_fields_and_fills_missing_ones() {
        let config: TwinConfig = serde_json::from_str(r#"{"sweeps": 20}"#).unwrap();
        assert_eq!(
            config,
            TwinConfig {
                sweeps: 20,
                ..TwinConfig::default()
            }
        );
        assert!(serde_json::from_str::<TwinConfig>(r#"{"rows": 5}"#).is_err());
    }

    /// Nearest neighbour on a taxel's mean level: the levels of a sweep say little about its material.
    #[test]
    fn levels_hardly_tell_materials_apart() {
        let config = TwinConfig {
            sweeps: 20,
            steps: 400,
            ..TwinConfig::default()
        };
        let twin = generate(&config).unwrap();
        let levels: Vec<[f32; TAXELS]> = (0..twin.len())
            .map(|index| {
                let sweep = twin.sweep(index);
                std::array::from_fn(|taxel| {
                    sweep[taxel..].iter().step_by(TAXELS).sum::<f32>() / 400.0
                })
            })
            .collect();
        let far = |a: &[f32; TAXELS], b: &[f32; TAXELS]| {
            a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>()
        };
        let block = |index: usize| twin.records()[index].block;
        let right = (0..twin.len())
            .filter(|&query| {
                let nearest = (0..twin.len())
                    .filter(|&other| block(other) != block(query))
                    .min_by(|&a, &b| {
                        far(&levels[a], &levels[query]).total_cmp(&far(&levels[b], &levels[query]))
                    });
                nearest.is_some_and(|n| twin.records()[n].label == twin.records()[query].label)
            })
            .count();
        // Chance is 0.028.
        assert!(
            (right as f64) < 0.15 * twin.len() as f64,
            "{right} of {}",
            twin.len()
        );
    }
}
