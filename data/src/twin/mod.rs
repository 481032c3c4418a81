//! The TactMat twin: seeded sweeps that look like TactMat's where its signal is known.
//!
//! The real recordings cannot ship with the project. The twin is calibrated on four published sweeps (the figures are
//! in [`SignalStatistics`]) and on the published confusion matrix ([`published_confusions`]); what it says beyond them is a
//! prediction, and results on it are results on the twin, never on TactMat.
//!
//! There are two versions; a result names its own. Version 1 (data set `twin1`) is kept so that earlier results can be repeated.
//!
//! # Signal
//! Taxel `i` reads at step `t`, with `u` the steps since that taxel started to slip (0 before):
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
//! patch, some of it drawn per block of ten sweeps and the rest per sweep. They swamp what materials do to the levels. `v`
//! is the speed of the stroke (3 cm/s +-3 %), `y_i` the taxel's row times 2.5 mm.
//!
//! The envelopes `E_ib` make the texture unsteady; `V` is an Ornstein-Uhlenbeck process of unit variance:
//!
//! ```text
//! E_i1 = 1    E_i2 = exp(e V_i2 - e^2)    E_i3 = E_i4 = exp(e V_i3 - e^2)      version 1: e = 0
//! ```
//!
//! # Materials
//! The published confusions become points `z` in a six-dimensional latent space (see `embedding.rs`), where one unit is
//! the standard deviation of a class that is confused as published. A sweep of material `k` has its own point
//!
//! ```text
//! z_sweep = z_k / D + X (z_j - z_k) / D + b e_block + w e_sweep      e: standard normal in six dimensions
//! ```
//!
//! where `D` is distance times difficulty. `X` is 0 but for excursions: with a probability in proportion to what the published network
//! gets wrong of material `k` (0.14 on average in version 2, 0 in version 1), the sweep feels like a material `j` drawn from what `k` is
//! confused with, and `X` is uniform from 0.44 to 1.24.
//!
//! An orthonormal mixture of the point's coordinates, in version 2 levelled off by `9 tanh(x / 9)`, sets the logarithms of the undulation `a_1`, the coarse band `a_2`, the fine bands,
//! the correlation times (with them `s` and the column levels), and how `g_i` changes along rows and columns. The slip ratio `S / O`
//! follows `a_2 / a_1`. In version 1 the third coordinate sets `a_4` and `c`, and half of it `a_3`; in version 2 it sets the depth `e`
//! of the envelopes, and the stationary power above 20 Hz is the same for all materials: whatever tells two materials apart there is
//! smaller than an adversarial perturbation of 0.1 digits. All numbers are in [`Construction`].
//!
//! # Difficulty
//! [`TwinConfig::difficulty`] divides the distances between the materials' points and touches nothing else: neither the
//! variability of one material nor the random streams. 2 halves every difference between materials. The targets are
//! fitted at 1.
//!
//! # Force and speed
//! [`TwinConfig::contact_force`] is a factor on `O` and `S`, [`TwinConfig::speed`] one on `v`; random streams stay as they are, so that a sweep can be
//! felt again harder or faster. What a real skin does at another force beyond its levels is not modelled.

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

/// Sweeps of one material that are recorded in one go.
pub const SWEEPS_PER_BLOCK: usize = 10;

/// How large a twin, how hard, and which one; `Default` is TactMat's size.
///
/// Sweeps have their own random streams, so a smaller twin of the same seed is a part of the larger one: the first
/// materials, the first sweeps of each, the first steps of each sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TwinConfig {
    /// Which twin.
    pub version: TwinVersion,
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
    /// How hard the finger presses, as a factor on the usual force: all levels follow, and with them texture and grain.
    pub contact_force: f64,
    /// Speed of the stroke, as a factor on the usual 3 cm/s.
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

/// Generates the twin: `u8` digits of 4x4 taxels at 750 Hz, ordered by material and then by sweep, called "twin" or "twin1".
///
/// The block of a sweep is its number divided by [`SWEEPS_PER_BLOCK`]; materials have drifts of their own in a block of
/// the same number. No test split is given. The values depend on `config` alone, not on the number of threads. The full
/// size takes about three seconds of one core and 58 MB.
///
/// # Errors
/// More materials than there are names, nothing to generate, or a difficulty, force or speed that is not a positive number.
pub fn generate(config: &TwinConfig) -> Result<Dataset, DataError> {
    generate_with(config, &Construction::of(config.version))
}

/// The same of other numbers than the version's own: to calibrate a twin.
///
/// # Errors
/// As [`generate`]; a number out of range.
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

/// What all sweeps of a twin share.
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
