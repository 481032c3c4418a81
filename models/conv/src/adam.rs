//! Adam step in one pass over parameters and moments.

use rayon::prelude::*;

use super::simd::{Isa, Kernel, Lanes};

/// Number of values that one task updates.
const RUN: usize = 1 << 14;

/// Adam step (Kingma & Ba, 2015) with an L2 penalty that is added to the gradient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdamStep {
    /// Weight of the L2 penalty.
    pub l2: f32,
    /// Decay rates of the first and the second moment.
    pub beta: [f32; 2],
    /// Learning rate times `sqrt(1 - beta_2^t) / (1 - beta_1^t)`.
    pub rate: f32,
    /// Added to the square root of the second moment, times `sqrt(1 - beta_2^t)`.
    pub epsilon: f32,
}

impl AdamStep {
    /// Updates `parameter` and its first and second moment in place; all slices have one length.
    ///
    /// Subnormal moments become zero. Processors handle subnormal numbers in microcode, so a weight without gradient would otherwise slow
    /// down every later step.
    pub fn update(self, parameter: &mut [f32], gradient: &[f32], moments: [&mut [f32]; 2]) {
        let isa = Isa::detect();
        let [first, second] = moments;
        let run = |(((parameter, gradient), first), second)| {
            let part = Part {
                step: self,
                parameter,
                gradient,
                first,
                second,
            };
            // Two octets, for the widest vectors.
            isa.run(2, part);
        };
        if parameter.len() <= RUN {
            return run((((parameter, gradient), first), second));
        }
        parameter
            .par_chunks_mut(RUN)
            .zip(gradient.par_chunks(RUN))
            .zip(first.par_chunks_mut(RUN))
            .zip(second.par_chunks_mut(RUN))
            .for_each(run);
    }
}

/// Update of one task's values. The compiler vectorises its loop for the instruction set of the function that inlines it.
struct Part<'a> {
    step: AdamStep,
    parameter: &'a mut [f32],
    gradient: &'a [f32],
    first: &'a mut [f32],
    second: &'a mut [f32],
}

impl Kernel for Part<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let AdamStep {
            l2,
            beta,
            rate,
            epsilon,
        } = self.step;
        let moments = self.first.iter_mut().zip(self.second);
        for ((parameter, &gradient), (m, v)) in
            self.parameter.iter_mut().zip(self.gradient).zip(moments)
        {
            let gradient = gradient + l2 * *parameter;
            *m = normal(beta[0] * *m + (1.0 - beta[0]) * gradient);
            *v = normal(beta[1] * *v + (1.0 - beta[1]) * gradient * gradient);
            *parameter -= rate * *m / (v.sqrt() + epsilon);
        }
    }
}

/// Returns zero for subnormal numbers, else `value`.
#[inline(always)]
fn normal(value: f32) -> f32 {
    if value.abs() < f32::MIN_POSITIVE {
        0.0
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise;

    const STEP: AdamStep = AdamStep {
        l2: 1e-3,
        beta: [0.9, 0.999],
        rate: 1e-2,
        epsilon: 1e-8,
    };

    #[test]
    fn every_instruction_set_takes_the_same_step_to_the_bit() {
        // More than one task, and not a multiple of a vector.
        let len = RUN + 21;
        let gradient = noise(len, 2);
        let found: Vec<[Vec<f32>; 3]> = Isa::all()
            .into_iter()
            .map(|isa| {
                let [mut parameter, mut first] = [1, 3].map(|seed| noise(len, seed));
                let mut second: Vec<f32> = noise(len, 4).iter().map(|v| v * v).collect();
                isa.run(
                    2,
                    Part {
                        step: STEP,
                        parameter: &mut parameter,
                        gradient: &gradient,
                        first: &mut first,
                        second: &mut second,
                    },
                );
                [parameter, first, second]
            })
            .collect();
        let [mut parameter, mut first] = [1, 3].map(|seed| noise(len, seed));
        let mut second: Vec<f32> = noise(len, 4).iter().map(|v| v * v).collect();
        STEP.update(&mut parameter, &gradient, [&mut first, &mut second]);
        for other in &found {
            assert_eq!(other, &[parameter.clone(), first.clone(), second.clone()]);
        }
        let expected = {
            let [p, m] = [1, 3].map(|seed| f64::from(noise(1, seed)[0]));
            let v = f64::from(noise(1, 4)[0]).powi(2);
            let g = f64::from(gradient[0]) + 1e-3 * p;
            let (m, v) = (0.9 * m + 0.1 * g, 0.999 * v + 0.001 * g * g);
            p - 1e-2 * m / (v.sqrt() + 1e-8)
        };
        assert!((f64::from(parameter[0]) - expected).abs() < 1e-6);
    }

    #[test]
    fn moments_of_a_weight_without_gradient_end_at_zero() {
        let [mut parameter, mut first, mut second] = [vec![1.0], vec![1e-30], vec![1e-30]];
        let step = AdamStep { l2: 0.0, ..STEP };
        let mut smallest = f32::MAX;
        for _ in 0..40_000 {
            step.update(&mut parameter, &[0.0], [&mut first, &mut second]);
            for moment in [first[0], second[0]] {
                assert!(moment == 0.0 || moment.is_normal(), "{moment:e}");
            }
            smallest = smallest.min(second[0]);
        }
        assert_eq!((first[0], smallest), (0.0, 0.0));
    }
}
