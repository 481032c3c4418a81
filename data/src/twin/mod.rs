//! TactMat twin: synthetic sweeps that resemble TactMat's in all published properties of the signal.
//!
//! The real recordings cannot be shipped with the project. The twin is calibrated on four published sweeps (their figures
//! are in [`SignalStatistics`]) and on the published confusion matrix ([`published_confusions`]). Its other properties
//! are predictions, and results on it are not results on TactMat.
//!
//! There are two versions, and a result names its version. Version 1 (data set `twin1`) is kept so that earlier results
//! can be repeated.
//!
//! ```
//! use tactnet_data::twin::{self, TwinConfig};
//!
//! let config = TwinConfig { materials: 2, sweeps: 3, steps: 100, ..TwinConfig::default() };
//! let twin = twin::generate(&config)?;
//! assert_eq!((twin.name(), twin.len(), twin.shape().taxels()), ("twin", 6, 16));
//! // Equal settings give equal sweeps.
//! assert_eq!(twin::generate(&config)?.sha256(), twin.sha256());
//! # Ok::<(), tactnet_data::DataError>(())
//! ```
//!
//! # Signal
//! Taxel `i` has this digit at step `t`; `u` is the number of steps since that taxel started to slip (0 before):
//!
//! ```text
//! x_i = round(L_i (1 + m_i (f + q_i + p_i)) + n_i)   0 where below 3, at most 154
//! L_i = S_i + (O_i - S_i) w_i                        level: rest O, sliding S
//! w_i = 0.45 exp(-u / 12 s) + 0.55 exp(-u / 400 s)   slip, fast and slow; s is the material's
//! m_i = 1 - exp(-u / 8)                              texture sets in
//! q_i = g_i sum_b a_b E_ib OU(tau_b / v)             texture: four Ornstein-Uhlenbeck processes of unit variance
//! f   = h OU(60)                                     force, common to all taxels
//! p_i = r sin(2 pi (v t 0.04 mm - y_i) / pitch)      ridges across the stroke, for three materials
//! n_i : variance 0.057^2 + c^2 L_i                   sensor noise and fine grain
//! ```
//!
//! `O` and `S` are the published mean levels times log-normal factors: per taxel, a common force, and a tilt of the
//! patch. Some are drawn per block of ten sweeps, the others per sweep. They exceed the differences between the
//! materials' levels. `v` is the speed of the stroke (3 cm/s +-3 %), `y_i` the taxel's row times 2.5 mm.
//!
//! The envelopes `E_ib` make the texture unsteady; `V` is an Ornstein-Uhlenbeck process of unit variance:
//!
//! ```text
//! E_i1 = 1    E_i2 = exp(e V_i2 - e^2)    E_i3 = E_i4 = exp(e V_i3 - e^2)      version 1: e = 0
//! ```
//!
//! # Materials
//! The published confusions become points `z` in a six-dimensional latent space (see `embedding.rs`), in which one unit
//! is the standard deviation of a class that is confused as published. A sweep of material `k` has the point
//!
//! ```text
//! z_sweep = z_k / D + X (z_j - z_k) / D + b e_block + w e_sweep      e: standard normal in six dimensions
//! ```
//!
//! where `D` is distance times difficulty. `X` is 0 except for excursions. Their probability is proportional to the
//! published error of material `k` (0.14 on average in version 2, 0 in version 1). In an excursion the sweep feels like a
//! material `j`, drawn from the published confusions of `k`, and `X` is uniform from 0.44 to 1.24.
//!
//! An orthonormal mixture of the point's coordinates, in version 2 bounded by `9 tanh(x / 9)`, sets the logarithms of the
//! undulation `a_1`, the coarse band `a_2`, the fine bands, the correlation times (with them `s` and the column levels),
//! and the change of `g_i` along rows and columns. The slip ratio `S / O` follows `a_2 / a_1`. In version 1 the third
//! coordinate sets `a_4` and `c`, and half of it `a_3`. In version 2 it sets the depth `e` of the envelopes, and the
//! stationary power above 20 Hz is the same for all materials: an adversarial perturbation of 0.1 digits would exceed all
//! differences between materials there. [`Construction`] has all numbers.
//!
//! # Difficulty
//! [`TwinConfig::difficulty`] divides the distances between the materials' points and changes neither the variability of
//! one material nor the random streams. A difficulty of 2 halves every difference between materials. The targets are
//! fitted at 1.
//!
//! # Force and speed
//! [`TwinConfig::contact_force`] is a factor on `O` and `S`, [`TwinConfig::speed`] one on `v`. The random streams do not
//! change, so a sweep can be repeated with another force or speed. Other effects of the force on a real skin are not
//! modelled.

mod construction;
mod embedding;
mod envelope;
mod excursions;
mod gaussian;
mod materials;
mod signal;
mod spectra;
mod statistics;
mod targets;
mod version;

pub use construction::{Construction, Envelope};
pub use embedding::published_confusions;
pub use materials::NAMES;
pub use statistics::{BAND_EDGES_HZ, LAGS, SignalStatistics, measure};
pub use targets::{Target, TargetSource};
pub use version::TwinVersion;

use crate::{DataError, Dataset, LabelSet, Samples, Seed, SweepRecord, SweepShape};
use embedding::Latent;
use excursions::Excursions;
use gaussian::normal;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use signal::{Contact, Drift, SAMPLE_RATE_HZ, TAXELS};

/// Number of sweeps of one material that are recorded in one session.
pub const SWEEPS_PER_BLOCK: usize = 10;

/// Size, difficulty and version of a twin; `Default` has TactMat's size.
///
/// Each sweep has a separate random stream, so a smaller twin of the same seed is a part of the larger one: the first
/// materials, the first sweeps of each, the first steps of each sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TwinConfig {
    /// Version of the twin.
    pub version: TwinVersion,
    /// Number of materials, the first of [`NAMES`]: 1 to 36.
    pub materials: usize,
    /// Number of sweeps of each material, in blocks of [`SWEEPS_PER_BLOCK`].
    pub sweeps: usize,
    /// Number of time steps of a sweep, at 750 Hz.
    pub steps: usize,
    /// Seed of the sweeps; the materials are the same for every seed.
    pub seed: u64,
    /// Divisor of the distances between materials in the latent space: larger is harder.
    pub difficulty: f64,
    /// Contact force, relative to the usual one: all levels are proportional to it, and with them texture and grain.
    pub contact_force: f64,
    /// Speed of the stroke, relative to 3 cm/s.
    pub speed: f64,
}

impl Default for TwinConfig {
    fn default() -> Self {
        Self {
            version: TwinVersion::default(),
            materials: NAMES.len(),
            sweeps: 100,
            steps: 1000,
            seed: 1,
            difficulty: 1.0,
            contact_force: 1.0,
            speed: 1.0,
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
        for (item, factor) in [
            ("twin difficulty", self.difficulty),
            ("twin contact force", self.contact_force),
            ("twin speed", self.speed),
        ] {
            if !(factor.is_finite() && factor > 0.0) {
                return wrong(item, "a positive number", factor.to_string());
            }
        }
        Ok(())
    }
}

/// Generates the twin: `u8` digits of 4x4 taxels at 750 Hz, ordered by material and then by sweep, with the name "twin"
/// or "twin1".
///
/// The block of a sweep is its number divided by [`SWEEPS_PER_BLOCK`]; blocks of the same number have different drifts in
/// different materials. There is no test split. The values depend only on `config`, not on the number of threads. The
/// full size takes about three seconds of one core and 58 MB.
///
/// # Errors
/// More materials than names, nothing to generate, or a difficulty, force or speed that is not a positive number.
pub fn generate(config: &TwinConfig) -> Result<Dataset, DataError> {
    generate_with(config, &Construction::of(config.version))
}

/// Returns a small twin for tests and examples: `[materials][sweeps][steps]`.
///
/// # Errors
/// As [`generate`].
///
/// ```
/// assert_eq!(tactnet_data::twin::small(2, 3, 50)?.len(), 6);
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
pub fn small(materials: usize, sweeps: usize, steps: usize) -> Result<Dataset, DataError> {
    generate(&TwinConfig {
        materials,
        sweeps,
        steps,
        ..TwinConfig::default()
    })
}

/// Generates a twin with other parameters than those of its version, for calibration.
///
/// # Errors
/// As [`generate`], and a parameter out of range.
pub fn generate_with(
    config: &TwinConfig,
    construction: &Construction,
) -> Result<Dataset, DataError> {
    config.check()?;
    if let Some((name, expected)) = construction.mistake() {
        let (item, found) = (format!("twin {name}"), "another number");
        return Err(DataError::inconsistent(item.as_str(), expected, found));
    }
    let shape = SweepShape {
        steps: config.steps,
        rows: 4,
        cols: TAXELS / 4,
    };
    let plan = Plan {
        config,
        construction,
        materials: embedding::embed(),
        excursions: Excursions::new(&published_confusions(), construction.excursions),
    };
    let place = |index: usize| (index / config.sweeps, index % config.sweeps);
    let mut digits = vec![0u8; config.materials * config.sweeps * shape.values()];
    digits
        .par_chunks_mut(shape.values())
        .enumerate()
        .for_each(|(index, out)| {
            let (label, sweep) = place(index);
            plan.generate_sweep(label, sweep, out);
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
        config.version.name(),
        SAMPLE_RATE_HZ,
        shape,
        labels,
        records,
        Samples::U8(digits),
    )
    .map(|dataset| dataset.into_twin(config.version))
}

/// Common parts of all sweeps of a twin.
struct Plan<'a> {
    config: &'a TwinConfig,
    construction: &'a Construction,
    materials: Vec<Latent>,
    excursions: Excursions,
}

impl Plan<'_> {
    fn generate_sweep(&self, label: usize, sweep: usize, out: &mut [u8]) {
        let (seed, c) = (Seed(self.config.seed), self.construction);
        let mut block_rng = seed.rng(("twin-block", label, sweep / SWEEPS_PER_BLOCK));
        let mut rng = seed.rng(("twin-sweep", label, sweep));
        let mut own = seed.rng(("twin-excursion", label, sweep));
        let excursion = self.excursions.draw(label, c.excursion_reach, &mut own);
        let drift = Drift::draw(&mut block_rng);
        let contact = Contact::draw(&drift, &mut rng)
            .with_force(self.config.contact_force)
            .with_speed(self.config.speed);
        let distance = c.distance * self.config.difficulty;
        let latent: Latent = std::array::from_fn(|axis| {
            let own = self.materials[label][axis] / distance;
            let felt = match excursion {
                None => own,
                Some(to) => own + to.reach * (self.materials[to.towards][axis] / distance - own),
            };
            felt + c.block * normal(&mut block_rng) + c.sweep * normal(&mut rng)
        });
        let surface = materials::surface(label, &latent, c);
        signal::record(&surface, &contact, &mut rng, out);
    }
}

#[cfg(test)]
mod tests;
