//! Winners of a sweep with a gradient, and their part of the weights' gradient.

use super::{FirstLayer, MAX_KERNEL};
use crate::buffers::{Buffers, MAX_KEPT};
use crate::norm::OutputGradient;
use crate::simd::{Narrow, NarrowKernel, Octet};

/// Pool of winner lists.
pub(crate) static WINNERS: Buffers<Vec<Winner>> = Buffers::at_most(MAX_KEPT);

/// Winner with a gradient: the gradient times `ka`, and the padded row where its patch begins.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Winner {
    pub(crate) gradient: f32,
    pub(crate) row: u32,
}

/// Winners of one sweep with non-zero gradient, by taxel and map.
///
/// The patches of one taxel's winners lie in the same few columns of the sweep. These columns are copied, one octet per row, so that
/// patches are whole consecutive octets in the L1 cache.
pub(crate) struct Winners {
    /// `[taxels, maps_out, pooled_steps]`; the first `counts` entries of each map are winners
    pub(crate) all: Vec<Winner>,
    /// `[taxels, maps_out]`
    counts: Vec<usize>,
    maps: usize,
}

impl Winners {
    /// Iterates over taxels and, for each, over the winners of every map.
    pub(crate) fn by_taxel(&self) -> impl Iterator<Item = impl Iterator<Item = &[Winner]>> {
        let windows = self.all.len() / self.counts.len();
        let taxels = self.all.chunks_exact(windows * self.maps);
        taxels
            .zip(self.counts.chunks_exact(self.maps))
            .map(move |(winners, counts)| {
                let maps = winners.chunks_exact(windows).zip(counts);
                maps.map(|(winners, &count)| &winners[..count])
            })
    }
}

impl FirstLayer {
    /// Returns the winners of sweep `sweep` that have a gradient.
    pub(crate) fn winners(&self, sweep: usize, output: OutputGradient<'_>) -> Winners {
        let shape = &self.shape;
        let cells = shape.pooled_steps() * shape.taxels;
        let mut found = Winners {
            all: self.winners.take(shape.maps_out * cells),
            counts: vec![0; shape.taxels * shape.maps_out],
            maps: shape.maps_out,
        };
        let span = sweep * cells * shape.maps_out..(sweep + 1) * cells * shape.maps_out;
        let rows = output.gradient[span.clone()].chunks_exact(shape.maps_out);
        let windows = shape.pooled_steps();
        for (cell, (gradients, positions)) in rows
            .zip(output.positions[span].chunks_exact(shape.maps_out))
            .enumerate()
        {
            let (first, taxel) = (cell / shape.taxels * shape.pool, cell % shape.taxels);
            let maps = taxel * shape.maps_out..(taxel + 1) * shape.maps_out;
            let all = &mut found.all[maps.start * windows..maps.end * windows];
            let lists = all.chunks_exact_mut(windows).zip(&mut found.counts[maps]);
            for (((&gradient, &position), ka), (winners, count)) in gradients
                .iter()
                .zip(positions)
                .zip(&output.affine.ka)
                .zip(lists)
            {
                // Every winner is written, but counted only if its gradient is not zero. About half are zero, so a branch would be mispredicted.
                winners[*count] = Winner {
                    gradient: gradient * ka,
                    row: (first + usize::from(position)) as u32,
                };
                *count += usize::from(gradient != 0.0);
            }
        }
        found
    }
}

/// Computation of the sums of `gradient * patch` for each map.
pub(crate) struct Gather<'a> {
    pub(crate) corner: usize,
    /// Number of values in a padded row.
    pub(crate) row: usize,
    pub(crate) padded: &'a [f32],
    /// `[rows of the padded sweep]`: eight columns around one taxel
    pub(crate) columns: &'a mut [Octet],
    pub(crate) winners: &'a Winners,
    pub(crate) out: &'a mut [f32],
}

impl NarrowKernel for Gather<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Narrow>(self) {
        for (taxel, winners) in self.winners.by_taxel().enumerate() {
            let rows = self.padded[self.corner + taxel..].chunks(self.row);
            for (row, columns) in rows.zip(self.columns.iter_mut()) {
                if let Some(values) = row.first_chunk::<8>() {
                    columns.0 = *values;
                }
            }
            for (winners, out) in winners.zip(self.out.chunks_exact_mut(MAX_KERNEL[0] * 8)) {
                let (out, _) = out.as_chunks_mut::<8>();
                let Some(out) = out.first_chunk_mut::<{ MAX_KERNEL[0] }>() else {
                    continue;
                };
                let mut sums = [L::splat(0.0); MAX_KERNEL[0]];
                for row in 0..MAX_KERNEL[0] {
                    sums[row] = L::load_slice(&out[row]);
                }
                for winner in winners {
                    let rows = &self.columns[winner.row as usize..];
                    let Some(patch) = rows.first_chunk::<{ MAX_KERNEL[0] }>() else {
                        continue;
                    };
                    let gradient = L::splat(winner.gradient);
                    for row in 0..MAX_KERNEL[0] {
                        sums[row] = gradient.mul_add(L::load(patch, row), sums[row]);
                    }
                }
                for row in 0..MAX_KERNEL[0] {
                    sums[row].store_slice(&mut out[row]);
                }
            }
        }
    }
}
