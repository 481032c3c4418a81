//! Fourier coefficients of many real windows at once, by matrix products over a quarter of the window length.
//!
//! With a symmetric window function `h(n) = h(W - n)`, the real parts of a window of `W` steps depend on sums of mirrored steps,
//! the imaginary parts on their differences. A second reflection about `W / 4` separates even and odd bins:
//!
//! ```text
//! e(n) = h(n) (x(n) + x(W - n)),  o(n) = h(n) (x(n) - x(W - n))            n = 0 to W / 2
//! real parts       even bins: e(n) + e(W/2 - n)    odd bins: e(n) - e(W/2 - n)      n = 0 to W / 4
//! imaginary parts  even bins: o(n) - o(W/2 - n)    odd bins: o(n) + o(W/2 - n)
//! ```
//!
//! This takes a quarter of the multiply-adds of the definition. A fast Fourier transform takes fewer, but plain products vectorise well.

use std::f64::consts::PI;

/// Number of lanes that one vector operation handles.
pub(crate) const LANES: usize = 16;
/// Number of outputs of a product that are accumulated together.
const TILE: usize = 4;

/// Transform of windows of `window` steps, a multiple of four.
#[derive(Debug, Clone)]
pub(crate) struct FoldedDft {
    window: usize,
    /// `[window]`, Hann window with unit energy
    hann: Vec<f32>,
    /// Matrices of the four foldings, in the order of [`Folded`].
    products: [Matrix; 4],
    /// Transposes of `products`, for the backward pass.
    back: [Matrix; 4],
}

/// Folded windows: real parts of even and odd bins, then imaginary parts of even and odd bins; `[window / 4 + 1][lanes]` each.
#[derive(Debug, Clone)]
pub(crate) struct Folded([Vec<f32>; 4]);

/// `[inputs][outputs rounded up to tiles]`
#[derive(Debug, Clone)]
struct Matrix {
    values: Vec<f32>,
    inputs: usize,
    outputs: usize,
}

/// Selection of a matrix's rows: every `step`-th row from `first` on.
#[derive(Clone, Copy)]
struct Rows {
    first: usize,
    step: usize,
}

const ALL: Rows = Rows { first: 0, step: 1 };

impl Matrix {
    fn new(inputs: usize, outputs: usize, value: impl Fn(usize, usize) -> f64) -> Self {
        let padded = outputs.next_multiple_of(TILE);
        let mut values = vec![0.0; inputs * padded];
        for input in 0..inputs {
            for output in 0..outputs {
                values[input * padded + output] = value(input, output) as f32;
            }
        }
        Self {
            values,
            inputs,
            outputs,
        }
    }

    /// Computes `y[output] = sum over inputs of matrix x[input]` for every lane.
    ///
    /// - `x`: `[rows][lanes]`, of which the rows `of` are read
    /// - `y`: `[rows][lanes]`, of which the rows `to` are written
    #[inline(always)]
    fn times(&self, x: &[f32], of: Rows, y: &mut [f32], to: Rows, lanes: usize) {
        let padded = self.outputs.next_multiple_of(TILE);
        for lane in (0..lanes).step_by(LANES) {
            for tile in (0..self.outputs).step_by(TILE) {
                let mut sums = [[0.0f32; LANES]; TILE];
                for input in 0..self.inputs {
                    let x = chunk(x, (of.first + of.step * input) * lanes + lane);
                    let factors = &self.values[input * padded + tile..][..TILE];
                    for (sum, factor) in sums.iter_mut().zip(factors) {
                        for (sum, x) in sum.iter_mut().zip(x) {
                            *sum = factor.mul_add(*x, *sum);
                        }
                    }
                }
                let outputs = (self.outputs - tile).min(TILE);
                for (output, sum) in sums.iter().enumerate().take(outputs) {
                    let row = to.first + to.step * (tile + output);
                    y[row * lanes + lane..][..LANES].copy_from_slice(sum);
                }
            }
        }
    }
}

/// Returns sixteen values from `at` on.
#[inline(always)]
pub(crate) fn chunk(values: &[f32], at: usize) -> &[f32; LANES] {
    values[at..]
        .first_chunk()
        .unwrap_or_else(|| panic!("lanes come in whole chunks"))
}

/// Sine or cosine function with the number of its first bin.
type Wave = (fn(f64) -> f64, usize);

impl FoldedDft {
    /// - `window`: number of steps, a multiple of four
    pub(crate) fn new(window: usize) -> Self {
        assert!(window.is_multiple_of(4) && window > 0, "{window} steps");
        let quarter = window / 4;
        let hann: Vec<f64> = (0..window)
            .map(|n| (PI * n as f64 / window as f64).sin().powi(2))
            .collect();
        let gain = 1.0 / hann.iter().map(|h| h * h).sum::<f64>().sqrt();
        // Even bins start at 2, odd bins at 1.
        let waves: [Wave; 4] = [(f64::cos, 2), (f64::cos, 1), (f64::sin, 2), (f64::sin, 1)];
        let value = |(wave, first): Wave, n: usize, number: usize| {
            let bin = first + 2 * number;
            wave(2.0 * PI * ((n * bin) % window) as f64 / window as f64)
        };
        Self {
            window,
            hann: hann.iter().map(|h| (h * gain) as f32).collect(),
            products: waves.map(|of| Matrix::new(quarter + 1, quarter, |n, bin| value(of, n, bin))),
            back: waves.map(|of| Matrix::new(quarter, quarter + 1, |bin, n| value(of, n, bin))),
        }
    }

    /// Returns the number of steps of a window.
    pub(crate) fn window(&self) -> usize {
        self.window
    }

    /// Returns the window function, `[window]`.
    pub(crate) fn hann(&self) -> &[f32] {
        &self.hann
    }

    /// Allocates memory for `lanes` lanes.
    pub(crate) fn folded(&self, lanes: usize) -> Folded {
        Folded(std::array::from_fn(|_| {
            vec![0.0; (self.window / 4 + 1) * lanes]
        }))
    }

    /// Folds one window of `count` taxels into the lanes from `lane` on.
    ///
    /// - `steps`: `[window][count]`
    /// - `mean`: `[count]`, subtracted from each taxel
    #[inline(always)]
    pub(crate) fn fold(
        &self,
        steps: &[f32],
        mean: &[f32],
        folded: &mut Folded,
        lane: usize,
        lanes: usize,
    ) {
        let (quarter, half, count) = (self.window / 4, self.window / 2, mean.len());
        let of = |n: usize| &steps[n * count..(n + 1) * count];
        let Folded([real_even, real_odd, imaginary_even, imaginary_odd]) = folded;
        // The window function is zero at the first step, so only the middle step of that pair counts.
        let (middle, at) = (of(half), lane);
        for (trace, mean) in mean.iter().enumerate() {
            let value = (middle[trace] - mean) * self.hann[half];
            real_even[at + trace] = value;
            real_odd[at + trace] = -value;
            imaginary_even[at + trace] = 0.0;
            imaginary_odd[at + trace] = 0.0;
        }
        for n in 1..quarter {
            let at = n * lanes + lane;
            let (near, far) = (self.hann[n], self.hann[half - n]);
            let (first, last) = (of(n), of(self.window - n));
            let (before, behind) = (of(half - n), of(half + n));
            let real_even = &mut real_even[at..at + count];
            let real_odd = &mut real_odd[at..at + count];
            let imaginary_even = &mut imaginary_even[at..at + count];
            let imaginary_odd = &mut imaginary_odd[at..at + count];
            for trace in 0..count {
                let twice = 2.0 * mean[trace];
                let outer = near * (first[trace] + last[trace] - twice);
                let inner = far * (before[trace] + behind[trace] - twice);
                real_even[trace] = outer + inner;
                real_odd[trace] = outer - inner;
                let outer = near * (first[trace] - last[trace]);
                let inner = far * (before[trace] - behind[trace]);
                imaginary_even[trace] = outer - inner;
                imaginary_odd[trace] = outer + inner;
            }
        }
        let (first, last, at) = (
            of(quarter),
            of(self.window - quarter),
            quarter * lanes + lane,
        );
        let factor = self.hann[quarter];
        for (trace, mean) in mean.iter().enumerate() {
            real_even[at + trace] = factor * (first[trace] + last[trace] - 2.0 * mean);
            real_odd[at + trace] = 0.0;
            imaginary_even[at + trace] = 0.0;
            imaginary_odd[at + trace] = factor * (first[trace] - last[trace]);
        }
    }

    /// Computes the coefficients of bins 1 to `window / 2`.
    ///
    /// - `real`, `imaginary`: `[window / 2][lanes]`
    #[inline(always)]
    pub(crate) fn transform(
        &self,
        folded: &Folded,
        real: &mut [f32],
        imaginary: &mut [f32],
        lanes: usize,
    ) {
        for (number, (product, folded)) in self.products.iter().zip(&folded.0).enumerate() {
            let output = if number < 2 {
                &mut *real
            } else {
                &mut *imaginary
            };
            product.times(folded, ALL, output, bins(number), lanes);
        }
    }

    /// Replaces the folded values by the gradient with respect to them.
    ///
    /// - `real`, `imaginary`: gradients of the coefficients
    #[inline(always)]
    pub(crate) fn transform_back(
        &self,
        real: &[f32],
        imaginary: &[f32],
        folded: &mut Folded,
        lanes: usize,
    ) {
        for (number, (product, folded)) in self.back.iter().zip(&mut folded.0).enumerate() {
            let input = if number < 2 { real } else { imaginary };
            product.times(input, bins(number), folded, ALL, lanes);
        }
    }

    /// Adds the gradient with respect to the window of the lanes from `lane` on to `found`, including the contribution of the means.
    ///
    /// - `found`: `[window][count]`
    /// - `mean`: `[count]`, gradients with respect to the means alone; modified
    #[inline(always)]
    pub(crate) fn unfold(
        &self,
        folded: &Folded,
        mean: &mut [f32],
        found: &mut [f32],
        lane: usize,
        lanes: usize,
    ) {
        let (quarter, half, count) = (self.window / 4, self.window / 2, mean.len());
        let Folded([real_even, real_odd, imaginary_even, imaginary_odd]) = folded;
        let mut add = |n: usize, trace: usize, value: f32, mean: &mut [f32]| {
            found[n * count + trace] += value;
            // The forward pass subtracts the mean from every step.
            mean[trace] -= value;
        };
        for trace in 0..count {
            let at = lane + trace;
            add(
                half,
                trace,
                (real_even[at] - real_odd[at]) * self.hann[half],
                mean,
            );
            let at = quarter * lanes + lane + trace;
            let factor = self.hann[quarter];
            let (even, odd) = (real_even[at], imaginary_odd[at]);
            add(quarter, trace, factor * (even + odd), mean);
            add(self.window - quarter, trace, factor * (even - odd), mean);
        }
        for n in 1..quarter {
            let (near, far) = (self.hann[n], self.hann[half - n]);
            for trace in 0..count {
                let at = n * lanes + lane + trace;
                let even = near * (real_even[at] + real_odd[at]);
                let odd = near * (imaginary_odd[at] + imaginary_even[at]);
                add(n, trace, even + odd, mean);
                add(self.window - n, trace, even - odd, mean);
                let even = far * (real_even[at] - real_odd[at]);
                let odd = far * (imaginary_odd[at] - imaginary_even[at]);
                add(half - n, trace, even + odd, mean);
                add(half + n, trace, even - odd, mean);
            }
        }
        let share = 1.0 / self.window as f32;
        for found in found.chunks_exact_mut(count) {
            for (found, mean) in found.iter_mut().zip(&*mean) {
                *found += share * mean;
            }
        }
    }
}

/// Returns the rows of the bins of folding `number`; row 0 is bin 1.
fn bins(number: usize) -> Rows {
    Rows {
        first: usize::from(number.is_multiple_of(2)),
        step: 2,
    }
}
