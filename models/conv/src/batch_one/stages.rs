//! Kernels of the single-sweep route: spectra of two taxels from one transform, its inverse, and pooling.

use crate::pooling::{Goal, Window, WindowMaps, pool_column};
use crate::shape::BlockShape;
use crate::simd::{Kernel, Lanes, Octet};
use crate::spectral::plan::Plan;

/// Layout of the spectra of two signals.
pub(crate) struct Spectra {
    /// Octets from one frequency to the next.
    pub(crate) stride: usize,
    /// Index of each signal's real part at frequency zero.
    pub(crate) firsts: [usize; 2],
    /// Octets from a real part to its imaginary part.
    pub(crate) imaginary: usize,
}

/// Separation of two real signals' spectra from the transform that holds them as real and imaginary part.
pub(crate) struct Untangle<'a> {
    /// `[length, 2, vector]`
    pub(crate) both: &'a [Octet],
    pub(crate) length: usize,
    /// Half of the factor applied to both spectra.
    pub(crate) scale: f32,
    pub(crate) to: Spectra,
    pub(crate) target: &'a mut [Octet],
}

impl Kernel for Untangle<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Spectra {
            stride,
            firsts: [a, b],
            imaginary,
        } = self.to;
        let scale = L::splat(self.scale);
        for f in 0..=self.length / 2 {
            let [re, im] = element::<L>(self.both, f, scale);
            let mirrored = (self.length - f) % self.length;
            let [other_re, other_im] = element::<L>(self.both, mirrored, scale);
            let at = f * stride;
            re.add(other_re).store(self.target, at + a);
            im.sub(other_im).store(self.target, at + a + imaginary);
            im.add(other_im).store(self.target, at + b);
            other_re.sub(re).store(self.target, at + b + imaginary);
        }
    }
}

/// Returns the scaled real and imaginary part at one frequency.
#[inline(always)]
fn element<L: Lanes>(both: &[Octet], f: usize, scale: L) -> [L; 2] {
    let at = f * 2 * L::OCTETS;
    [
        L::load(both, at).mul(scale),
        L::load(both, at + L::OCTETS).mul(scale),
    ]
}

/// Combination of two spectra into one whose signal holds them as real and imaginary part; inverse of [`Untangle`].
pub(crate) struct Tangle<'a> {
    pub(crate) source: &'a [Octet],
    pub(crate) from: Spectra,
    pub(crate) length: usize,
    /// `[length, 2, vector]`
    pub(crate) both: &'a mut [Octet],
}

impl Kernel for Tangle<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Spectra {
            stride,
            firsts: [a, b],
            imaginary,
        } = self.from;
        for f in 0..=self.length / 2 {
            let at = f * stride;
            let a_re = L::load(self.source, at + a);
            let a_im = L::load(self.source, at + a + imaginary);
            let b_re = L::load(self.source, at + b);
            let b_im = L::load(self.source, at + b + imaginary);
            // Where a frequency mirrors itself, the stores below overwrite this one.
            let mirrored = (self.length - f) % self.length * 2 * L::OCTETS;
            a_re.add(b_im).store(self.both, mirrored);
            b_re.sub(a_im).store(self.both, mirrored + L::OCTETS);
            let at = f * 2 * L::OCTETS;
            a_re.sub(b_im).store(self.both, at);
            a_im.add(b_re).store(self.both, at + L::OCTETS);
        }
    }
}

/// Pooling of all windows of one block of maps.
pub(crate) struct Pool<'a> {
    pub(crate) plan: &'a Plan,
    /// `[steps, taxels, block]`
    pub(crate) maps: &'a [Octet],
    pub(crate) goal: Goal<'a>,
    /// `[pooled_steps, taxels, block's maps]`
    pub(crate) outputs: &'a mut [f32],
}

impl Kernel for Pool<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let BlockShape { taxels, pool, .. } = self.plan.shape;
        let block = self.plan.out_block;
        // Positions and statistics are computed but not used.
        let mut positions = vec![0; taxels * 8 * block];
        let mut sums = vec![Octet::ZERO; 3 * block];
        let windows = self.maps.chunks(pool * taxels * block);
        for (tile, outputs) in windows.zip(self.outputs.chunks_exact_mut(taxels * 8 * block)) {
            let mut to = Window {
                winners: outputs,
                positions: &mut positions,
                sums: &mut sums,
                columns: block,
            };
            for v in (0..block).step_by(L::OCTETS) {
                let maps = WindowMaps {
                    values: tile,
                    row: taxels * block,
                    columns: block,
                    first: v,
                };
                pool_column::<L>(maps, taxels, self.goal, &mut to, v);
            }
        }
    }
}
