//! Sizes, transforms and row tables of the spectral route.

use rayon::prelude::*;

use crate::bands::Bands;
use crate::cost::Tiling;
use crate::fft::TimePlan;
use crate::shape::BlockShape;
use crate::simd::{Isa, NOWHERE, Octet, Table};
use crate::taxel::{Mirror, TaxelPlan};

/// Sizes, transforms and row tables.
#[derive(Debug)]
pub(crate) struct Plan {
    pub(crate) shape: BlockShape,
    pub(crate) isa: Isa,
    pub(crate) time: TimePlan,
    pub(crate) taxel: TaxelPlan,
    /// Division of the taxels; bands are transformed separately.
    pub(crate) bands: Bands,
    /// Division of the steps; ranges are transformed separately.
    pub(crate) ranges: Bands,
    /// Octets of input maps.
    pub(crate) ins: usize,
    /// Octets of output maps.
    pub(crate) outs: usize,
    /// Octets of input maps per vector.
    pub(crate) in_group: usize,
    /// Octets of output maps per vector.
    pub(crate) out_group: usize,
    /// Octets of input maps per block; blocks are processed one after another, so that their spectra stay in a core's cache.
    pub(crate) in_block: usize,
    /// Octets of output maps per block, one or more vectors.
    pub(crate) out_block: usize,
    /// Steps that a part reads, as rows of the transform.
    pub(crate) seen: Table,
    /// Steps that a part computes, as rows of the transform.
    pub(crate) steps: Table,
    /// Kernel taps, as rows of the transform.
    pub(crate) taps: Table,
    /// All time frequencies.
    pub(crate) all: Table,
    /// Time frequencies that do not mirror another.
    pub(crate) half: Table,
}

/// Returns the octets of a block: two, which fill a cache line and the product's registers, or one if `octets` is odd.
fn block_of(octets: usize) -> usize {
    if octets.is_multiple_of(2) { 2 } else { 1 }
}

/// Returns the index of octet `v` in blocks of `block` octets that each span `span` octets.
#[inline(always)]
pub(crate) fn in_blocks(v: usize, block: usize, span: usize) -> usize {
    v / block * span + v % block
}

/// Iterates over each row's successor; the last row has an empty one.
pub(crate) fn following<'a>(
    rows: impl Iterator<Item = &'a [Octet]>,
) -> impl Iterator<Item = &'a [Octet]> {
    rows.skip(1).chain(std::iter::once(&[][..]))
}

/// Returns octets per time frequency with padding, since strides of powers of two collide in few cache sets.
pub(crate) fn padded(octets: usize) -> usize {
    octets + 2
}

impl Plan {
    /// Returns `None` unless both counts of maps are multiples of eight and [`TaxelPlan`] supports the kernel.
    pub(crate) fn tiled(shape: BlockShape, isa: Isa, tiling: Tiling) -> Option<Self> {
        let [pad_steps, pad_taxels] = shape.padding();
        if !shape.maps_in.is_multiple_of(8) || !shape.maps_out.is_multiple_of(8) {
            return None;
        }
        let Tiling { bands, ranges } = tiling;
        let time = TimePlan::at_least(tiling.least_length(&shape));
        let length = time.length();
        let taxel = TaxelPlan::new(&bands, pad_taxels, 1.0 / length as f64)?;
        let row = |inside: bool, row: usize| if inside { row as u32 } else { NOWHERE };
        let taps = |t: usize| {
            // Lag t (or t - length) is tap pad - lag of the cross-correlation.
            let tap = if t <= pad_steps {
                pad_steps - t
            } else {
                pad_steps + length - t
            };
            row(tap < shape.kernel[0], tap)
        };
        Some(Self {
            ins: shape.maps_in / 8,
            outs: shape.maps_out / 8,
            in_group: isa.group(shape.maps_in / 8),
            out_group: isa.group(shape.maps_out / 8),
            in_block: block_of(shape.maps_in / 8),
            out_block: block_of(shape.maps_out / 8),
            seen: Table::new((0..length).map(|t| row(t < ranges.width, t))),
            steps: Table::new((0..length).map(|t| {
                let step = t.wrapping_sub(ranges.margin());
                row(step < ranges.span, step)
            })),
            taps: Table::new((0..length).map(taps)),
            all: Table::new((0..length).map(|s| row(true, s))),
            half: Table::new((0..length).map(|s| row(s <= length / 2, s))),
            shape,
            isa,
            time,
            taxel,
            bands,
            ranges,
        })
    }

    /// Returns the octets between the stages.
    pub(crate) fn between(&self) -> usize {
        let Bands { width, span, .. } = self.ranges;
        self.parts() * self.taxel.frequencies() * 2 * (width * self.ins + span * self.outs)
    }

    /// Returns the number of parts in a sweep: the ranges of steps of all bands.
    pub(crate) fn parts_of_sweep(&self) -> usize {
        self.bands.count() * self.ranges.count()
    }

    /// Returns the number of parts in the batch, which the transforms treat as separate sweeps.
    pub(crate) fn parts(&self) -> usize {
        self.shape.batch * self.parts_of_sweep()
    }

    /// Returns sweep, band and range of a part.
    pub(crate) fn place(&self, part: usize) -> (usize, usize, usize) {
        let (bands, ranges) = (self.bands.count(), self.ranges.count());
        (part / ranges / bands, part / ranges % bands, part % ranges)
    }

    /// Returns the octets per time frequency of a column's inputs, `[parts, 2, maps_in]`.
    pub(crate) fn input_stride(&self) -> usize {
        padded(self.parts() * 2 * self.ins)
    }

    /// Returns the octets per time frequency of a block of outputs, `[parts, 2, block]`.
    pub(crate) fn output_stride(&self) -> usize {
        padded(self.parts() * 2 * self.out_block)
    }

    /// Returns the octets per time frequency of a block of weights, `[maps_in, 2, block]`.
    pub(crate) fn weight_stride(&self) -> usize {
        padded(self.shape.maps_in * 2 * self.out_block)
    }

    /// Returns the number of blocks of output maps.
    pub(crate) fn out_blocks(&self) -> usize {
        self.outs / self.out_block
    }

    /// Returns the octets of a column of weights, `[block, time frequency, maps_in, 2, block's octets]`.
    pub(crate) fn weight_column(&self) -> usize {
        self.out_blocks() * self.time.length() * self.weight_stride()
    }

    /// Returns the time frequencies to multiply in a column, as a table of rows.
    pub(crate) fn wanted(&self, column: usize) -> &Table {
        if self.taxel.mirror(column) == Mirror::Free {
            &self.all
        } else {
            &self.half
        }
    }

    /// Computes the mirrored half of a column's spectrum.
    pub(crate) fn mirror(
        &self,
        mirror: Mirror,
        spectrum: &mut [Octet],
        stride: usize,
        parts: usize,
    ) {
        let (re, im) = match mirror {
            Mirror::Free => return,
            Mirror::Real => (1.0, -1.0),
            Mirror::Imaginary => (-1.0, 1.0),
        };
        let length = self.time.length();
        for s in length / 2 + 1..length {
            let (low, high) = spectrum.split_at_mut(s * stride);
            let from = low[(length - s) * stride..].chunks_exact(2 * parts);
            for (to, from) in high[..stride].chunks_exact_mut(2 * parts).zip(from) {
                for part in 0..parts {
                    to[part].0 = from[part].0.map(|value| re * value);
                    to[parts + part].0 = from[parts + part].0.map(|value| im * value);
                }
            }
        }
    }
}

/// Reorders weights from `[out][in][tap]` to `[group of out octets][in][tap]` vectors of `group` octets.
pub(crate) fn by_group(weight: &[f32], row: usize, group: usize, out: &mut [Octet]) {
    out.par_chunks_exact_mut(row * group)
        .zip(weight.par_chunks_exact(8 * row * group))
        .for_each(|(out, weight)| {
            for (at, out) in out.iter_mut().enumerate() {
                let (at, first) = (at / group, at % group * 8);
                for (lane, value) in out.0.iter_mut().enumerate() {
                    *value = weight[(first + lane) * row + at];
                }
            }
        });
}
