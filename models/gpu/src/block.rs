//! One planned block: the route its shape takes, forward and backward.

use std::fmt;

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;
use tactnet_conv::BlockShape;

use crate::device::floats;
use crate::direct;
use crate::first_layer::FirstLayer;
use crate::matrix::{
    AdjointFactors, ByBin, Correlations, Factors, InOrder, IntoSteps, IntoTaps, Layout, Neighbours,
    Patches, Shared2, Taps, TapsInTime, Transposed, Windows as InWindows,
};
use crate::norm::{self, Passed};
use crate::product::{Problem, product};
use crate::tables::Windows;

/// Maps that come in from which on products of spectra are fewer than those of taps.
const MIN_SPECTRAL_MAPS: usize = 4;
/// Parts that the sum over positions is cut into where the weights' gradient is one small product.
const PARTS: usize = 256;

/// A block planned for one shape on one device. All buffers are 32-bit floats without gaps, in the order that [`BlockShape`] says.
pub struct Block {
    client: Client,
    shape: BlockShape,
    route: Route,
}

impl fmt::Debug for Block {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut found = f.debug_struct("Block");
        found.field("shape", &self.shape);
        found.field("route", &self.route).finish()
    }
}

#[derive(Debug)]
enum Route {
    /// One map in: taps in registers.
    FirstLayer(FirstLayer),
    /// One product over the taps.
    Direct,
    /// Spectra over time, products over taxels and maps for each frequency.
    Spectral(Box<Tables>),
}

/// Fourier matrices on the device.
#[derive(Debug)]
struct Tables {
    windows: Windows,
    forward: (Handle, usize),
    of_taps: (Handle, usize),
    backward: (Handle, usize),
    overlapped: (Handle, usize),
    for_taps: (Handle, usize),
}

impl Tables {
    fn of(client: &Client, shape: &BlockShape) -> Self {
        let windows = Windows::of(shape);
        let taps = shape.kernel[0];
        let upload = |values: Vec<f32>| {
            let handle = client.create_from_slice(f32::as_bytes(&values));
            (handle, values.len())
        };
        Self {
            windows,
            forward: upload(windows.forward()),
            of_taps: upload(windows.of_taps(taps)),
            backward: upload(windows.backward()),
            overlapped: upload(windows.overlapped()),
            for_taps: upload(windows.for_taps(taps)),
        }
    }
}

/// Result of [`Block::forward_train`].
#[derive(Debug)]
pub struct ForwardTrain {
    /// `[batch, pooled_steps, taxels, maps_out]`
    pub pooled: Handle,
    /// `[maps_out]`: mean of the convolution over batch, steps and taxels.
    pub mean: Handle,
    /// `[maps_out]`: its biased variance.
    pub variance: Handle,
    /// State for [`Block::backward`].
    pub saved: Saved,
}

/// State that a forward pass leaves for its backward pass.
#[derive(Debug)]
pub struct Saved {
    convolved: Convolved,
    gamma: Handle,
    mean: Handle,
    variance: Handle,
    pooled: Handle,
    winners: Handle,
}

#[derive(Debug)]
struct Convolved {
    out: Handle,
    /// Of the input, or the input itself.
    input: (Handle, usize),
    /// Of the weights, or the weights themselves.
    weight: (Handle, usize),
}

/// Gradients of a scalar with respect to what a block takes.
#[derive(Debug)]
pub struct Gradients {
    /// `[maps_out, maps_in, kernel steps, kernel taxels]`
    pub weight: Handle,
    /// `[maps_out]`
    pub gamma: Handle,
    /// `[maps_out]`
    pub beta: Handle,
    /// `[batch, steps, taxels, maps_in]`, if `need_input` was set.
    pub input: Option<Handle>,
}

impl Block {
    /// Plans a block.
    ///
    /// # Panics
    /// On even kernel sizes, a pool of no step and empty dimensions.
    pub fn plan(client: &Client, shape: BlockShape) -> Self {
        assert!(
            shape.kernel.iter().all(|k| k % 2 == 1) && shape.pool > 0 && shape.output_len() > 0,
            "a block needs odd kernel sizes, a pool of at least one step and no empty dimension, found {shape:?}"
        );
        let route = if let Some(first_layer) = FirstLayer::of(&shape) {
            Route::FirstLayer(first_layer)
        } else if shape.maps_in < MIN_SPECTRAL_MAPS {
            Route::Direct
        } else {
            Route::Spectral(Box::new(Tables::of(client, &shape)))
        };
        Self {
            client: client.clone(),
            shape,
            route,
        }
    }

    /// The shape that this block was planned for.
    pub fn shape(&self) -> &BlockShape {
        &self.shape
    }

    /// Returns the block with the batch's own statistics.
    pub fn forward_train(
        &self,
        input: &Handle,
        weight: &Handle,
        gamma: &Handle,
        beta: &Handle,
    ) -> ForwardTrain {
        let convolved = self.convolve(input, weight);
        let [mean, variance] = norm::statistics(&self.client, &self.shape, &convolved.out);
        let [pooled, winners] = norm::pool(
            &self.client,
            &self.shape,
            &convolved.out,
            [gamma, beta, &mean, &variance],
        );
        ForwardTrain {
            pooled: pooled.clone(),
            mean: mean.clone(),
            variance: variance.clone(),
            saved: Saved {
                convolved,
                gamma: gamma.clone(),
                mean,
                variance,
                pooled,
                winners,
            },
        }
    }

    /// Returns the block with frozen statistics: `[batch, pooled_steps, taxels, maps_out]`.
    pub fn forward_eval(&self, input: &Handle, weight: &Handle, norm: [&Handle; 4]) -> Handle {
        let convolved = self.convolve(input, weight);
        let [pooled, _] = norm::pool(&self.client, &self.shape, &convolved.out, norm);
        pooled
    }

    /// Returns the gradients from that of the pooled output.
    pub fn backward(&self, saved: Saved, gradient: &Handle, need_input: bool) -> Gradients {
        let passed = Passed {
            gamma: &saved.gamma,
            mean: &saved.mean,
            variance: &saved.variance,
            pooled: &saved.pooled,
            winners: &saved.winners,
            gradient,
        };
        let (client, shape, convolved) = (&self.client, &self.shape, &saved.convolved);
        let found = norm::gradients(client, shape, &convolved.out, &passed);
        let spread = || norm::spread(client, shape, &convolved.out, &passed, &found);
        let (weight, input) = match &self.route {
            Route::FirstLayer(layer) => {
                let of_norm = [&found.gamma, &found.beta];
                let (input, out) = (&convolved.input.0, &convolved.out);
                let weight = layer.weight_gradient(client, input, out, &passed, of_norm);
                let input =
                    need_input.then(|| self.input_gradient_direct(&spread(), &convolved.weight));
                (weight, input)
            }
            Route::Direct => self.backward_direct(convolved, &spread(), need_input),
            Route::Spectral(tables) => {
                self.backward_spectral(tables, convolved, &spread(), need_input)
            }
        };
        Gradients {
            weight,
            gamma: found.gamma,
            beta: found.beta,
            input,
        }
    }

    fn convolve(&self, input: &Handle, weight: &Handle) -> Convolved {
        let input = (input.clone(), self.shape.input_len());
        let weight = (weight.clone(), self.shape.weight_len());
        match &self.route {
            Route::FirstLayer(layer) => Convolved {
                out: layer.convolve(&self.client, &input.0, &weight.0),
                input,
                weight,
            },
            Route::Direct => self.convolve_direct(input, weight),
            Route::Spectral(tables) => self.convolve_spectral(tables, &input, &weight),
        }
    }

    /// Sizes of the side of the input; `others` are maps of the output.
    fn layout(&self) -> Layout {
        let BlockShape {
            steps,
            taxels,
            maps_in,
            maps_out,
            kernel,
            ..
        } = self.shape;
        Layout {
            steps,
            taxels,
            maps: maps_in,
            others: maps_out,
            kernel,
            ..Layout::default()
        }
    }

    fn convolved(&self) -> (Handle, usize) {
        floats(&self.client, self.shape.count() * self.shape.maps_out)
    }

    fn convolve_direct(&self, input: (Handle, usize), weight: (Handle, usize)) -> Convolved {
        let layout = self.layout();
        let out = self.convolved();
        let (rows, columns) = (self.shape.count(), self.shape.maps_out);
        let problem = Problem {
            members: 1,
            rows,
            columns,
            depth: self.taps(),
            parts: 1,
            left: layout,
            right: layout,
            out: in_order(rows, columns),
            left_along_depth: self.shape.maps_in > 1,
            right_along_depth: true,
        };
        product::<Patches, Taps, InOrder>(&self.client, problem, of(&input), of(&weight), of(&out));
        Convolved {
            out: out.0,
            input,
            weight,
        }
    }

    /// Taps of one output map.
    fn taps(&self) -> usize {
        self.shape.kernel[0] * self.shape.kernel[1] * self.shape.maps_in
    }

    fn backward_direct(
        &self,
        saved: &Convolved,
        gradient: &Handle,
        need_input: bool,
    ) -> (Handle, Option<Handle>) {
        let layout = self.layout();
        let (positions, maps) = (self.shape.count(), self.shape.maps_out);
        let gradient = (gradient.clone(), positions * maps);
        let by_map = in_order(positions, maps);
        let parts = PARTS.min(positions.div_ceil(64));
        let partial = floats(&self.client, parts * self.shape.weight_len());
        let problem = Problem {
            members: 1,
            rows: self.taps(),
            columns: maps,
            depth: positions,
            parts,
            left: layout,
            right: by_map,
            out: in_order(self.taps(), maps),
            left_along_depth: self.shape.maps_in == 1,
            right_along_depth: false,
        };
        let client = &self.client;
        product::<Transposed<Patches>, Shared2, InOrder>(
            client,
            problem,
            of(&saved.input),
            of(&gradient),
            of(&partial),
        );
        let weight = direct::sum_parts(client, &self.shape, parts, &partial);
        let input = need_input.then(|| self.input_gradient_direct(&gradient.0, &saved.weight));
        (weight, input)
    }

    /// What each position gives to each tap, gathered.
    fn input_gradient_direct(&self, gradient: &Handle, weight: &(Handle, usize)) -> Handle {
        let (positions, maps) = (self.shape.count(), self.shape.maps_out);
        let gradient = (gradient.clone(), positions * maps);
        let shares = floats(&self.client, positions * self.taps());
        let problem = Problem {
            members: 1,
            rows: positions,
            columns: self.taps(),
            depth: maps,
            parts: 1,
            left: in_order(positions, maps),
            right: self.layout(),
            out: in_order(positions, self.taps()),
            left_along_depth: true,
            right_along_depth: false,
        };
        product::<Shared2, Transposed<Taps>, InOrder>(
            &self.client,
            problem,
            of(&gradient),
            of(weight),
            of(&shares),
        );
        direct::gather(&self.client, &self.shape, &shares)
    }

    /// Sizes of windows of maps: of the input, or with `maps_out` of the output.
    fn windowed(&self, windows: &Windows, maps: usize) -> Layout {
        Layout {
            maps,
            ranges: windows.ranges,
            range: windows.range,
            windows: self.shape.batch * windows.ranges,
            bins: windows.bins,
            ..self.layout()
        }
    }

    /// Spectra `[windows][2 bins][taxels][maps]` of `values` `[batch][steps][taxels][maps]`.
    fn spectra(
        &self,
        tables: &Tables,
        values: &(Handle, usize),
        layout: Layout,
    ) -> (Handle, usize) {
        let windows = &tables.windows;
        let (rows, columns) = (2 * windows.bins, self.shape.taxels * layout.maps);
        let out = floats(&self.client, layout.windows * rows * columns);
        let problem = Problem {
            members: layout.windows,
            rows,
            columns,
            depth: layout.filled,
            parts: 1,
            left: in_order(rows, windows.window),
            right: layout,
            out: in_order(rows, columns),
            left_along_depth: true,
            right_along_depth: false,
        };
        product::<Shared2, InWindows, InOrder>(
            &self.client,
            problem,
            of(&tables.forward),
            of(values),
            of(&out),
        );
        out
    }

    /// Products over taxels and maps for each frequency: `[bins][windows][taxels][2][maps]`.
    fn multiply(
        &self,
        layout: Layout,
        adjoint: bool,
        spectra: &(Handle, usize),
        factors: &(Handle, usize),
    ) -> (Handle, usize) {
        let into = if adjoint {
            self.shape.maps_in
        } else {
            self.shape.maps_out
        };
        let (rows, columns) = (layout.windows * self.shape.taxels, 2 * into);
        let out = floats(&self.client, layout.bins * rows * columns);
        let problem = Problem {
            members: layout.bins,
            rows,
            columns,
            depth: self.shape.kernel[1] * 2 * layout.maps,
            parts: 1,
            left: Layout {
                mirrored: adjoint,
                ..layout
            },
            right: self.layout(),
            out: in_order(rows, columns),
            left_along_depth: true,
            right_along_depth: adjoint,
        };
        let client = &self.client;
        if adjoint {
            product::<Neighbours, AdjointFactors, InOrder>(
                client,
                problem,
                of(spectra),
                of(factors),
                of(&out),
            );
        } else {
            product::<Neighbours, Factors, InOrder>(
                client,
                problem,
                of(spectra),
                of(factors),
                of(&out),
            );
        }
        out
    }

    /// From products back to steps: `[batch][steps][taxels][maps]`.
    fn to_steps(
        &self,
        layout: Layout,
        table: &(Handle, usize),
        products: &(Handle, usize),
    ) -> (Handle, usize) {
        let columns = self.shape.taxels * layout.maps;
        let depth = (2 * layout.neighbours + 1) * 2 * layout.bins;
        let out = floats(&self.client, self.shape.batch * self.shape.steps * columns);
        let problem = Problem {
            members: layout.windows,
            rows: layout.range,
            columns,
            depth,
            parts: 1,
            left: in_order(layout.range, depth),
            right: layout,
            out: Layout { columns, ..layout },
            left_along_depth: true,
            right_along_depth: false,
        };
        product::<Shared2, ByBin, IntoSteps>(
            &self.client,
            problem,
            of(table),
            of(products),
            of(&out),
        );
        out
    }

    fn convolve_spectral(
        &self,
        tables: &Tables,
        input: &(Handle, usize),
        weight: &(Handle, usize),
    ) -> Convolved {
        let windows = &tables.windows;
        let BlockShape {
            maps_in,
            maps_out,
            kernel: [taps, across],
            ..
        } = self.shape;
        let incoming = Layout {
            offset: windows.offset,
            filled: windows.window.min(self.shape.steps + windows.offset),
            ..self.windowed(windows, maps_in)
        };
        let spectra = self.spectra(tables, input, incoming);
        let (rows, columns) = (2 * windows.bins, across * maps_in * maps_out);
        let factors = floats(&self.client, rows * columns);
        let problem = Problem {
            members: 1,
            rows,
            columns,
            depth: taps,
            parts: 1,
            left: in_order(rows, taps),
            right: self.layout(),
            out: in_order(rows, columns),
            left_along_depth: true,
            right_along_depth: false,
        };
        product::<Shared2, TapsInTime, InOrder>(
            &self.client,
            problem,
            of(&tables.of_taps),
            of(weight),
            of(&factors),
        );
        let products = self.multiply(incoming, false, &spectra, &factors);
        let outgoing = self.windowed(windows, maps_out);
        let (out, _) = self.to_steps(outgoing, &tables.backward, &products);
        Convolved {
            out,
            input: spectra,
            weight: factors,
        }
    }

    fn backward_spectral(
        &self,
        tables: &Tables,
        saved: &Convolved,
        gradient: &Handle,
        need_input: bool,
    ) -> (Handle, Option<Handle>) {
        let windows = &tables.windows;
        let BlockShape {
            maps_in,
            maps_out,
            kernel: [taps, across],
            ..
        } = self.shape;
        let outgoing = Layout {
            filled: windows.range.min(self.shape.steps),
            ..self.windowed(windows, maps_out)
        };
        let gradient = (gradient.clone(), self.shape.count() * maps_out);
        let spectra = self.spectra(tables, &gradient, outgoing);
        let input = need_input.then(|| {
            let products = self.multiply(outgoing, true, &spectra, &saved.weight);
            let incoming = Layout {
                neighbours: windows.neighbours,
                ..self.windowed(windows, maps_in)
            };
            self.to_steps(incoming, &tables.overlapped, &products).0
        });
        let (rows, columns) = (across * 2 * maps_in, 2 * maps_out);
        let correlations = floats(&self.client, windows.bins * rows * columns);
        let problem = Problem {
            members: windows.bins,
            rows,
            columns,
            depth: outgoing.windows * self.shape.taxels,
            parts: 1,
            left: self.windowed(windows, maps_in),
            right: Layout {
                kernel: [1, 1],
                ..outgoing
            },
            out: in_order(rows, columns),
            left_along_depth: false,
            right_along_depth: false,
        };
        product::<Transposed<Neighbours>, Neighbours, InOrder>(
            &self.client,
            problem,
            of(&saved.input),
            of(&spectra),
            of(&correlations),
        );
        let weight = floats(&self.client, self.shape.weight_len());
        let problem = Problem {
            members: 1,
            rows: taps,
            columns: across * maps_in * maps_out,
            depth: 2 * windows.bins,
            parts: 1,
            left: in_order(taps, 2 * windows.bins),
            right: self.layout(),
            out: self.layout(),
            left_along_depth: true,
            right_along_depth: false,
        };
        product::<Shared2, Correlations, IntoTaps>(
            &self.client,
            problem,
            of(&tables.for_taps),
            of(&correlations),
            of(&weight),
        );
        (weight.0, input)
    }
}

fn in_order(rows: usize, columns: usize) -> Layout {
    Layout {
        rows,
        columns,
        ..Layout::default()
    }
}

fn of((handle, len): &(Handle, usize)) -> (&Handle, usize) {
    (handle, *len)
}
