//! Random convolution kernels: MiniRocket and MultiRocket.
//!
//! MiniRocket (Dempster, Schmidt & Webb, KDD 2021) convolves a series with 84 fixed kernels of length 9, six weights -1 and three
//! weights 2, at exponentially spaced dilations. With several taxels a kernel reads the sum of a random subset of them. Its
//! feature is the share of steps at which the result exceeds a bias (PPV); biases are quantiles of the result on a random
//! training sweep. MultiRocket (Tan et al., 2022) pools four features instead of one, over the series and its first difference.
//!
//! Kernels, order of features and padding follow aeon 1.6, so that equal kernels give equal features
//! (`tests/golden/features_with_aeon.py`). This includes a shift by one step of the left taps on the differenced series, which aeon computes
//! with the undifferenced length. One difference remains: with several taxels, aeon reads the difference from other taxels than those to which
//! its biases were fitted.

mod pooling;

use std::ops::Range;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tactnet_data::shuffle;

use tactnet_models::ModelError;

use crate::PipelineError;
use crate::features::arrays::of_length;
use crate::features::series::Series;
use pooling::KernelResult;
pub(crate) use pooling::{IN_STEPS, Pooling, WAYS};

/// Number of weights of a kernel.
const TAPS: usize = 9;
/// Number of kernels: all choices of three taps out of nine.
const KERNELS: usize = 84;
/// Maximum number of dilations per kernel.
const MAX_DILATIONS: usize = 32;
/// Maximum number of taxels that one kernel reads.
const MAX_TAXELS: usize = 9;

/// Series that the kernels read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    /// The sweep itself.
    Base,
    /// Its step-to-step change.
    Difference,
}

/// Kernels fitted to training sweeps, with everything that determines their features.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Kernels {
    /// Steps between taps, `[dilations]`.
    pub dilations: Vec<usize>,
    /// Number of biases for each of the 84 kernels, `[dilations]`.
    pub biases_per_kernel: Vec<usize>,
    /// Taxels that each kernel sums, `[dilations * 84]`.
    pub taxels: Vec<Vec<usize>>,
    /// Biases by dilation, kernel and number, `[features]`.
    pub biases: Vec<f32>,
}

impl Kernels {
    /// Succeeds if the parts are consistent for sweeps of `steps`.
    ///
    /// - `name`: name of the stored arrays
    ///
    /// # Errors
    /// Arrays of another length; taps that reach beyond a sweep.
    pub fn check(&self, name: &str, steps: usize) -> Result<(), PipelineError> {
        let part = |part: &str| format!("{name}.{part}");
        let dilations = self.dilations.len();
        let biases = KERNELS * self.biases_per_kernel.iter().sum::<usize>();
        of_length(
            &part("biases_per_kernel"),
            self.biases_per_kernel.len(),
            dilations,
        )?;
        of_length(
            &part("taxel_counts"),
            self.taxels.len(),
            KERNELS * dilations,
        )?;
        of_length(&part("biases"), self.biases.len(), biases)?;
        if let Some(odd) = self
            .dilations
            .iter()
            .find(|dilation| !(1..=steps).contains(*dilation))
        {
            return Err(PipelineError::Model(ModelError::Weights {
                tensor: part("dilations"),
                expected: format!("1 to {steps} steps between taps"),
                found: odd.to_string(),
            }));
        }
        Ok(())
    }

    /// Draws kernels for series of `taxels` x `steps` and fits their biases to training sweeps.
    ///
    /// - `features`: number of biases, which is rounded down to a multiple of 84
    /// - `sweeps`: number of training sweeps; `series(i)` returns the `i`th
    ///
    /// # Panics
    /// With fewer than nine steps.
    pub fn fit(
        [taxels, steps]: [usize; 2],
        order: Order,
        features: usize,
        sweeps: usize,
        series: impl Fn(usize) -> Series,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        assert!(
            steps >= TAPS,
            "a kernel has {TAPS} taps, a series {steps} steps"
        );
        let (dilations, biases_per_kernel) = spaced_dilations(steps, features);
        let most = taxels.min(MAX_TAXELS);
        let chosen = (0..dilations.len() * KERNELS)
            .map(|_| {
                let exponent = rng.random::<f64>() * ((most + 1) as f64).log2();
                let count = (exponent.exp2() as usize).min(most);
                let mut order: Vec<usize> = (0..taxels).collect();
                shuffle(&mut order, rng);
                order.truncate(count);
                order
            })
            .collect();
        let mut kernels = Self {
            dilations,
            biases_per_kernel,
            taxels: chosen,
            biases: Vec::new(),
        };
        let total = kernels.len();
        let mut biases = Vec::with_capacity(total);
        let mut workspace = Workspace::default();
        for combination in 0..kernels.taxels.len() {
            let sweep = series(rng.random_range(0..sweeps));
            let dilation = combination / KERNELS;
            workspace.prepare(&sweep, fitting(kernels.dilations[dilation], &sweep), order);
            workspace.convolve(
                &kernels.taxels[combination],
                combination % KERNELS,
                0..sweep.steps(),
            );
            let mut sorted = workspace.result.steps().to_vec();
            sorted.sort_unstable_by(f32::total_cmp);
            for _ in 0..kernels.biases_per_kernel[dilation] {
                biases.push(quantile(&sorted, low_discrepancy(biases.len() + 1)));
            }
        }
        kernels.biases = biases;
        kernels
    }

    /// Returns the number of biases: all features of MiniRocket, a quarter of MultiRocket's.
    pub fn len(&self) -> usize {
        KERNELS * self.biases_per_kernel.iter().sum::<usize>()
    }

    /// Writes the features of one series: `[len]` for [`Pooling::Share`], `[4][len]` for [`Pooling::FourWays`].
    pub fn transform(
        &self,
        series: &Series,
        order: Order,
        pooling: Pooling,
        workspace: &mut Workspace,
        out: &mut [f32],
    ) {
        assert_eq!(
            out.len(),
            self.len() * pooling.ways(),
            "features of a series"
        );
        // Compiled once for each vector width of processors.
        pulp::Arch::new().dispatch(Transform {
            kernels: self,
            series,
            order,
            pooling,
            workspace,
            out,
        });
    }

    #[inline(always)]
    fn transform_inner(
        &self,
        series: &Series,
        order: Order,
        pooling: Pooling,
        workspace: &mut Workspace,
        out: &mut [f32],
    ) {
        let all = self.len();
        let mut feature = 0;
        for (index, (&dilation, &biases)) in self
            .dilations
            .iter()
            .zip(&self.biases_per_kernel)
            .enumerate()
        {
            let dilation = fitting(dilation, series);
            workspace.prepare(series, dilation, order);
            let padding = (TAPS / 2) * dilation;
            for kernel in 0..KERNELS {
                let taxels = &self.taxels[index * KERNELS + kernel];
                // Every second kernel skips the steps at which it reaches beyond the series.
                let steps = if (index + kernel) % 2 == 0 {
                    0..series.steps()
                } else {
                    padding..series.steps() - padding
                };
                workspace.convolve(taxels, kernel, steps);
                let of_kernel = feature..feature + biases;
                match pooling {
                    Pooling::Share => workspace
                        .result
                        .shares(&self.biases[of_kernel.clone()], &mut out[of_kernel]),
                    Pooling::FourWays => {
                        for position in of_kernel {
                            let bias = self.biases[position];
                            let ways = pooling::four_ways(
                                workspace.result.steps(),
                                bias,
                                &mut workspace.below,
                            );
                            for (way, value) in ways.into_iter().enumerate() {
                                out[way * all + position] = value;
                            }
                        }
                    }
                }
                feature += biases;
            }
        }
    }
}

/// Arguments of [`Kernels::transform`]. A closure is too large to be inlined into the dispatch, and would then run without the selected vector
/// instructions.
struct Transform<'a> {
    kernels: &'a Kernels,
    series: &'a Series,
    order: Order,
    pooling: Pooling,
    workspace: &'a mut Workspace,
    out: &'a mut [f32],
}

impl pulp::NullaryFnOnce for Transform<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.kernels.transform_inner(
            self.series,
            self.order,
            self.pooling,
            self.workspace,
            self.out,
        );
    }
}

/// Returns a dilation with which a kernel fits into a series: `dilation`, or the largest possible one of a shorter series.
fn fitting(dilation: usize, series: &Series) -> usize {
    let most = series.steps().saturating_sub(1) / (TAPS - 1);
    dilation.min(most.max(1))
}

/// Returns all choices of the three taps with weight 2, in lexicographic order.
const fn heavy_taps() -> [[usize; 3]; KERNELS] {
    let mut all = [[0; 3]; KERNELS];
    let mut next = 0;
    let mut a = 0;
    while a < TAPS {
        let mut b = a + 1;
        while b < TAPS {
            let mut c = b + 1;
            while c < TAPS {
                all[next] = [a, b, c];
                next += 1;
                c += 1;
            }
            b += 1;
        }
        a += 1;
    }
    all
}

static HEAVY_TAPS: [[usize; 3]; KERNELS] = heavy_taps();

/// Returns the distinct dilations from 1 to `(steps - 1) / 8` with equally spaced exponents, and the number of biases of each per kernel.
fn spaced_dilations(steps: usize, features: usize) -> (Vec<usize>, Vec<usize>) {
    let per_kernel = (features / KERNELS).max(1);
    let count = per_kernel.min(MAX_DILATIONS);
    let multiplier = per_kernel as f64 / count as f64;
    let largest = ((steps - 1) as f64 / (TAPS - 1) as f64).log2();
    let mut dilations: Vec<usize> = Vec::new();
    let mut biases: Vec<usize> = Vec::new();
    for i in 0..count {
        let exponent = if count == 1 {
            0.0
        } else if i + 1 == count {
            largest
        } else {
            i as f64 * (largest / (count - 1) as f64)
        };
        let dilation = exponent.exp2() as usize;
        if dilations.last() == Some(&dilation) {
            if let Some(last) = biases.last_mut() {
                *last += 1;
            }
        } else {
            dilations.push(dilation);
            biases.push(1);
        }
    }
    for count in &mut biases {
        *count = (*count as f64 * multiplier) as usize;
    }
    let missing = per_kernel.saturating_sub(biases.iter().sum());
    let kinds = biases.len();
    for i in 0..missing {
        biases[i % kinds] += 1;
    }
    (dilations, biases)
}

/// Returns the `n`th number of the golden-ratio sequence in `[0, 1)`.
fn low_discrepancy(n: usize) -> f64 {
    f64::from((n as f64 * f64::midpoint(5.0_f64.sqrt(), 1.0)).fract() as f32)
}

/// Returns a quantile with linear interpolation between order statistics, as `numpy.quantile`.
fn quantile(sorted: &[f32], share: f64) -> f32 {
    let place = share * (sorted.len() - 1) as f64;
    let low = place.floor() as usize;
    let high = (low + 1).min(sorted.len() - 1);
    let (a, b) = (f64::from(sorted[low]), f64::from(sorted[high]));
    (a + (b - a) * place.fract()) as f32
}

/// Intermediate results of one series at one dilation, reused between series to avoid allocation.
#[derive(Default)]
pub(crate) struct Workspace {
    steps: usize,
    /// Number of zeros on either side of a padded series.
    padding: usize,
    /// Three times the padded series, `[taxels][padding + steps + padding]`.
    tripled: Vec<f32>,
    /// Negative sum over all taps, `[taxels][steps]`.
    light: Vec<f32>,
    /// Position that each tap reads relative to its step, plus `padding`.
    offsets: [usize; TAPS],
    /// Sum of `tripled` over the taxels of one kernel, `[padding + steps + padding]`.
    tripled_sum: Vec<f32>,
    result: KernelResult,
    below: Vec<u8>,
}

impl Workspace {
    #[inline(always)]
    fn prepare(&mut self, series: &Series, dilation: usize, order: Order) {
        let steps = series.steps();
        self.steps = steps;
        self.padding = (TAPS / 2) * dilation;
        let shift = usize::from(order == Order::Difference);
        for (tap, offset) in self.offsets.iter_mut().enumerate() {
            *offset = tap * dilation + if tap < TAPS / 2 { shift } else { 0 };
        }
        let padded = steps + 2 * self.padding;
        self.tripled.clear();
        self.tripled.resize(series.taxels() * padded, 0.0);
        self.light.clear();
        self.light.resize(series.taxels() * steps, 0.0);
        self.tripled_sum.clear();
        self.tripled_sum.resize(padded, 0.0);
        for taxel in 0..series.taxels() {
            let values = series.taxel(taxel);
            let tripled = &mut self.tripled[taxel * padded..][..padded];
            for (out, value) in tripled[self.padding..].iter_mut().zip(values) {
                *out = 3.0 * value;
            }
            let light = &mut self.light[taxel * steps..][..steps];
            for offset in self.offsets {
                // A third of the tripled series would be rounded, so this reads the series itself.
                let first = self.padding.saturating_sub(offset);
                let last = (steps + self.padding).saturating_sub(offset).min(steps);
                if first < last {
                    let read = &values[first + offset - self.padding..];
                    for (out, value) in light[first..last].iter_mut().zip(read) {
                        *out -= value;
                    }
                }
            }
        }
    }

    /// Computes the kernel's result at `steps`.
    #[inline(always)]
    fn convolve(&mut self, taxels: &[usize], kernel: usize, steps: Range<usize>) {
        let padded = self.steps + 2 * self.padding;
        let inside = self.padding..self.padding + self.steps;
        let tripled_of = |taxel: usize| &self.tripled[taxel * padded..][..padded];
        let tripled = match *taxels {
            [taxel] => tripled_of(taxel),
            _ => {
                // The padding stays zero.
                sum_rows(&mut self.tripled_sum[inside.clone()], taxels, |taxel| {
                    &tripled_of(taxel)[inside.clone()]
                });
                &self.tripled_sum
            }
        };
        let out = self.result.resize(steps.len());
        sum_rows(out, taxels, |taxel| {
            &self.light[taxel * self.steps..][..self.steps][steps.clone()]
        });
        let [a, b, c] = HEAVY_TAPS[kernel]
            .map(|tap| &tripled[self.offsets[tap] + steps.start..][..steps.len()]);
        for (((out, a), b), c) in out.iter_mut().zip(a).zip(b).zip(c) {
            *out = *out + a + b + c;
        }
    }
}

/// Sums rows, up to four at a time.
#[inline(always)]
fn sum_rows<'a>(out: &mut [f32], rows: &[usize], row: impl Fn(usize) -> &'a [f32]) {
    let (first, mut rest) = rows.split_at(rows.len().min(4));
    match *first {
        [a, b, c, d] => {
            for ((((out, a), b), c), d) in out
                .iter_mut()
                .zip(row(a))
                .zip(row(b))
                .zip(row(c))
                .zip(row(d))
            {
                *out = a + b + c + d;
            }
        }
        [a, b, c] => {
            for (((out, a), b), c) in out.iter_mut().zip(row(a)).zip(row(b)).zip(row(c)) {
                *out = a + b + c;
            }
        }
        [a, b] => {
            for ((out, a), b) in out.iter_mut().zip(row(a)).zip(row(b)) {
                *out = a + b;
            }
        }
        [a] => out.copy_from_slice(row(a)),
        _ => out.fill(0.0),
    }
    while let [a, more @ ..] = rest {
        if let [b, more @ ..] = more {
            for ((out, a), b) in out.iter_mut().zip(row(*a)).zip(row(*b)) {
                *out = *out + a + b;
            }
            rest = more;
        } else {
            for (out, a) in out.iter_mut().zip(row(*a)) {
                *out += a;
            }
            rest = more;
        }
    }
}

#[cfg(test)]
mod tests;
