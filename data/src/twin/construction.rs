//! Parameters of the twin's versions.

use serde::{Deserialize, Serialize};

use super::TwinVersion;
use super::embedding::DIMENSIONS;
use super::materials::BANDS;

/// Parameters of the twin that a calibration may set; `default` is version 2. [`super`] has the equations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Construction {
    /// Divisor of the distances of the embedding, which are in standard deviations of a class of unit width.
    pub distance: f64,
    /// Standard deviation of a block's offset from its material's point, latent units.
    pub block: f64,
    /// Standard deviation of a sweep's offset within its block, latent units.
    pub sweep: f64,
    /// Mean share of sweeps that feel like another material. The share of a material is proportional to its published
    /// errors.
    pub excursions: f64,
    /// Range of an excursion: smallest and largest share of the way to the other material.
    pub excursion_reach: [f64; 2],
    /// Change of the logarithm of a parameter per latent unit: undulation, coarse band, fine bands, correlation times,
    /// texture along the rows and along the columns.
    pub gains: [f64; DIMENSIONS],
    /// Bound of the mixed coordinates, latent units: `bound tanh(x / bound)` replaces `x`, so distant materials differ
    /// less.
    pub bound: Option<f64>,
    /// True if the fine grain of the noise follows the fine band, and the medium band the mean of the coarse and the fine
    /// one.
    pub grain_follows: bool,
    /// Standard deviation of each texture band at the origin of the latent space, relative to the level.
    pub amplitudes: [f64; BANDS],
    /// Correlation time of each band at the origin of the latent space, steps.
    pub correlation_steps: [f64; BANDS],
    /// Standard deviation of the grain at a level of one digit, digits.
    pub grain: f64,
    /// Standard deviation of the force that is common to all taxels, relative to the level.
    pub force: f64,
    /// Change of the logarithm of the slip ratio with coarse band minus undulation.
    pub slip_ratio: f64,
    /// Change of the logarithm of the slip's duration with that of the correlation times.
    pub slip_duration: f64,
    /// Slope of the logarithm of the levels along the columns, with that of the correlation times.
    pub column_levels: f64,
    /// Unsteadiness of the texture.
    pub envelope: Envelope,
}

/// Slow variation of the texture's strength. `exp(s V - s^2)`, which has a mean square of 1, multiplies each taxel's
/// coarse band, and its medium and fine bands together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Envelope {
    /// Depth `s` at the origin of the latent space; 0 for a steady texture.
    pub depth: f64,
    /// Change of the logarithm of `s` per latent unit.
    pub gain: f64,
    /// Correlation time of `V`, steps.
    pub steps: f64,
}

impl Default for Construction {
    fn default() -> Self {
        Self::of(TwinVersion::Two)
    }
}

impl Construction {
    /// Returns the parameters of a version.
    pub fn of(version: TwinVersion) -> Self {
        match version {
            TwinVersion::One => Self::one(),
            TwinVersion::Two => Self::two(),
        }
    }

    /// Fitted by hand to the signal of four published sweeps and to the accuracy of the base network.
    fn one() -> Self {
        Self {
            distance: 1.0,
            block: 0.35,
            sweep: 0.65,
            excursions: 0.0,
            excursion_reach: [0.44, 1.24],
            gains: [0.125, 0.21, 0.20, 0.20, 0.045, 0.045],
            bound: None,
            grain_follows: true,
            amplitudes: [0.108, 0.035, 0.028, 0.0040],
            correlation_steps: [110.0, 25.0, 5.0, 1.5],
            grain: 0.026,
            force: 0.012,
            slip_ratio: 0.2,
            slip_duration: 0.5,
            column_levels: 0.1,
            envelope: Envelope {
                depth: 0.0,
                gain: 0.0,
                steps: 80.0,
            },
        }
    }

    /// Found by `experiments/twin/calibrate.py`, whose folder contains the log of all attempts.
    fn two() -> Self {
        Self {
            distance: 0.42,
            block: 0.12,
            sweep: 0.2,
            excursions: 0.14,
            excursion_reach: [0.44, 1.24],
            gains: [0.13, 0.18, 0.0, 0.12, 0.075, 0.075],
            bound: Some(9.0),
            grain_follows: false,
            amplitudes: [0.091, 0.0305, 0.0362, 0.0036],
            correlation_steps: [110.0, 25.0, 5.0, 1.5],
            grain: 0.024,
            force: 0.006,
            slip_ratio: 0.25,
            slip_duration: 1.2,
            column_levels: 0.0,
            envelope: Envelope {
                depth: 0.85,
                gain: 0.15,
                steps: 80.0,
            },
        }
    }

    /// Returns the name and the expected range of a parameter that is out of range; `None` if all are valid.
    pub(super) fn mistake(&self) -> Option<(&'static str, &'static str)> {
        let positive = [
            ("distance", self.distance),
            ("bound", self.bound.unwrap_or(1.0)),
            ("correlation_steps", least(&self.correlation_steps)),
            ("envelope.steps", self.envelope.steps),
        ];
        let not_negative = [
            ("block", self.block),
            ("sweep", self.sweep),
            ("amplitudes", least(&self.amplitudes)),
            ("grain", self.grain),
            ("force", self.force),
            ("envelope.depth", self.envelope.depth),
        ];
        let free = [
            ("gains", self.gains.iter().sum()),
            ("slip_ratio", self.slip_ratio),
            ("slip_duration", self.slip_duration),
            ("column_levels", self.column_levels),
            ("envelope.gain", self.envelope.gain),
            ("excursion_reach", self.excursion_reach.iter().sum()),
        ];
        let wrong = |list: &[(&'static str, f64)], holds: fn(f64) -> bool| {
            let found = list.iter().find(|(_, value)| !holds(*value));
            found.map(|(name, _)| *name)
        };
        let named = |expected| move |name| (name, expected);
        wrong(&positive, |value| value.is_finite() && value > 0.0)
            .map(named("a positive number"))
            .or_else(|| {
                wrong(&not_negative, |value| value.is_finite() && value >= 0.0)
                    .map(named("a number of at least 0"))
            })
            .or_else(|| wrong(&free, f64::is_finite).map(named("finite numbers")))
            .or_else(|| {
                (!(0.0..=0.5).contains(&self.excursions))
                    .then_some(("excursions", "a share of at most 0.5"))
            })
    }
}

/// Returns the smallest of some numbers; NaN if one is NaN.
fn least(numbers: &[f64]) -> f64 {
    numbers.iter().fold(f64::INFINITY, |least, &x| {
        if x < least || x.is_nan() { x } else { least }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_numbers_are_named() {
        let good = Construction::default();
        assert_eq!(good.mistake(), None);
        let wrong = [
            (
                "distance",
                Construction {
                    distance: 0.0,
                    ..good.clone()
                },
            ),
            (
                "amplitudes",
                Construction {
                    amplitudes: [0.1, f64::NAN, 0.1, 0.1],
                    ..good.clone()
                },
            ),
            (
                "gains",
                Construction {
                    gains: [f64::INFINITY; DIMENSIONS],
                    ..good.clone()
                },
            ),
            (
                "excursions",
                Construction {
                    excursions: 0.6,
                    ..good.clone()
                },
            ),
        ];
        for (name, construction) in wrong {
            assert_eq!(construction.mistake().map(|found| found.0), Some(name));
        }
    }
}
