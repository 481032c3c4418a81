//! Signal of one sweep: the digits of 16 taxels while a surface slides under them.

use super::envelope::Envelopes;
use super::gaussian::{innovation, normal, unit};
use super::materials::{BANDS, Surface};
use rand_chacha::ChaCha8Rng;

/// Number of taxels of the patch.
pub(super) const TAXELS: usize = 16;
/// Sample rate, in Hz.
pub(super) const SAMPLE_RATE_HZ: f64 = 750.0;

/// Usual speed of the stroke, mm/s.
const SPEED_MM_PER_S: f64 = 30.0;
/// Distance between two rows of taxels, mm.
const TAXEL_PITCH_MM: f64 = 2.5;

// Both tables contain the mean digits of the four published sweeps, per taxel. Means below 3.5 are slightly higher here
// than in the figure, because the dead zone cuts a part of such a level.

/// Level of each taxel before the finger slips, digits.
const RESTING_LEVELS: [f64; TAXELS] = [
    19.7, 14.8, 16.4, 5.6, 12.5, 57.8, 44.9, 1.5, 13.1, 15.5, 5.7, 10.0, 6.3, 6.3, 2.7, 0.0,
];
/// Level of each taxel after the finger has slipped (from step 600 on), digits.
const SLIDING_LEVELS: [f64; TAXELS] = [
    19.4, 3.4, 1.2, 7.8, 9.7, 15.7, 7.1, 3.2, 11.8, 10.5, 3.9, 5.6, 6.2, 7.1, 2.9, 2.7,
];

/// Factor on the texture of each taxel: it is stronger where the fingertip is more curved.
const TEXTURE_GAINS: [f64; TAXELS] = [
    1.0, 1.5, 2.0, 1.0, 1.0, 1.9, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0,
];

/// Maximum delay between the first and the last taxel to slip, steps.
const SLIP_DELAY_STEPS: f64 = 10.0;
/// Share of the fast part in the fall of the level.
const FAST_SLIP_SHARE: f64 = 0.45;
/// Time constant of the fast part, steps.
const FAST_SLIP_STEPS: f64 = 12.0;
/// Time constant of the slow part, steps.
const SLOW_SLIP_STEPS: f64 = 400.0;
/// Time constant of the onset of the texture after a taxel starts to slip, steps.
const TEXTURE_ONSET_STEPS: f64 = 8.0;

/// Correlation time of the force that is common to all taxels, steps.
const FORCE_STEPS: f64 = 60.0;

/// Variance of the sensor noise, digits squared.
const NOISE_VARIANCE: f64 = 0.057 * 0.057;

/// Digit below which the sensor reads 0.
const DEAD_ZONE: f64 = 3.0;
/// Largest digit of the sensor.
const CEILING: f64 = 154.0;

/// Position of the finger on the tube: natural logarithms of factors on the levels, and the stroke.
#[derive(Debug, Clone)]
pub(super) struct Contact {
    /// Logarithm of the factor on both levels, per taxel.
    pub(super) levels: [f64; TAXELS],
    /// Logarithm of the factor on the sliding level, per taxel.
    pub(super) sliding: [f64; TAXELS],
    /// Logarithm of the factor on the speed.
    pub(super) speed: f64,
    /// Step at which each taxel starts to slip.
    pub(super) onset: [f64; TAXELS],
}

/// Common drift of the sweeps of one block.
#[derive(Debug, Clone)]
pub(super) struct Drift {
    levels: [f64; TAXELS],
    sliding: [f64; TAXELS],
}

/// Standard deviations of the logarithms of the factors on a contact, for a block or for a sweep in it.
struct Spread {
    force: f64,
    tilt: f64,
    taxel: f64,
    slip: f64,
    sliding: f64,
}

/// Spread of the drift between blocks.
const BLOCK: Spread = Spread {
    force: 0.06,
    tilt: 0.04,
    taxel: 0.17,
    slip: 0.06,
    sliding: 0.15,
};
/// Spread of the contact between the sweeps of a block.
const SWEEP: Spread = Spread {
    force: 0.05,
    tilt: 0.03,
    taxel: 0.19,
    slip: 0.08,
    sliding: 0.22,
};

impl Drift {
    /// Draws the drift of a block from its stream.
    pub(super) fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self::with(&BLOCK, rng)
    }

    fn with(spread: &Spread, rng: &mut ChaCha8Rng) -> Self {
        let force = spread.force * normal(rng);
        let slip = spread.slip * normal(rng);
        let tilt = [spread.tilt * normal(rng), spread.tilt * normal(rng)];
        let own = |sigma: f64, z: f64| sigma * z - sigma * sigma / 2.0;
        let mut taxels = || -> [f64; TAXELS] { std::array::from_fn(|_| normal(rng)) };
        let (levels, sliding) = (taxels(), taxels());
        Self {
            levels: std::array::from_fn(|taxel| {
                let (row, col) = (taxel / 4, taxel % 4);
                force
                    + tilt[0] * (row as f64 - 1.5)
                    + tilt[1] * (col as f64 - 1.5)
                    + own(spread.taxel, levels[taxel])
            }),
            sliding: sliding.map(|z| slip + own(spread.sliding, z)),
        }
    }
}

impl Contact {
    /// Draws the contact of one sweep from the drift of its block and its own drift.
    pub(super) fn draw(drift: &Drift, rng: &mut ChaCha8Rng) -> Self {
        let own = Drift::with(&SWEEP, rng);
        let first_slip = 16.0 + 6.0 * unit(rng);
        Self {
            levels: std::array::from_fn(|taxel| drift.levels[taxel] + own.levels[taxel]),
            sliding: std::array::from_fn(|taxel| drift.sliding[taxel] + own.sliding[taxel]),
            speed: 0.03 * normal(rng),
            onset: std::array::from_fn(|_| first_slip + SLIP_DELAY_STEPS * unit(rng)),
        }
    }

    /// Multiplies all levels by `factor`.
    pub(super) fn with_force(mut self, factor: f64) -> Self {
        self.levels
            .iter_mut()
            .for_each(|level| *level += factor.ln());
        self
    }

    /// Multiplies the speed by `factor`.
    pub(super) fn with_speed(mut self, factor: f64) -> Self {
        self.speed += factor.ln();
        self
    }
}

/// Discrete Ornstein-Uhlenbeck process in its stationary state.
#[derive(Clone, Copy)]
struct Process {
    keep: f64,
    drive: f64,
    value: f64,
}

impl Process {
    fn new(amplitude: f64, steps: f64, rng: &mut ChaCha8Rng) -> Self {
        let keep = (-1.0 / steps).exp();
        Self {
            keep,
            drive: amplitude * (1.0 - keep * keep).sqrt(),
            value: amplitude * normal(rng),
        }
    }

    fn step(&mut self, rng: &mut ChaCha8Rng) -> f64 {
        self.value = self.keep * self.value + self.drive * innovation(rng);
        self.value
    }
}

/// Three exponentials that decay from the step at which a taxel starts to slip.
#[derive(Clone, Copy)]
struct Slip {
    /// Fast part of the level's fall.
    fast: f64,
    /// Slow part of the level's fall.
    slow: f64,
    /// Silence before the texture is felt.
    still: f64,
}

impl Slip {
    /// State before a taxel slips.
    const START: Self = Self {
        fast: 1.0,
        slow: 1.0,
        still: 1.0,
    };

    /// Returns the factors of one step; `slowness` stretches the fall of the level.
    fn decay(slowness: f64) -> Self {
        Self {
            fast: (-1.0 / (FAST_SLIP_STEPS * slowness)).exp(),
            slow: (-1.0 / (SLOW_SLIP_STEPS * slowness)).exp(),
            still: (-1.0 / TEXTURE_ONSET_STEPS).exp(),
        }
    }

    fn step(&mut self, decay: &Self) {
        self.fast *= decay.fast;
        self.slow *= decay.slow;
        self.still *= decay.still;
    }
}

/// Fills `out` (`[steps][16]`, digits) with one sweep; a shorter `out` gets the beginning of the same sweep.
pub(super) fn record(surface: &Surface, contact: &Contact, rng: &mut ChaCha8Rng, out: &mut [u8]) {
    let speed = contact.speed.exp();
    let resting: [f64; TAXELS] = std::array::from_fn(|i| {
        RESTING_LEVELS[i] * contact.levels[i].exp() * surface.column_levels[i % 4]
    });
    let sliding: [f64; TAXELS] = std::array::from_fn(|i| {
        let factor = surface.slip_ratio * surface.column_levels[i % 4];
        SLIDING_LEVELS[i] * (contact.levels[i] + contact.sliding[i]).exp() * factor
    });
    let mut texture: [[Process; BANDS]; TAXELS] = std::array::from_fn(|i| {
        let gain = TEXTURE_GAINS[i] * surface.row_gains[i / 4] * surface.column_gains[i % 4];
        std::array::from_fn(|band| {
            Process::new(
                gain * surface.amplitudes[band],
                surface.correlation_steps[band] / speed,
                rng,
            )
        })
    });
    let mut envelopes = surface
        .envelope
        .map(|envelope| Envelopes::new(envelope, speed, rng));
    let mut force = Process::new(surface.force, FORCE_STEPS, rng);
    let decay = Slip::decay(surface.slip_slowness);
    let mut slip = [Slip::START; TAXELS];
    let phase = std::f64::consts::TAU * unit(rng);

    for (step, frame) in out.chunks_exact_mut(TAXELS).enumerate() {
        let common = force.step(rng);
        if let Some(envelopes) = &mut envelopes {
            envelopes.step(rng);
        }
        for (i, digit) in frame.iter_mut().enumerate() {
            if step as f64 >= contact.onset[i] {
                slip[i].step(&decay);
            }
            let rest = FAST_SLIP_SHARE * slip[i].fast + (1.0 - FAST_SLIP_SHARE) * slip[i].slow;
            let level = sliding[i] + (resting[i] - sliding[i]) * rest;
            let bands = texture[i].iter_mut().map(|band| band.step(rng));
            let mut relative = common
                + match &envelopes {
                    None => bands.sum::<f64>(),
                    Some(envelopes) => {
                        let factors = envelopes.factors(i);
                        bands.zip(factors).map(|(x, factor)| x * factor).sum()
                    }
                };
            if let Some(ridges) = surface.ridges {
                let travelled_mm = SPEED_MM_PER_S * speed * step as f64 / SAMPLE_RATE_HZ;
                let along = (travelled_mm - TAXEL_PITCH_MM * (i / 4) as f64) / ridges.pitch_mm;
                relative += ridges.amplitude * (std::f64::consts::TAU * along + phase).sin();
            }
            let noise = (NOISE_VARIANCE + surface.grain_variance * level).sqrt() * innovation(rng);
            *digit = quantise(level * (1.0 + (1.0 - slip[i].still) * relative) + noise);
        }
    }
}

/// Returns the sensor's digit: rounded, 0 below the dead zone's end, at most 154.
fn quantise(x: f64) -> u8 {
    let digit = x.round();
    if digit < DEAD_ZONE {
        0
    } else {
        digit.min(CEILING) as u8
    }
}
