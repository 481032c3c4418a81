//! Forward pass of a single sweep with fixed statistics: transforms over time only.
//!
//! Spectra over time and taxels (`spectral.rs`) need the fewest products, but the weights' spectra are large: 27 MB for layers 2 and 3.
//! A batch shares the time to read them; for a single sweep that time dominates. With transforms over time only, a kernel has one spectrum
//! for each of its few taxel taps. Since all values are real, half of the frequencies mirror the others, which leaves 8 MB.
//!
//! At every frequency the convolution over taxels is one complex matrix product whose rows are the sweep's taxels,
//! `[taxels, kernel taxels * maps_in] x [kernel taxels * maps_in, maps_out]`. The left factor needs no copy: the spectra of all taxels are
//! consecutive, between taxels of zeros, and each row begins one taxel later.
//!
//! One complex transform handles two taxels as its real and imaginary part. With `Z = A + iB`, where `A` and `B` are spectra of real signals,
//! `A(f) = (Z(f) + conj Z(-f)) / 2` and `B(f) = (Z(f) - conj Z(-f)) / 2i`.

mod stages;

use rayon::prelude::*;

use super::buffers::{Buffers, OCTETS};
use super::cost::Tiling;
use super::fft::Transform;
use super::pooling::Goal;
use super::product::{Left, Soon};
use super::shape::BlockShape;
use super::simd::{Isa, NOTHING, Octet, Octets, Rows, floats, floats_mut};
use super::spare;
use super::spectral::plan::{Plan, by_group, following, padded};
use super::weight::{Remembered, Weight};
use stages::{Pool, Spectra, Tangle, Untangle};

/// Maximum number of steps; longer sweeps are faster in ranges.
const MAX_STEPS: usize = 1024;

/// Plan with cached weight spectra.
#[derive(Debug)]
pub(super) struct BatchOne {
    plan: Plan,
    /// `[block of maps_out, frequency, kernel taxel, maps_in, 2, block's octets]`
    weights: Remembered<Octets>,
    buffers: &'static Buffers<Octets>,
}

/// Returns `0..count` in pairs of neighbours; if `count` is odd, the last pair overlaps the one before.
fn pairs(count: usize) -> impl Iterator<Item = [usize; 2]> {
    let first = move |at: usize| at.min(count - 2);
    (0..count)
        .step_by(2)
        .map(move |at| [first(at), first(at) + 1])
}

impl BatchOne {
    /// Returns `None` unless the batch has one sweep of at most [`MAX_STEPS`] steps, [`Plan::tiled`] supports the shape, and there are at
    /// least two taxels and two kernel taxels.
    pub(super) fn new(shape: BlockShape, isa: Isa) -> Option<Self> {
        if shape.batch != 1 || shape.taxels < 2 || shape.kernel[1] < 2 {
            return None;
        }
        let tiling = Tiling::over_taxels(&shape);
        if shape.steps > MAX_STEPS {
            return None;
        }
        Some(Self {
            plan: Plan::tiled(shape, isa, tiling)?,
            weights: Remembered::default(),
            buffers: &OCTETS,
        })
    }

    /// Convolves, pools and overwrites `out` with the outputs (or winners), `[pooled_steps, taxels, maps_out]`.
    pub(super) fn forward(
        &self,
        input: &[f32],
        weight: &Weight<'_>,
        goal: Goal<'_>,
        out: &mut [f32],
    ) {
        let (shape, block) = (self.plan.shape, self.plan.out_block);
        let weight = self.weights.get_or_make(weight, |before| {
            before.into_iter().for_each(|made| self.buffers.give(made));
            self.weight_spectra(&weight.values())
        });
        let input = self.input_spectra(input);
        let cells = shape.pooled_steps() * shape.taxels;
        let mut found = spare::take(out.len());
        found
            .par_chunks_exact_mut(cells * 8 * block)
            .zip(weight.par_chunks_exact(self.weight_block()))
            .enumerate()
            .for_each(|(at, (found, weight))| {
                self.maps(&input, weight, goal.of_block(at, block), found);
            });
        self.buffers.give(input);
        for (at, found) in found.chunks_exact(cells * 8 * block).enumerate() {
            let rows = out.chunks_exact_mut(shape.maps_out);
            for (to, from) in rows.zip(found.chunks_exact(8 * block)) {
                to[at * 8 * block..][..8 * block].copy_from_slice(from);
            }
        }
        spare::give(found);
    }

    /// Returns the number of frequencies that do not mirror another.
    fn frequencies(&self) -> usize {
        self.plan.time.length() / 2 + 1
    }

    /// Returns the number of taxels including the zeros on either side.
    fn wide(&self) -> usize {
        self.plan.shape.taxels + 2 * self.plan.shape.padding()[1]
    }

    /// Returns the octets per frequency of the input, `[2, taxels with zeros, maps_in]`.
    fn input_stride(&self) -> usize {
        padded(2 * self.wide() * self.plan.ins)
    }

    /// Returns the octets per frequency of a block of weights, `[kernel taxel, maps_in, 2, block]`.
    fn weight_stride(&self) -> usize {
        padded(self.right())
    }

    /// Returns the octets of a product's right factor.
    fn right(&self) -> usize {
        self.plan.shape.kernel[1] * self.plan.shape.maps_in * 2 * self.plan.out_block
    }

    /// Returns the octets of a block of weights.
    fn weight_block(&self) -> usize {
        self.frequencies() * self.weight_stride()
    }

    /// Returns the octets per frequency of a block of products, `[taxels, 2, block]`.
    fn output_stride(&self) -> usize {
        padded(self.plan.shape.taxels * 2 * self.plan.out_block)
    }

    fn weight_spectra(&self, weight: &[f32]) -> Octets {
        let plan = &self.plan;
        let [kernel_steps, kernel_taxels] = plan.shape.kernel;
        let (block, group, maps_in) = (plan.out_block, plan.out_group, plan.shape.maps_in);
        let mut taps = self.buffers.take(weight.len() / 8);
        by_group(weight, weight.len() / plan.shape.maps_out, group, &mut taps);
        let blocks = plan.outs / block;
        let mut spectra = self.buffers.take(blocks * self.weight_block());
        spectra
            .par_chunks_exact_mut(self.weight_block())
            .zip(taps.par_chunks_exact(taps.len() / blocks))
            .for_each(|(spectra, taps)| {
                let mut both = self.buffers.take(2 * plan.time.length() * group);
                let mut scratch = self.buffers.take(plan.time.scratch(2));
                let kernels = taps.chunks_exact(kernel_steps * kernel_taxels * group);
                for (kernel, taps) in kernels.enumerate() {
                    let (v, map) = (kernel / maps_in * group, kernel % maps_in);
                    for pair in pairs(kernel_taxels) {
                        let from = Rows {
                            table: &plan.taps,
                            stride: kernel_taxels * group,
                            parts: pair.map(|tap| tap * group),
                            ahead: NOTHING,
                        };
                        let to = self.both(group);
                        plan.isa.run(
                            plan.outs,
                            Transform {
                                plan: &plan.time,
                                source: taps,
                                from,
                                target: &mut both,
                                to,
                                scratch: &mut scratch,
                            },
                        );
                        let untangle = Untangle {
                            both: &both,
                            length: plan.time.length(),
                            scale: 0.5,
                            to: Spectra {
                                stride: self.weight_stride(),
                                firsts: pair.map(|tap| (tap * maps_in + map) * 2 * block + v),
                                imaginary: block,
                            },
                            target: spectra,
                        };
                        plan.isa.run(plan.outs, untangle);
                    }
                }
                self.buffers.give(both);
                self.buffers.give(scratch);
            });
        self.buffers.give(taps);
        spectra
    }

    /// Returns the spectra of all taxels divided by the transform length, `[frequency, 2, taxels with zeros, maps_in]`.
    fn input_spectra(&self, input: &[f32]) -> Octets {
        let plan = &self.plan;
        let (ins, group, taxels) = (plan.ins, plan.in_group, plan.shape.taxels);
        let pad = plan.shape.padding()[1];
        let mut rows = self.buffers.take(input.len() / 8);
        floats_mut(&mut rows).copy_from_slice(input);
        let mut spectra = self.buffers.take(self.frequencies() * self.input_stride());
        for spectrum in spectra.chunks_exact_mut(self.input_stride()) {
            for part in spectrum.chunks_exact_mut(self.wide() * ins) {
                part[..pad * ins].fill(Octet::ZERO);
                part[(pad + taxels) * ins..].fill(Octet::ZERO);
            }
        }
        let mut both = self.buffers.take(2 * plan.time.length() * group);
        let mut scratch = self.buffers.take(plan.time.scratch(2));
        for v in (0..ins).step_by(group) {
            for pair in pairs(taxels) {
                let from = Rows {
                    table: &plan.steps,
                    stride: taxels * ins,
                    parts: pair.map(|taxel| taxel * ins + v),
                    ahead: NOTHING,
                };
                let to = self.both(group);
                plan.isa.run(
                    ins,
                    Transform {
                        plan: &plan.time,
                        source: &rows,
                        from,
                        target: &mut both,
                        to,
                        scratch: &mut scratch,
                    },
                );
                let untangle = Untangle {
                    both: &both,
                    length: plan.time.length(),
                    scale: 0.5 / plan.time.length() as f32,
                    to: Spectra {
                        stride: self.input_stride(),
                        firsts: pair.map(|taxel| (pad + taxel) * ins + v),
                        imaginary: self.wide() * ins,
                    },
                    target: &mut spectra,
                };
                plan.isa.run(ins, untangle);
            }
        }
        for buffer in [rows, both, scratch] {
            self.buffers.give(buffer);
        }
        spectra
    }

    /// Returns the layout of a pair's spectrum, `[length, 2, vector]`, for vectors of `group` octets.
    fn both(&self, group: usize) -> Rows<'_> {
        Rows {
            table: &self.plan.all,
            stride: 2 * group,
            parts: [0, group],
            ahead: NOTHING,
        }
    }

    /// Computes one block of output maps: products, inverse transform, pooling to `[pooled_steps, taxels, block's maps]`.
    fn maps(&self, input: &[Octet], weight: &[Octet], goal: Goal<'_>, outputs: &mut [f32]) {
        let plan = &self.plan;
        let BlockShape { steps, taxels, .. } = plan.shape;
        let (block, group) = (plan.out_block, plan.out_group);
        let mut products = self.buffers.take(self.frequencies() * self.output_stride());
        self.multiply(input, weight, &mut products);
        let mut maps = self.buffers.take(steps * taxels * block);
        let mut both = self.buffers.take(2 * plan.time.length() * group);
        let mut scratch = self.buffers.take(plan.time.scratch(2));
        for v in (0..block).step_by(group) {
            for pair in pairs(taxels) {
                let tangle = Tangle {
                    source: &products,
                    from: Spectra {
                        stride: self.output_stride(),
                        firsts: pair.map(|taxel| taxel * 2 * block + v),
                        imaginary: block,
                    },
                    length: plan.time.length(),
                    both: &mut both,
                };
                plan.isa.run(block, tangle);
                let from = self.both(group);
                let to = Rows {
                    table: &plan.steps,
                    stride: taxels * block,
                    parts: pair.map(|taxel| taxel * block + v),
                    ahead: NOTHING,
                };
                plan.isa.run(
                    block,
                    Transform {
                        plan: &plan.time,
                        source: &both,
                        from: from.exchanged(),
                        target: &mut maps,
                        to: to.exchanged(),
                        scratch: &mut scratch,
                    },
                );
            }
        }
        let pool = Pool {
            plan,
            maps: &maps,
            goal,
            outputs,
        };
        plan.isa.run(block, pool);
        for buffer in [products, maps, both, scratch] {
            self.buffers.give(buffer);
        }
    }

    /// Computes all products of one block of output maps, `[frequency, taxels, 2, block]`.
    fn multiply(&self, input: &[Octet], weight: &[Octet], products: &mut [Octet]) {
        let plan = &self.plan;
        let (block, maps_in) = (plan.out_block, plan.shape.maps_in);
        let lefts = input.chunks_exact(self.input_stride());
        let rights = weight.chunks_exact(self.weight_stride());
        let nexts = following(lefts.clone()).zip(following(rights.clone()));
        let products = products.chunks_exact_mut(self.output_stride());
        for (((left, right), next), out) in lefts.zip(rights).zip(nexts).zip(products) {
            let left = Left {
                values: floats(left),
                row: maps_in,
                inner: 1,
                imaginary: self.wide() * maps_in,
                soon: Soon {
                    left: floats(next.0),
                    right: next.1,
                },
            };
            left.times(
                plan.isa,
                &right[..self.right()],
                &mut out[..plan.shape.taxels * 2 * block],
                block,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise;
    use crate::pooling::octets;

    fn shape(steps: usize, taxels: usize, maps: [usize; 2], kernel: [usize; 2]) -> BlockShape {
        BlockShape {
            batch: 1,
            steps,
            taxels,
            maps_in: maps[0],
            maps_out: maps[1],
            kernel,
            pool: 10,
        }
    }

    /// `tests/agreement/batch_one.rs` compares the results for these shapes with the reference.
    #[test]
    fn one_sweep_of_multiples_of_eight_maps_takes_this_route() {
        for shape in [
            shape(100, 16, [32, 64], [15, 5]),
            shape(10, 16, [64, 128], [15, 5]),
            shape(23, 5, [16, 24], [5, 3]),
            shape(7, 2, [8, 8], [15, 5]),
            shape(41, 19, [8, 16], [3, 7]),
        ] {
            for isa in Isa::all() {
                assert!(BatchOne::new(shape, isa).is_some());
            }
        }
    }

    #[test]
    fn threads_change_no_bit_of_batch_one() {
        let s = shape(50, 16, [16, 32], [15, 5]);
        let input = noise(s.input_len(), 7);
        let weight: Vec<f32> = noise(s.weight_len(), 8).iter().map(|w| w / 35.0).collect();
        let (gamma, beta) = (noise(s.maps_out, 9), noise(s.maps_out, 10));
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads");
            let mut found = vec![0.0; s.output_len()];
            let block = BatchOne::new(s, Isa::detect()).expect("one sweep's shape");
            let (scale, shift) = (octets(&gamma), octets(&beta));
            let (weight, goal) = (Weight::from(&weight), Goal::outputs(&scale, &shift));
            pool.install(|| block.forward(&input, &weight, goal, &mut found));
            found.into_iter().map(f32::to_bits).collect::<Vec<_>>()
        };
        assert_eq!(on(1), on(2));
        assert_eq!(on(1), on(4));
    }

    #[test]
    fn everything_is_in_a_pair() {
        assert_eq!(pairs(4).collect::<Vec<_>>(), [[0, 1], [2, 3]]);
        assert_eq!(pairs(5).collect::<Vec<_>>(), [[0, 1], [2, 3], [3, 4]]);
        assert_eq!(pairs(2).collect::<Vec<_>>(), [[0, 1]]);
    }
}
