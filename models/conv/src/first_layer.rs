//! First layer, with one input map: overlap-save tiles.
//!
//! A tile of `tile` steps reads `tile + 2 pad` input steps. Its two-dimensional spectrum times the kernels' spectra gives all output maps.
//! The spectra of eight tiles are computed at once, one tile per lane; from the product on, lanes are maps. Each tile is
//! pooled while it is in cache, so the full-resolution maps are never written. The backward pass does not need them either.
//!
//! Processors with AVX-512 convolve tap by tap instead (`taps.rs`).

mod autocorrelation;
mod backward;
mod input_gradient;
mod padding;
mod shares;
mod stages;
mod taps;
mod winners;

use rayon::prelude::*;

use super::bands::Bands;
use super::buffers::{Buffers, OCTETS, VALUES};
use super::fft::{TimePlan, Transform};
use super::norm::Pooled;
use super::pooling::{Goal, PoolBuffers, Window, merge_sums};
use super::shape::BlockShape;
use super::simd::{Isa, NOTHING, NOWHERE, Octet, Octets, Rows, Table};
use super::spare;
use super::spectral::plan::by_group;
use super::spectral::stages::KernelRows;
use super::taxel::TaxelPlan;
use super::weight::{Remembered, Weight};

use stages::{Analyze, Scale, Synthesize};
use taps::by_taps;
use winners::WINNERS;
use winners::Winner;

/// Maximum number of steps in a tile, unless one pooling window is longer.
const TILE: usize = 100;
/// Maximum number of taxels in a band, and of a transformed band's inputs.
const MAX_BAND: usize = 16;
/// Maximum number of kernel steps and taxels.
pub(super) const MAX_KERNEL: [usize; 2] = [15, 5];

/// Plan with cached kernel spectra.
#[derive(Debug)]
pub(super) struct FirstLayer {
    pub(super) shape: BlockShape,
    pub(super) isa: Isa,
    pub(super) time: TimePlan,
    pub(super) taxel: TaxelPlan,
    pub(super) bands: Bands,
    /// Octets of output maps.
    pub(super) outs: usize,
    /// Octets per vector of output maps.
    pub(super) group: usize,
    /// Number of output steps in a tile.
    pub(super) tile: usize,
    all: Table,
    taps: Table,
    cropped: Table,
    weights: Remembered<Octets>,
    pub(super) buffers: &'static Buffers<Octets>,
    pub(super) values: &'static Buffers<Vec<f32>>,
    pub(super) winners: &'static Buffers<Vec<Winner>>,
}

/// State for the backward pass.
#[derive(Debug)]
pub(super) struct SavedFirstLayer {
    pub(super) input: Vec<f32>,
    pub(super) weight: Vec<f32>,
}

/// One tile: its sweep, first step and output windows; the sums are `[window, band, 3, columns]`.
pub(super) struct Tile<'a> {
    pub(super) input: &'a [f32],
    pub(super) first: usize,
    pub(super) steps: usize,
    pub(super) to: Window<'a>,
}

/// Working memory for up to eight tiles.
struct TileMemory {
    /// `[length, width of a band]`
    rows: Octets,
    /// `[column, length, 2]`, spectra over taxels
    taxel_spectra: Octets,
    /// `[column, length, 2]`, spectra over taxels and time
    tile_spectra: Octets,
    /// `[length, 2, vector]`
    product: Octets,
    /// `[column, steps of a tile, 2, vector]`
    cropped: Octets,
    /// `[pool, taxels of a band, vector]`
    maps: Octets,
    scratch: Octets,
}

impl TileMemory {
    fn take(plan: &FirstLayer) -> Self {
        let (columns, length) = (plan.taxel.frequencies(), plan.time.length());
        let take = |len: usize| plan.buffers.take(len);
        Self {
            rows: take(length * plan.bands.width),
            taxel_spectra: take(columns * length * 2),
            tile_spectra: take(columns * length * 2),
            product: take(2 * length * plan.group),
            cropped: take(columns * plan.tile * 2 * plan.group),
            maps: take(plan.shape.pool * plan.bands.span * plan.group),
            scratch: take(plan.time.scratch(2)),
        }
    }

    fn give_back(self, buffers: &Buffers<Octets>) {
        let Self {
            rows,
            taxel_spectra,
            tile_spectra,
            product,
            cropped,
            maps,
            scratch,
        } = self;
        for buffer in [
            rows,
            taxel_spectra,
            tile_spectra,
            product,
            cropped,
            maps,
            scratch,
        ] {
            buffers.give(buffer);
        }
    }
}

impl FirstLayer {
    /// Returns `None` if the route does not support the shape.
    pub(super) fn new(shape: BlockShape, isa: Isa) -> Option<Self> {
        let [pad_steps, pad_taxels] = shape.padding();
        if shape.maps_in != 1
            || !shape.maps_out.is_multiple_of(8)
            || shape.kernel[0] > MAX_KERNEL[0]
            || shape.kernel[1] > MAX_KERNEL[1]
        {
            return None;
        }
        let tile = (TILE / shape.pool).max(1) * shape.pool;
        let time = TimePlan::at_least(tile + 2 * pad_steps);
        let length = time.length();
        let bands = Bands::at_most(MAX_BAND, shape.taxels, pad_taxels);
        let taxel = TaxelPlan::new(&bands, pad_taxels, 1.0 / length as f64)?;
        let row = |inside: bool, row: usize| if inside { row as u32 } else { NOWHERE };
        let taps = |t: usize| {
            let tap = if t <= pad_steps {
                pad_steps - t
            } else {
                pad_steps + length - t
            };
            row(tap < shape.kernel[0], tap)
        };
        let cropped = |t: usize| {
            row(
                (pad_steps..pad_steps + tile).contains(&t),
                t.wrapping_sub(pad_steps),
            )
        };
        Some(Self {
            outs: shape.maps_out / 8,
            group: isa.group(shape.maps_out / 8),
            tile,
            all: Table::new((0..length).map(|s| row(true, s))),
            taps: Table::new((0..length).map(taps)),
            cropped: Table::new((0..length).map(cropped)),
            weights: Remembered::default(),
            buffers: &OCTETS,
            values: &VALUES,
            winners: &WINNERS,
            shape,
            isa,
            time,
            taxel,
            bands,
        })
    }

    /// Convolves, pools and overwrites `to` with winners (or outputs) and positions; for winners it saves the state for the backward pass.
    pub(super) fn forward(
        &self,
        input: &[f32],
        weight: &Weight<'_>,
        goal: Goal<'_>,
        to: PoolBuffers,
    ) -> (Pooled, SavedFirstLayer) {
        let shape = &self.shape;
        let PoolBuffers {
            mut winners,
            mut positions,
        } = to;
        let windows = shape.batch * shape.pooled_steps();
        let mut sums = self
            .buffers
            .take(windows * self.bands.count() * 3 * self.outs);
        let mut tiles = self.tiles(
            input,
            Window {
                winners: &mut winners,
                positions: &mut positions,
                sums: &mut sums,
                columns: self.outs,
            },
        );
        if by_taps(shape, self.isa) {
            let panels = self.panels(&weight.values());
            self.convolve_by_taps(&panels, goal, &mut tiles);
            self.buffers.give(panels);
        } else {
            self.convolve_by_tiles(weight, goal, &mut tiles);
        }
        drop(tiles);
        let moments = goal
            .is_winners()
            .then(|| merge_sums(&sums, self.outs, shape, &self.bands));
        self.buffers.give(sums);
        let mut saved = SavedFirstLayer {
            input: Vec::new(),
            weight: weight.values().into_owned(),
        };
        if goal.is_winners() {
            saved.input = spare::take(input.len());
            saved.input.copy_from_slice(input);
        }
        (
            Pooled {
                winners,
                positions,
                moments,
            },
            saved,
        )
    }

    /// Divides sweeps and the output buffers of all windows into tiles.
    fn tiles<'a>(&self, input: &'a [f32], to: Window<'a>) -> Vec<Tile<'a>> {
        let shape = &self.shape;
        let (windows, tile_windows) = (shape.pooled_steps(), self.tile / shape.pool);
        let window = shape.taxels * shape.maps_out;
        let window_sums = self.bands.count() * 3 * self.outs;
        let mut tiles = Vec::new();
        let sweeps = input.chunks_exact(shape.steps * shape.taxels);
        let outputs = to
            .winners
            .chunks_exact_mut(windows * window)
            .zip(to.positions.chunks_exact_mut(windows * window));
        for ((input, (winners, positions)), sums) in sweeps
            .zip(outputs)
            .zip(to.sums.chunks_exact_mut(windows * window_sums))
        {
            let parts = winners
                .chunks_mut(tile_windows * window)
                .zip(positions.chunks_mut(tile_windows * window));
            for (index, ((winners, positions), sums)) in parts
                .zip(sums.chunks_mut(tile_windows * window_sums))
                .enumerate()
            {
                let first = index * self.tile;
                let to = Window {
                    winners,
                    positions,
                    sums,
                    columns: self.outs,
                };
                tiles.push(Tile {
                    input,
                    first,
                    steps: (shape.steps - first).min(self.tile),
                    to,
                });
            }
        }
        tiles
    }

    /// Convolves and pools every tile through its spectrum.
    fn convolve_by_tiles(&self, weight: &Weight<'_>, goal: Goal<'_>, tiles: &mut [Tile<'_>]) {
        let kernels = self.weights.get_or_make(weight, |before| {
            before.into_iter().for_each(|made| self.buffers.give(made));
            self.weight_spectra(&weight.values())
        });
        // Eight tiles are analysed at once; fewer if threads would otherwise be idle.
        let at_once = tiles
            .len()
            .div_ceil(2 * rayon::current_num_threads())
            .min(8);
        tiles
            .par_chunks_mut(at_once)
            .with_max_len(1)
            .for_each(|tiles| {
                let mut memory = TileMemory::take(self);
                for band in 0..self.bands.count() {
                    self.analyze(tiles, band, &mut memory);
                    self.multiply_and_pool(&kernels, goal, tiles, band, &mut memory);
                }
                memory.give_back(self.buffers);
            });
    }

    /// Computes the spectra of a band of up to eight tiles.
    fn analyze(&self, tiles: &[Tile<'_>], band: usize, memory: &mut TileMemory) {
        let spectrum = 2 * self.time.length();
        self.gather(tiles, band, &mut memory.rows);
        let stage = Analyze {
            plan: self,
            rows: &memory.rows,
            spectra: &mut memory.taxel_spectra,
        };
        self.isa.run(1, stage);
        let pairs = Rows {
            table: &self.all,
            stride: 2,
            parts: [0, 1],
            ahead: NOTHING,
        };
        for (source, target) in memory
            .taxel_spectra
            .chunks_exact(spectrum)
            .zip(memory.tile_spectra.chunks_exact_mut(spectrum))
        {
            let transform = Transform {
                plan: &self.time,
                source,
                from: pairs,
                target,
                to: pairs,
                scratch: &mut memory.scratch,
            };
            self.isa.run(1, transform);
        }
    }

    /// Multiplies a band's spectra with those of the kernels, transforms back and pools.
    fn multiply_and_pool(
        &self,
        kernels: &[Octet],
        goal: Goal<'_>,
        tiles: &mut [Tile<'_>],
        band: usize,
        memory: &mut TileMemory,
    ) {
        let (length, group) = (self.time.length(), self.group);
        let columns = self.taxel.frequencies();
        let [whole, inside] = [&self.all, &self.cropped].map(|table| {
            let rows = Rows {
                table,
                stride: 2 * group,
                parts: [0, group],
                ahead: NOTHING,
            };
            rows.exchanged()
        });
        for (kernels, column) in kernels
            .chunks_exact(columns * 2 * length * group)
            .zip((0..).step_by(group))
        {
            for (lane, tile) in tiles.iter_mut().enumerate() {
                let factors = memory
                    .tile_spectra
                    .chunks_exact(2 * length)
                    .zip(kernels.chunks_exact(2 * length * group));
                for ((spectrum, kernel), target) in
                    factors.zip(memory.cropped.chunks_exact_mut(self.tile * 2 * group))
                {
                    let stage = Scale {
                        spectrum,
                        lane,
                        kernel,
                        product: &mut memory.product,
                    };
                    self.isa.run(self.outs, stage);
                    let transform = Transform {
                        plan: &self.time,
                        source: &memory.product,
                        from: whole,
                        target,
                        to: inside,
                        scratch: &mut memory.scratch,
                    };
                    self.isa.run(self.outs, transform);
                }
                let stage = Synthesize {
                    plan: self,
                    spectra: &memory.cropped,
                    maps: &mut memory.maps,
                    goal,
                    tile,
                    band,
                    column,
                };
                self.isa.run(self.outs, stage);
            }
        }
    }

    /// Returns the kernels' spectra, `[group of maps_out octets, column, time frequency, 2]`.
    fn weight_spectra(&self, weight: &[f32]) -> Octets {
        let [kernel_steps, kernel_taxels] = self.shape.kernel;
        let (columns, length, group) = (self.taxel.frequencies(), self.time.length(), self.group);
        let mut taps = self.buffers.take(weight.len() / 8);
        by_group(weight, kernel_steps * kernel_taxels, group, &mut taps);
        let mut spectra = self.buffers.take(self.outs * columns * length * 2);
        let mut lags = Octets::zeros(kernel_steps * 2 * group);
        let mut scratch = self.buffers.take(self.time.scratch(2));
        let [from, to] = [&self.taps, &self.all].map(|table| Rows {
            table,
            stride: 2 * group,
            parts: [0, group],
            ahead: NOTHING,
        });
        for (taps, spectra) in taps
            .chunks_exact(kernel_steps * kernel_taxels * group)
            .zip(spectra.chunks_exact_mut(columns * length * 2 * group))
        {
            for (column, spectrum) in spectra.chunks_exact_mut(2 * length * group).enumerate() {
                let rows = KernelRows {
                    plan: &self.taxel,
                    column,
                    taps,
                    lags: &mut lags,
                };
                self.isa.run(self.outs, rows);
                self.isa.run(
                    self.outs,
                    Transform {
                        plan: &self.time,
                        source: &lags,
                        from,
                        target: spectrum,
                        to,
                        scratch: &mut scratch,
                    },
                );
            }
        }
        self.buffers.give(taps);
        self.buffers.give(scratch);
        spectra
    }

    /// Gathers the input of a band of up to eight tiles, `[length, width]`, one tile per lane, zero outside the sweep.
    fn gather(&self, tiles: &[Tile<'_>], band: usize, rows: &mut [Octet]) {
        let (taxels, pad) = (self.shape.taxels, self.shape.padding()[0]);
        let width = self.bands.width;
        rows.fill(Octet::ZERO);
        for (lane, tile) in tiles.iter().enumerate() {
            let begin = tile.first.saturating_sub(pad);
            let end = (tile.first + self.time.length() - pad).min(self.shape.steps);
            let offset = (begin + pad - tile.first) * width;
            let steps = tile.input[begin * taxels..end * taxels].chunks_exact(taxels);
            for (row, values) in rows[offset..].chunks_exact_mut(width).zip(steps) {
                for (at, cell) in row.iter_mut().enumerate() {
                    cell.0[lane] = self
                        .bands
                        .input(band, at)
                        .map_or(0.0, |taxel| values[taxel]);
                }
            }
        }
    }
}
