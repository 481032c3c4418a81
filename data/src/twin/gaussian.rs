//! Normal variates whose values depend only on this file and ChaCha8.
//!
//! The hash of its digits identifies a twin, so its random numbers must not change with a release of a distribution
//! crate.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Returns a standard normal variate by Box and Muller's transform (Ann. Math. Stat. 29, 1958), for the few parameters of
/// a sweep.
pub(super) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * (1.0 - unit(rng)).ln()).sqrt();
    radius * (std::f64::consts::TAU * unit(rng)).cos()
}

/// Returns a uniform number in `[0, 1)`.
pub(super) fn unit(rng: &mut ChaCha8Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// Returns a nearly normal variate of zero mean and unit variance: the scaled sum of four 16-bit uniforms (Irwin-Hall),
/// from one draw.
///
/// Its support ends at 3.46 and its excess kurtosis is -0.3, which is negligible once an Ornstein-Uhlenbeck process has
/// summed a few of them. It needs no transcendental function, and a twin draws hundreds of millions.
pub(super) fn innovation(rng: &mut ChaCha8Rng) -> f64 {
    let draw = rng.next_u64();
    let sum = (draw & 0xffff) + (draw >> 16 & 0xffff) + (draw >> 32 & 0xffff) + (draw >> 48);
    /// Mean of the sum of four 16-bit uniforms.
    const MEAN: f64 = 2.0 * 65535.0;
    // Variance of one uniform: (65536^2 - 1) / 12; of four: a third of 65536^2 - 1.
    const SCALE: f64 = 1.732_050_807_568_877_2 / 65536.0;
    (sum as f64 - MEAN) * SCALE
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Seed;

    fn moments(draw: fn(&mut ChaCha8Rng) -> f64) -> [f64; 3] {
        const N: usize = 200_000;
        let mut rng = Seed(1).rng("moments");
        let mut sums = [0.0; 3];
        for _ in 0..N {
            let x = draw(&mut rng);
            for (sum, power) in sums.iter_mut().zip([1, 2, 4]) {
                *sum += x.powi(power) / N as f64;
            }
        }
        sums
    }

    #[test]
    fn variates_are_standardised() {
        // Standard errors with 200 000 draws: 0.002, 0.003, 0.02; the tolerances are five of them.
        for (draw, fourth) in [
            (normal as fn(&mut ChaCha8Rng) -> f64, 3.0),
            (innovation, 2.7),
        ] {
            let [mean, variance, kurtosis] = moments(draw);
            assert!(mean.abs() < 0.011, "{mean}");
            assert!((variance - 1.0).abs() < 0.016, "{variance}");
            assert!((kurtosis - fourth).abs() < 0.11, "{kurtosis}");
        }
    }
}
