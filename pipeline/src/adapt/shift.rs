//! Moments of quantities in new sweeps, believed as far as they exceed their sampling noise.

use serde::{Deserialize, Serialize};

/// Mean and variance of one quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Moment {
    pub mean: f64,
    pub variance: f64,
}

impl Moment {
    /// Returns the moment of a quantity that has one value in a sweep.
    pub fn of_value(value: f32) -> Self {
        Self {
            mean: f64::from(value),
            variance: 0.0,
        }
    }
}

/// Size of a shift between training sweeps and new sweeps: root mean square over quantities, without sampling noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shift {
    /// Shift of the means, in training spreads.
    pub level: f64,
    /// Shift of the natural logarithms of the spreads.
    pub spread: f64,
}

/// Returns the moments of every quantity in sweeps like the new ones, between the training moments and those of the new sweeps.
///
/// A new mean counts with the weight `t / (t + noise)`, where `noise` is its sampling variance over sweeps and `t` the variance of the shift over
/// all quantities beyond that noise, both in training variances (empirical Bayes: James & Stein, 1961). The training moments so count as `1 / t`
/// sweeps: a thousand where nothing has changed, one where a shift is as large as the spread. Logarithms of spreads are treated likewise.
///
/// - `known`: moments of the training sweeps, `[quantities]`
/// - `sweeps`: moments within each new sweep, `[sweeps][quantities]`; with fewer than two the training moments stay
pub(crate) fn believed(known: &[Moment], sweeps: &[Vec<Moment>]) -> (Vec<Moment>, Shift) {
    let still = Shift {
        level: 0.0,
        spread: 0.0,
    };
    if sweeps.len() < 2 {
        return (known.to_vec(), still);
    }
    let found: Vec<Measured> = known
        .iter()
        .enumerate()
        .map(|(quantity, known)| Measured::of(known, || sweeps.iter().map(move |of| of[quantity])))
        .collect();
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let (mut sum, mut count) = (0.0, 0.0_f64);
        values.for_each(|value| (sum, count) = (sum + value, count + 1.0));
        sum / count.max(1.0)
    };
    let beyond = |(level, noise): (f64, f64)| level * level - noise;
    let levels = mean(&mut found.iter().filter_map(|of| of.level).map(beyond)).max(0.0);
    let spreads = || found.iter().filter_map(|of| of.spread);
    // The noise of a single spread is itself too uncertain.
    let spread_noise = mean(&mut spreads().map(|(_, noise)| noise));
    let beyond = mean(&mut spreads().map(|(spread, _)| spread * spread)) - spread_noise;
    let of_spreads = beyond.max(0.0);
    let weight = |shift: f64, noise: f64| match shift > 0.0 {
        true => shift / (shift + noise),
        false => 0.0,
    };
    let moments = known.iter().zip(&found).map(|(known, of)| {
        let deviation = known.variance.sqrt();
        let spread = of.spread.map_or(0.0, |(spread, _)| spread);
        let (level, noise) = of.level.unwrap_or((0.0, 1.0));
        Moment {
            mean: known.mean + weight(levels, noise) * level * deviation,
            variance: known.variance * (2.0 * weight(of_spreads, spread_noise) * spread).exp(),
        }
    });
    let shift = Shift {
        level: levels.sqrt(),
        spread: of_spreads.sqrt(),
    };
    (moments.collect(), shift)
}

/// Difference of a quantity in new sweeps from its training moments.
struct Measured {
    /// Difference of the means, in training spreads, and its sampling variance; `None` if the quantity is constant in training sweeps.
    level: Option<(f64, f64)>,
    /// Difference of the logarithms of the spreads, and its sampling variance; `None` if the quantity does not change in one of them.
    spread: Option<(f64, f64)>,
}

impl Measured {
    fn of<I: Iterator<Item = Moment>>(known: &Moment, sweeps: impl Fn() -> I) -> Self {
        let count = sweeps().count() as f64;
        let mean = sweeps().map(|of| of.mean).sum::<f64>() / count;
        let between = sweeps().map(|of| (of.mean - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let within = sweeps().map(|of| of.variance).sum::<f64>() / count;
        let variance = between + within;
        let share = |of: Moment| of.variance + (of.mean - mean).powi(2) * count / (count - 1.0);
        let noise = sweeps()
            .map(|of| (share(of) - variance).powi(2))
            .sum::<f64>()
            / (count - 1.0)
            / count;
        let spread = (variance > 0.0 && known.variance > 0.0).then(|| {
            let log = 0.5 * (variance / known.variance).ln();
            (log, noise / (4.0 * variance * variance))
        });
        // A spread below the rounding of 32-bit floats is none.
        let rounding = f64::from(f32::EPSILON) * known.mean.abs();
        let unit = known.variance;
        let level = ((mean - known.mean) / unit.sqrt(), between / count / unit);
        Self {
            level: (unit > rounding * rounding).then_some(level),
            spread: spread.filter(|(log, noise)| log.is_finite() && noise.is_finite()),
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::Rng;
    use rand::RngExt;
    use tactnet_data::Seed;

    use super::*;

    /// Returns sweeps whose quantities have mean `level` and standard deviation about `spread`.
    fn sweeps(count: usize, level: f64, spread: f64, rng: &mut impl Rng) -> Vec<Vec<Moment>> {
        let mut value = || {
            // The sum of twelve uniform numbers has variance 1.
            let sum: f64 = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum();
            Moment::of_value((level + spread * sum) as f32)
        };
        (0..count)
            .map(|_| (0..100).map(|_| value()).collect())
            .collect()
    }

    const KNOWN: Moment = Moment {
        mean: 0.0,
        variance: 1.0,
    };

    #[test]
    fn sampling_noise_is_not_a_shift() {
        let mut rng = Seed(1).rng("shift");
        let (moments, shift) = believed(&[KNOWN; 100], &sweeps(8, 0.0, 1.0, &mut rng));
        // A mean of eight sweeps has a standard error of 0.35, a logarithmic spread one of 0.27; half of the variance may remain of each.
        assert!(shift.level < 0.25 && shift.spread < 0.19, "{shift:?}");
        let squares: f64 = moments.iter().map(|of| of.mean.powi(2)).sum();
        assert!(squares / 100.0 < 0.125 / 3.0, "{squares}");
    }

    #[test]
    fn a_shift_beyond_the_noise_is_believed() {
        let mut rng = Seed(2).rng("shift");
        let (moments, shift) = believed(&[KNOWN; 100], &sweeps(16, 3.0, 0.5, &mut rng));
        assert!((shift.level - 3.0).abs() < 0.1, "{shift:?}");
        assert!((shift.spread - 2.0_f64.ln()).abs() < 0.1, "{shift:?}");
        for of in &moments {
            // Five standard errors of a mean of 16 values with spread 0.5; a third of the new spread.
            assert!((of.mean - 3.0).abs() < 5.0 * 0.125, "{of:?}");
            assert!((0.1..0.6).contains(&of.variance), "{of:?}");
        }
    }

    #[test]
    fn one_sweep_and_constant_quantities_change_nothing() {
        let one = vec![vec![Moment::of_value(9.0)]];
        assert_eq!(believed(&[KNOWN], &one).0, [KNOWN]);
        let equal = vec![vec![Moment::of_value(0.0)]; 5];
        assert_eq!(believed(&[KNOWN], &equal).0, [KNOWN]);
    }
}
