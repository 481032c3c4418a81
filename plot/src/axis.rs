//! Axes: a quantity with its scale, ticks and name.

use std::ops::RangeInclusive;

use crate::Scale;

/// Axis of a figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Name and unit of the quantity.
    pub label: String,
    /// Range and scale of the values.
    pub scale: Scale,
    /// Values with a grid line and a label.
    pub ticks: Vec<Tick>,
}

/// Labelled value of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// Value in the unit of the data.
    pub value: f64,
    /// Label, not escaped.
    pub label: String,
}

impl Axis {
    /// Returns a linear axis with a tick at every multiple of `step` within `range`.
    ///
    /// # Panics
    /// If `step` is not above 0, or an end not finite.
    pub fn linear(label: &str, range: RangeInclusive<f64>, step: f64) -> Self {
        let decimals = decimals(step);
        Self {
            label: label.into(),
            ticks: multiples(&range, step)
                .map(|value| Tick {
                    value,
                    label: format!("{value:.decimals$}").replace('-', "\u{2212}"),
                })
                .collect(),
            scale: Scale::Linear(range),
        }
    }

    /// Returns a linear axis of shares from 0 to `most`, labelled in percent, with a tick at every multiple of `step`.
    ///
    /// - `most`, `step`: shares; 1 is 100 %
    ///
    /// # Panics
    /// If `step` is not above 0, or an end is not finite.
    pub fn percent(label: &str, most: f64, step: f64) -> Self {
        let range = 0.0..=most;
        Self {
            label: label.into(),
            ticks: multiples(&range, step)
                .map(|value| Tick {
                    value,
                    label: format!("{:.0}", 100.0 * value),
                })
                .collect(),
            scale: Scale::Linear(range),
        }
    }

    /// Returns a logarithmic axis over the whole decades around `values`, at least one, with a tick at every power of
    /// ten.
    ///
    /// Only finite values above 0 count; `None` if there are none.
    pub fn decades(label: &str, values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let (low, high) = values
            .into_iter()
            .filter(|value| value.is_finite() && *value > 0.0)
            .fold((f64::INFINITY, 0.0_f64), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        if low > high {
            return None;
        }
        let first = low.log10().floor() as i32;
        let last = (high.log10().ceil() as i32).max(first + 1);
        Some(Self {
            label: label.into(),
            scale: Scale::Logarithmic(10f64.powi(first)..=10f64.powi(last)),
            ticks: (first..=last)
                .map(|exponent| Tick {
                    value: 10f64.powi(exponent),
                    label: power_of_ten(exponent),
                })
                .collect(),
        })
    }
}

fn multiples(range: &RangeInclusive<f64>, step: f64) -> impl Iterator<Item = f64> + use<> {
    let finite = range.start().is_finite() && range.end().is_finite();
    assert!(finite && step > 0.0, "ticks every {step} in {range:?}");
    // Rounding must not remove the tick at an end that is a multiple of the step.
    let first = (range.start() / step - 1e-9).ceil() as i64;
    let last = (range.end() / step + 1e-9).floor() as i64;
    (first..=last).map(move |k| k as f64 * step)
}

/// Returns the number of decimals that distinguish the multiples of `step`, at most six.
fn decimals(step: f64) -> usize {
    (0..6)
        .find(|digits| {
            let scaled = step * 10f64.powi(*digits);
            (scaled - scaled.round()).abs() < 1e-6 * scaled
        })
        .unwrap_or(6) as usize
}

/// Returns the number in full from 0.01 to 1000, otherwise with an exponent.
fn power_of_ten(exponent: i32) -> String {
    match exponent {
        0..=3 => 10i32.pow(exponent.unsigned_abs()).to_string(),
        -2..=-1 => 10f64.powi(exponent).to_string(),
        _ => {
            let raised: String = exponent.to_string().chars().map(superscript).collect();
            format!("10{raised}")
        }
    }
}

fn superscript(character: char) -> char {
    /// Superscript digits of exponents.
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    match character.to_digit(10) {
        Some(digit) => DIGITS[digit as usize],
        None => '⁻',
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|tick| tick.label.as_str()).collect()
    }

    #[test]
    fn ticks_are_the_multiples_of_the_step_up_to_both_ends() {
        // 0.3 / 0.1 is below 3.
        let axis = Axis::linear("share", 0.0..=0.3, 0.1);
        assert_eq!(labels(&axis), ["0.0", "0.1", "0.2", "0.3"]);
        let axis = Axis::linear("x [m]", -0.6..=0.6, 0.5);
        assert_eq!(labels(&axis), ["\u{2212}0.5", "0.0", "0.5"]);
        assert_eq!(
            labels(&Axis::linear("sweeps", 0.0..=2.9, 1.0)),
            ["0", "1", "2"]
        );
        assert_eq!(
            labels(&Axis::linear("x", 0.0..=0.5, 0.25)),
            ["0.00", "0.25", "0.50"]
        );
    }

    #[test]
    fn shares_are_labelled_in_percent() {
        let axis = Axis::percent("accuracy, %", 1.0, 0.2);
        assert_eq!(labels(&axis), ["0", "20", "40", "60", "80", "100"]);
        assert_eq!(axis.scale, Scale::Linear(0.0..=1.0));
    }

    #[test]
    fn decades_are_whole_and_at_least_one() {
        let axis = Axis::decades("x", [0.02, 3.0, 20_000.0, 0.0, f64::NAN]).unwrap();
        assert_eq!(
            labels(&axis),
            ["0.01", "0.1", "1", "10", "100", "1000", "10⁴", "10⁵"]
        );
        assert_eq!(labels(&Axis::decades("x", [10.0]).unwrap()), ["10", "100"]);
        assert_eq!(
            labels(&Axis::decades("x", [2e-12]).unwrap()),
            ["10⁻¹²", "10⁻¹¹"]
        );
        assert_eq!(Axis::decades("x", [0.0, -1.0, f64::INFINITY]), None);
    }
}
