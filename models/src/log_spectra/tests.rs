use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

fn noise(len: usize, seed: u64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..len).map(|_| rng.random_range(-2.0..2.0)).collect()
}

fn forward(plan: &LogSpectra, sweep: &[f32]) -> Vec<f32> {
    let windows = plan.windows(sweep.len() / plan.taxels);
    let mut output = vec![f32::NAN; windows * plan.taxels * plan.values()];
    plan.forward(sweep, &mut output, &mut plan.scratch(windows));
    output
}

/// Returns the log spectra by their definition, in double precision.
fn by_definition(plan: &LogSpectra, sweep: &[f32]) -> Vec<f64> {
    let (taxels, window) = (plan.taxels, plan.window());
    let mut found = Vec::new();
    for at in 0..plan.windows(sweep.len() / taxels) {
        for taxel in 0..taxels {
            let steps: Vec<f64> = (0..window)
                .map(|n| f64::from(sweep[(at * plan.hop + n) * taxels + taxel]))
                .collect();
            let mean = steps.iter().sum::<f64>() / window as f64;
            let hann = |n: usize| (PI * n as f64 / window as f64).sin().powi(2);
            let power: f64 = (0..window).map(|n| hann(n).powi(2)).sum();
            let energy = |bin: usize| {
                let part = |wave: fn(f64) -> f64| -> f64 {
                    let angle = |n: usize| 2.0 * PI * (n * bin) as f64 / window as f64;
                    (0..window)
                        .map(|n| (steps[n] - mean) * hann(n) * wave(angle(n)))
                        .sum()
                };
                (part(f64::cos).powi(2) + part(f64::sin).powi(2)) / power
            };
            for band in &plan.bands {
                let sum: f64 = band
                    .weights
                    .iter()
                    .enumerate()
                    .map(|(bin, weight)| f64::from(*weight) * energy(band.first + bin + 1))
                    .sum();
                found.push((sum + f64::from(ENERGY_FLOOR)).log10() + 1.5);
            }
            found.push(mean);
        }
    }
    found
}

/// Test cases: window, hop, bands, taxels, steps.
const CASES: [[usize; 5]; 7] = [
    [16, 4, 6, 2, 16],
    [64, 16, 24, 16, 200],
    [4, 1, 2, 1, 9],
    [32, 8, 16, 3, 33],
    [12, 3, 4, 30, 47],
    [16, 40, 1, 2, 100],
    [64, 16, 99, 300, 90],
];

#[test]
fn it_is_the_stated_spectrum() {
    for [window, hop, bands, taxels, steps] in CASES {
        let plan = LogSpectra::new(window, hop, bands, taxels);
        let sweep: Vec<f32> = noise(steps * taxels, 1).iter().map(|x| x + 5.0).collect();
        let found = forward(&plan, &sweep);
        let expected = by_definition(&plan, &sweep);
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            let near = (f64::from(*found) - expected).abs() < 2e-3;
            assert!(near, "{window} {bands} {taxels}: {found} {expected}");
        }
    }
}

#[test]
fn white_noise_has_unit_energy() {
    let plan = LogSpectra::new(64, 16, 24, 4);
    // Uniform in ±2: variance 4/3.
    let found = forward(&plan, &noise(40_000 * 4, 2));
    let windows = found.len() / 4 / plan.values();
    let top = found.iter().skip(23).step_by(plan.values());
    let mean: f64 = top
        .map(|log| 10f64.powf(f64::from(*log) - 1.5))
        .sum::<f64>()
        / (4 * windows) as f64;
    assert!((mean - 4.0 / 3.0).abs() < 0.05, "{mean}");
}

#[test]
fn gradients_are_those_of_finite_differences() {
    for [window, hop, bands, taxels, steps] in CASES {
        let plan = LogSpectra::new(window, hop, bands, taxels);
        let sweep = noise(steps * taxels, 3);
        let windows = plan.windows(steps);
        let weights = noise(windows * taxels * plan.values(), 4);
        let mut gradient = vec![0.0; sweep.len()];
        plan.backward(&sweep, &weights, &mut gradient, &mut plan.scratch(windows));
        let objective = |sweep: &[f32]| -> f64 {
            let output = by_definition(&plan, sweep);
            output
                .iter()
                .zip(&weights)
                .map(|(o, w)| o * f64::from(*w))
                .sum()
        };
        for at in (0..sweep.len()).step_by(sweep.len() / 7) {
            let moved = |by: f32| {
                let mut sweep = sweep.clone();
                sweep[at] += by;
                objective(&sweep)
            };
            let expected = (moved(1e-2) - moved(-1e-2)) / 2e-2;
            let near = (f64::from(gradient[at]) - expected).abs() < 0.02 * (1.0 + expected.abs());
            assert!(near, "{window} {taxels}: {} {expected}", gradient[at]);
        }
    }
}

#[test]
fn two_matrix_products_are_the_same() {
    let plan = LogSpectra::new(16, 5, 6, 1);
    let sweep = noise(16, 5);
    let tables = plan.tables();
    let parts: Vec<f32> = tables
        .fourier
        .chunks_exact(16)
        .map(|row| row.iter().zip(&sweep).map(|(a, x)| a * x).sum())
        .collect();
    let found = forward(&plan, &sweep);
    for (weights, found) in tables.bands.chunks_exact(8).zip(&found) {
        let power = |bin: usize| parts[bin].powi(2) + parts[8 + bin].powi(2);
        let energy: f32 = (0..8).map(|bin| power(bin) * weights[bin]).sum();
        assert!((found - (energy + ENERGY_FLOOR).log10() - LOG_OFFSET).abs() < 1e-4);
    }
}

#[test]
fn the_logarithm_is_exact_to_about_an_ulp() {
    let mut x = 1e-30_f32;
    while x < 1e30 {
        let (found, expected) = (f64::from(ln(x)), f64::from(x).ln());
        let error = (found - expected).abs();
        assert!(
            error < 2.5e-7 * expected.abs().max(0.5),
            "{x}: {found} {expected}"
        );
        x *= 1.0007;
    }
}
