//! Partial sums of the weights' gradient and their total.

use rayon::prelude::*;

use super::{FirstLayer, MAX_KERNEL};

/// Number of sums that a thread computes at once.
const RUN: usize = 1 << 11;

/// Partial sums over a few sweeps.
pub(crate) struct Share {
    /// `[maps_out, MAX_KERNEL[0], 8]`: sums of gradient times patch over the winners
    pub(crate) sparse: Vec<f32>,
    /// `[time distance, 1 + edges, kernel taxels, kernel taxels]`: products of two tap columns over all rows, and over each edge row
    pub(crate) products: Vec<f64>,
    /// `[1 + edges, lanes]`: column sums over all rows and over each edge row
    pub(crate) sums: Vec<f32>,
}

/// Total of all partial sums, added in order.
pub(crate) struct Total {
    pub(crate) sparse: Vec<f64>,
    pub(crate) products: Vec<f64>,
    pub(crate) sums: Vec<f64>,
}

impl Total {
    pub(crate) fn new(plan: &FirstLayer, edges: usize) -> Self {
        let shape = &plan.shape;
        let [kernel_steps, kernel_taxels] = shape.kernel;
        Self {
            sparse: vec![0.0; shape.maps_out * MAX_KERNEL[0] * 8],
            products: vec![0.0; kernel_steps * (1 + edges) * kernel_taxels * kernel_taxels],
            sums: vec![0.0; (1 + edges) * plan.lanes()],
        }
    }

    /// Returns a share of the same lengths, with sums of zero.
    pub(crate) fn empty_share(&self) -> Share {
        Share {
            sparse: vec![0.0; self.sparse.len()],
            products: vec![0.0; self.products.len()],
            sums: vec![0.0; self.sums.len()],
        }
    }

    pub(crate) fn add(&mut self, shares: &[Share]) {
        add_all(&mut self.sparse, shares, |share| &share.sparse);
        add_all(&mut self.products, shares, |share| &share.products);
        add_all(&mut self.sums, shares, |share| &share.sums);
    }
}

fn add_all<T: Copy + Into<f64> + Sync>(
    total: &mut [f64],
    shares: &[Share],
    part: impl Fn(&Share) -> &[T] + Sync,
) {
    total
        .par_chunks_mut(RUN)
        .enumerate()
        .for_each(|(run, total)| {
            for share in shares {
                let values = &part(share)[run * RUN..][..total.len()];
                for (total, &value) in total.iter_mut().zip(values) {
                    *total += value.into();
                }
            }
        });
}
