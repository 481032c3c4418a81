//! Real Fourier transforms over the few taxels, as dense products, one vector of maps at a time.
//!
//! Positions count from the middle of the taxel row, `u = w - (taxels - 1) / 2`. So every pair `+-u` contributes its sum times a cosine and
//! its difference times a sine, with half of the multiplications. The middle may lie between two taxels; this adds the same phase
//! before and after a convolution, so products of spectra are unaffected. Since values are real, only frequencies `0 ..= length / 2` are kept.

use super::bands::Bands;
use super::simd::{Lanes, Octet, prefetch};

/// Maximum number of taxels of a plan.
pub(super) const MAX_TAXELS: usize = 32;
/// Supported numbers of taxel pairs that are handled together; other rows are padded with zero pairs.
///
/// Sums and differences of eight pairs fill sixteen registers.
const PAIRS: [usize; 5] = [1, 5, 8, 12, MAX_TAXELS / 2];

/// Calls a function that is generic over the number of pairs.
macro_rules! with_pairs {
    ($plan:ident, $function:ident::<$lanes:ident>($($argument:expr),*)) => {
        match $plan.padded_pairs() {
            1 => $plan.$function::<$lanes, 1>($($argument),*),
            5 => $plan.$function::<$lanes, 5>($($argument),*),
            8 => $plan.$function::<$lanes, 8>($($argument),*),
            12 => $plan.$function::<$lanes, 12>($($argument),*),
            _ => $plan.$function::<$lanes, { MAX_TAXELS / 2 }>($($argument),*),
        }
    };
}

/// Returns the number of pairs that a row of `taxels` is padded to.
pub(super) fn padded_pairs(taxels: usize) -> usize {
    let pairs = taxels.div_ceil(2);
    let fitting = PAIRS.into_iter().find(|&padded| pairs <= padded);
    fitting.unwrap_or(pairs)
}

/// Reads the values of one row of taxels.
///
/// It is a trait, not a closure, because only functions can be forced inline, which compiles them with the kernel's instruction set.
pub(super) trait Source<L> {
    fn at(&self, taxel: usize) -> L;
}

/// Writes the values of one row of taxels.
pub(super) trait Sink<L> {
    fn put(&mut self, taxel: usize, value: L);
}

/// Symmetry of the time spectrum at one taxel frequency.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mirror {
    /// No symmetry.
    Free,
    /// Real in time: `z(-s) = conj z(s)`.
    Real,
    /// Imaginary in time: `z(-s) = -conj z(s)`.
    Imaginary,
}

/// Tables for one row width and kernel width.
#[derive(Debug, Clone)]
pub(super) struct TaxelPlan {
    taxels: usize,
    length: usize,
    /// `[frequency, pair, 2]`: cosine, minus sine
    forward: Vec<Octet>,
    /// `[2, frequency, pair]`: the same factors times the inverse transform's weights
    inverse: Vec<Octet>,
    /// `[frequency, lag, 2]` for lags 0 ..= pad
    kernel: Vec<[f32; 2]>,
    /// Number of taps on either side of the kernel's middle.
    pad: usize,
    scale: f32,
}

impl TaxelPlan {
    /// Creates tables for bands of taxels and kernels of `2 pad + 1` taxels; `None` if a band is too wide.
    ///
    /// The inverse transform also multiplies by `scale`. A whole row is padded with zeros. A band of a longer row is not, because
    /// only inputs outside its outputs wrap around.
    pub(super) fn new(bands: &Bands, pad: usize, scale: f64) -> Option<Self> {
        let taxels = bands.width;
        let length = taxels + if bands.is_cut() { 0 } else { pad };
        if taxels > MAX_TAXELS {
            return None;
        }
        let half = if taxels.is_multiple_of(2) { 0.5 } else { 0.0 };
        let splat = |value: f64| Octet([value as f32; 8]);
        let angle = |f: usize, u: f64| std::f64::consts::TAU * f as f64 * u / length as f64;
        let (mut forward, mut inverse, mut kernel) = (Vec::new(), Vec::new(), Vec::new());
        let pairs = padded_pairs(taxels);
        for f in 0..=length / 2 {
            for pair in 0..pairs {
                let angle = angle(f, pair as f64 + half);
                forward.extend([splat(angle.cos()), splat(-angle.sin())]);
            }
            for lag in 0..=pad {
                kernel.push([
                    angle(f, lag as f64).cos() as f32,
                    -angle(f, lag as f64).sin() as f32,
                ]);
            }
        }
        let plan = Self {
            taxels,
            length,
            forward,
            inverse: Vec::new(),
            kernel,
            pad,
            scale: scale as f32,
        };
        let parts: [fn(f64) -> f64; 2] = [f64::cos, |angle| -angle.sin()];
        for part in parts {
            for f in 0..=length / 2 {
                let weight = f64::from(plan.weight(f));
                let angles = (0..pairs).map(|pair| angle(f, pair as f64 + half));
                inverse.extend(angles.map(|angle| splat(weight * part(angle))));
            }
        }
        Some(Self { inverse, ..plan })
    }

    /// Returns the number of frequencies.
    pub(super) fn frequencies(&self) -> usize {
        self.length / 2 + 1
    }

    pub(super) fn kernel_taxels(&self) -> usize {
        2 * self.pad + 1
    }

    fn pairs(&self) -> usize {
        self.taxels.div_ceil(2)
    }

    #[inline(always)]
    fn padded_pairs(&self) -> usize {
        self.forward.len() / 2 / self.frequencies()
    }

    pub(super) fn mirror(&self, frequency: usize) -> Mirror {
        match frequency {
            0 => Mirror::Real,
            f if 2 * f == self.length && self.taxels.is_multiple_of(2) => Mirror::Imaginary,
            f if 2 * f == self.length => Mirror::Real,
            _ => Mirror::Free,
        }
    }

    /// Returns the weight of a frequency in the inverse transform: two, for itself and its negative, except for zero and Nyquist.
    fn weight(&self, frequency: usize) -> f32 {
        let doubled = if frequency == 0 || 2 * frequency == self.length {
            1.0
        } else {
            2.0
        };
        self.scale * doubled / self.length as f32
    }

    /// Returns the taxels `+-u` of a pair; both are equal in the middle of an odd row.
    #[inline(always)]
    fn ends(&self, pair: usize) -> [usize; 2] {
        let (pairs, even) = (self.pairs(), self.taxels.is_multiple_of(2));
        [
            pairs - 1 - pair,
            if even { pairs + pair } else { pairs - 1 + pair },
        ]
    }

    /// Computes the spectrum of one row: frequency `f` goes to `out[f * stride]` (real) and `out[f * stride + imaginary]`.
    #[inline(always)]
    pub(super) fn forward<L: Lanes>(
        &self,
        values: impl Source<L>,
        out: &mut [Octet],
        stride: usize,
        imaginary: usize,
    ) {
        with_pairs!(self, forward_of::<L>(values, out, stride, imaginary));
    }

    #[inline(always)]
    fn forward_of<L: Lanes, const PAIRS: usize>(
        &self,
        values: impl Source<L>,
        out: &mut [Octet],
        stride: usize,
        imaginary: usize,
    ) {
        let mut sums = [L::splat(0.0); PAIRS];
        let mut differences = [L::splat(0.0); PAIRS];
        for pair in 0..PAIRS {
            if pair >= self.pairs() {
                break;
            }
            let [minus, plus] = self.ends(pair);
            let (a, b) = (values.at(plus), values.at(minus));
            sums[pair] = if plus == minus { a } else { a.add(b) };
            differences[pair] = a.sub(b);
        }
        for (f, table) in self.forward.chunks_exact(2 * PAIRS).enumerate() {
            let mut re = sums[0].mul(L::load_equal(&table[0]));
            let mut im = differences[0].mul(L::load_equal(&table[1]));
            for pair in 1..PAIRS {
                re = sums[pair].mul_add(L::load_equal(&table[2 * pair]), re);
                im = differences[pair].mul_add(L::load_equal(&table[2 * pair + 1]), im);
            }
            re.store(out, f * stride);
            im.store(out, f * stride + imaginary);
        }
    }

    /// Computes one row from its spectrum, in the layout of [`TaxelPlan::forward`]; taxel `w` goes to `put`.
    ///
    /// Cache lines `ahead` octets further are prefetched, unless `ahead` is 0.
    #[inline(always)]
    pub(super) fn inverse<L: Lanes>(
        &self,
        spectrum: &[Octet],
        stride: usize,
        imaginary: usize,
        ahead: usize,
        put: impl Sink<L>,
    ) {
        with_pairs!(
            self,
            inverse_of::<L>(spectrum, stride, imaginary, ahead, put)
        );
    }

    #[inline(always)]
    fn inverse_of<L: Lanes, const PAIRS: usize>(
        &self,
        spectrum: &[Octet],
        stride: usize,
        imaginary: usize,
        ahead: usize,
        mut put: impl Sink<L>,
    ) {
        let mut even = [L::splat(0.0); PAIRS];
        let mut odd = [L::splat(0.0); PAIRS];
        let (table, _) = self.inverse.as_chunks::<PAIRS>();
        let (cosines, sines) = table.split_at(self.frequencies());
        for (f, cosines) in cosines.iter().enumerate() {
            let re = L::load(spectrum, f * stride);
            if ahead > 0 {
                prefetch(spectrum.as_ptr().wrapping_add(f * stride + ahead));
                prefetch(
                    spectrum
                        .as_ptr()
                        .wrapping_add(f * stride + imaginary + ahead),
                );
            }
            for pair in 0..PAIRS {
                even[pair] = re.mul_add(L::load_equal(&cosines[pair]), even[pair]);
            }
        }
        for (f, sines) in sines.iter().enumerate() {
            let im = L::load(spectrum, f * stride + imaginary);
            for pair in 0..PAIRS {
                odd[pair] = im.mul_add(L::load_equal(&sines[pair]), odd[pair]);
            }
        }
        for pair in 0..PAIRS {
            if pair >= self.pairs() {
                break;
            }
            let [minus, plus] = self.ends(pair);
            if minus != plus {
                put.put(minus, even[pair].sub(odd[pair]));
            }
            put.put(plus, even[pair].add(odd[pair]));
        }
    }

    fn kernel_row(&self, frequency: usize) -> &[[f32; 2]] {
        &self.kernel[frequency * (self.pad + 1)..(frequency + 1) * (self.pad + 1)]
    }

    /// Returns frequency `f` of a kernel row, given as taps of a cross-correlation, one vector each: the convolution's lags are the reversed taps.
    #[inline(always)]
    pub(super) fn kernel<L: Lanes>(&self, frequency: usize, taps: &[Octet]) -> [L; 2] {
        let table = self.kernel_row(frequency);
        let tap = |tap: usize| L::load(taps, tap * L::OCTETS);
        let (mut re, mut im) = (tap(self.pad), L::splat(0.0));
        for lag in 1..=self.pad {
            let (plus, minus) = (tap(self.pad - lag), tap(self.pad + lag));
            re = plus.add(minus).mul_add(L::splat(table[lag][0]), re);
            im = plus.sub(minus).mul_add(L::splat(table[lag][1]), im);
        }
        [re, im]
    }

    /// Adds frequency `f` of a kernel's gradient, real and imaginary part, to the gradients of the taps.
    #[inline(always)]
    pub(super) fn add_kernel_inverse<L: Lanes>(
        &self,
        frequency: usize,
        [re, im]: [L; 2],
        taps: &mut [Octet],
    ) {
        let table = self.kernel_row(frequency);
        let weight = L::splat(self.weight(frequency));
        let (re, im) = (re.mul(weight), im.mul(weight));
        let mut add = |tap: usize, value: L| {
            let at = tap * L::OCTETS;
            L::load(taps, at).add(value).store(taps, at);
        };
        add(self.pad, re);
        for lag in 1..=self.pad {
            let (even, odd) = (
                re.mul(L::splat(table[lag][0])),
                im.mul(L::splat(table[lag][1])),
            );
            add(self.pad - lag, even.add(odd));
            add(self.pad + lag, even.sub(odd));
        }
    }
}
