//! Noise of a signal: the part that neither its past nor its neighbours predict.

/// Number of frames from which the next is predicted.
const ORDER: usize = 4;
/// Noise of a signal without noise, as a share of its deviation: the rounding of 32-bit floats.
const ROUNDING: f64 = 1e-5;

/// Minimum noise of a signal of whole steps, as a share of a step: rounding alone gives a quarter.
const STEP_SHARE: f64 = 0.33;

/// Returns the median absolute deviation of the noise; `None` if the signal is predictable up to rounding, as a sine is, or
/// seldom changes. It is the smallest of three estimates: the errors of a linear prediction, which finds noise in vibrations, and the
/// second and third differences, which find noise on smooth curves.
pub(super) fn noise(values: &[f64]) -> Option<f64> {
    let plain = without_mean(values);
    if plain.len() <= 2 * ORDER {
        return None;
    }
    let absolute = |values: &[f64]| median(values.iter().map(|value| value.abs()).collect());
    let second = differences(&differences(&plain));
    let third = differences(&second);
    // The sums of the squared coefficients: 1, -2, 1 and 1, -3, 3, -1.
    let smooth = (absolute(&second) / 6_f64.sqrt()).min(absolute(&third) / 20_f64.sqrt());
    let noise = median(unpredictable(&plain)).min(smooth);
    let deviation = (dot(&plain, &plain) / plain.len() as f64).sqrt();
    let least = (ROUNDING * deviation).max(STEP_SHARE * step(values));
    (noise > least).then_some(noise)
}

/// Returns the smallest difference of two values of the signal; 0 if all are equal.
fn step(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let steps = differences(&sorted).into_iter().filter(|step| *step > 0.0);
    steps.reduce(f64::min).unwrap_or(0.0)
}

/// Returns the differences of neighbouring values.
pub(super) fn differences(values: &[f64]) -> Vec<f64> {
    values.array_windows().map(|[a, b]| b - a).collect()
}

pub(super) fn without_mean(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|value| value - mean).collect()
}

/// Returns the upper quartile of at least one value.
pub(super) fn upper_quartile(mut values: Vec<f64>) -> f64 {
    let place = 3 * values.len() / 4;
    *values.select_nth_unstable_by(place, f64::total_cmp).1
}

/// Returns the median of at least one value.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns the absolute errors of the best linear prediction of each value from the [`ORDER`] values before it.
fn unpredictable(values: &[f64]) -> Vec<f64> {
    let mut normal = [[0.0; ORDER + 1]; ORDER];
    for window in values.array_windows::<{ ORDER + 1 }>() {
        for (row, of_row) in normal.iter_mut().enumerate() {
            for (sum, value) in of_row.iter_mut().zip(window) {
                *sum += window[row] * value;
            }
        }
    }
    let weights = solved(normal);
    let error = |window: &[f64; ORDER + 1]| {
        let predicted: f64 = window
            .iter()
            .zip(&weights)
            .map(|(value, weight)| value * weight)
            .sum();
        (window[ORDER] - predicted).abs()
    };
    values.array_windows().map(error).collect()
}

/// Solves the equations whose last column is the right-hand side, by elimination. The matrix is symmetric and positive;
/// a small number on its diagonal keeps it regular.
fn solved(mut rows: [[f64; ORDER + 1]; ORDER]) -> [f64; ORDER] {
    let trace: f64 = (0..ORDER).map(|at| rows[at][at]).sum();
    (0..ORDER).for_each(|at| rows[at][at] += 1e-12 * trace + f64::MIN_POSITIVE);
    for pivot in 0..ORDER {
        let of_pivot = rows[pivot];
        for row in &mut rows[pivot + 1..] {
            let factor = row[pivot] / of_pivot[pivot];
            for (value, of_pivot) in row.iter_mut().zip(of_pivot) {
                *value -= factor * of_pivot;
            }
        }
    }
    let mut solution = [0.0; ORDER];
    for row in (0..ORDER).rev() {
        let known: f64 = (row + 1..ORDER)
            .map(|at| rows[row][at] * solution[at])
            .sum();
        solution[row] = (rows[row][ORDER] - known) / rows[row][row];
    }
    solution
}

#[cfg(test)]
mod tests {
    use super::*;

    fn white(seed: u64) -> Vec<f64> {
        let mut state = seed;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
        };
        (0..400).map(|_| next()).collect()
    }

    #[test]
    fn the_noise_on_waves_and_curves_is_found() {
        let of = |signal: fn(f64) -> f64| -> Vec<f64> {
            let noisy = white(1).into_iter().enumerate();
            noisy.map(|(at, noise)| noise + signal(at as f64)).collect()
        };
        // The median of a uniform number from 0 to 0.5 is 0.25.
        let signals: [fn(f64) -> f64; 3] = [
            |_| 0.0,
            |at| 100.0 * (at * 0.05).sin(),
            |at| 500.0 / (1.0 + (at - 200.0).powi(2) / 400.0),
        ];
        for signal in signals {
            let found = noise(&of(signal)).unwrap();
            assert!((0.15..0.4).contains(&found), "{found}");
        }
        let sine: Vec<f64> = (0..400).map(|at| (f64::from(at) * 0.7).sin()).collect();
        assert_eq!(noise(&sine), None);
        assert_eq!(noise(&[3.0; 400]), None);
        let rounded: Vec<f64> = sine.iter().map(|value| (20.0 * value).round()).collect();
        assert_eq!(noise(&rounded), None);
        let coarse: Vec<f64> = white(1).iter().map(|value| (6.0 * value).round()).collect();
        assert_eq!(coarse.iter().copied().fold(0.0, f64::max), 3.0);
        assert!(noise(&coarse).is_some());
    }

    #[test]
    fn equations_are_solved() {
        let rows = [
            [4.0, 1.0, 0.0, 0.0, 6.0],
            [1.0, 3.0, 0.0, 0.0, 7.0],
            [0.0, 0.0, 2.0, 0.0, 6.0],
            [0.0, 0.0, 0.0, 1.0, 4.0],
        ];
        let solution = solved(rows);
        for (found, expected) in solution.iter().zip([1.0, 2.0, 3.0, 4.0]) {
            assert!((found - expected).abs() < 1e-9, "{solution:?}");
        }
    }
}
