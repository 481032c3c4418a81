//! The convolution through spectra over time: for each frequency one product over the kernel's taxels and all maps.

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;
use tactnet_conv::BlockShape;

use crate::device::{Buffer, floats};
use crate::matrix::{
    AdjointFactors, ByBin, Correlations, Factors, InOrder, IntoSteps, IntoTaps, Layout, Matrix,
    Neighbours, Shared2, TapsInTime, Transposed, Windows as InWindows,
};
use crate::product::{Problem, Side, product};
use crate::tables::Windows;

/// The route of a shape, with its Fourier matrices on the device.
#[derive(Debug)]
pub(crate) struct Spectral {
    shape: BlockShape,
    windows: Windows,
    forward: Buffer,
    of_taps: Buffer,
    backward: Buffer,
    overlapped: Buffer,
    for_taps: Buffer,
}

/// What a forward pass leaves.
#[derive(Debug)]
pub(crate) struct Convolved {
    /// `[batch][steps][taxels][maps out]`
    pub(crate) out: Handle,
    /// Of the input: `[windows][2 bins][taxels][maps in]`.
    pub(crate) spectra: Buffer,
    /// Of the weights, conjugated: `[2 bins][kernel taxels][maps in][maps out]`.
    pub(crate) factors: Buffer,
}

impl Spectral {
    pub(crate) fn of(client: &Client, shape: &BlockShape) -> Self {
        let windows = Windows::of(shape);
        let taps = shape.kernel[0];
        let upload = |values: Vec<f32>| {
            let handle = client.create_from_slice(f32::as_bytes(&values));
            (handle, values.len())
        };
        Self {
            shape: *shape,
            windows,
            forward: upload(windows.forward()),
            of_taps: upload(windows.of_taps(taps)),
            backward: upload(windows.backward()),
            overlapped: upload(windows.overlapped()),
            for_taps: upload(windows.for_taps(taps)),
        }
    }

    pub(crate) fn convolve(&self, client: &Client, input: &Buffer, weight: &Buffer) -> Convolved {
        let windows = &self.windows;
        let incoming = Layout {
            offset: windows.offset,
            filled: windows.window.min(self.shape.steps + windows.offset),
            ..self.windowed(self.shape.maps_in)
        };
        let spectra = self.spectra(client, input, incoming);
        let taps = self.shape.kernel[0];
        let rows = 2 * windows.bins;
        let factors = floats(client, rows * self.pairs());
        let problem = Problem::of(
            [rows, taps, self.pairs()],
            Side::along_depth(Layout::in_order(rows, taps)),
            Side::across(Layout::of(&self.shape)),
        );
        product::<Shared2, TapsInTime, InOrder>(client, problem, &self.of_taps, weight, &factors);
        let taxels = Side::across(Layout::of(&self.shape));
        let maps = self.shape.maps_out;
        let products =
            self.multiply::<Factors>(client, incoming, taxels, maps, [&spectra, &factors]);
        let outgoing = self.windowed(maps);
        let (out, _) = self.to_steps(client, outgoing, &self.backward, &products);
        Convolved {
            out,
            spectra,
            factors,
        }
    }

    /// Returns the gradient of the weights, and that of the input if it is needed.
    pub(crate) fn backward(
        &self,
        client: &Client,
        [spectra, factors]: [&Buffer; 2],
        gradient: &Buffer,
        need_input: bool,
    ) -> (Handle, Option<Handle>) {
        let windows = &self.windows;
        let outgoing = Layout {
            filled: windows.range.min(self.shape.steps),
            ..self.windowed(self.shape.maps_out)
        };
        let of_gradient = self.spectra(client, gradient, outgoing);
        let input = need_input.then(|| {
            let mirrored = Layout {
                mirrored: true,
                ..outgoing
            };
            let taxels = Side::along_depth(Layout::of(&self.shape));
            let maps = self.shape.maps_in;
            let sides = [&of_gradient, factors];
            let products = self.multiply::<AdjointFactors>(client, mirrored, taxels, maps, sides);
            let incoming = Layout {
                neighbours: windows.neighbours,
                ..self.windowed(maps)
            };
            self.to_steps(client, incoming, &self.overlapped, &products)
                .0
        });
        let weight = self.weight_gradient(client, outgoing, spectra, &of_gradient);
        (weight, input)
    }

    fn weight_gradient(
        &self,
        client: &Client,
        outgoing: Layout,
        spectra: &Buffer,
        of_gradient: &Buffer,
    ) -> Handle {
        let BlockShape {
            maps_in,
            maps_out,
            kernel: [taps, across],
            ..
        } = self.shape;
        let bins = self.windows.bins;
        let (rows, columns) = (across * 2 * maps_in, 2 * maps_out);
        let correlations = floats(client, bins * rows * columns);
        let single = Layout {
            kernel: [1, 1],
            ..outgoing
        };
        let problem = Problem::of(
            [rows, outgoing.windows * self.shape.taxels, columns],
            Side::across(self.windowed(maps_in)),
            Side::across(single),
        )
        .members(bins);
        product::<Transposed<Neighbours>, Neighbours, InOrder>(
            client,
            problem,
            spectra,
            of_gradient,
            &correlations,
        );
        let weight = floats(client, self.shape.weight_len());
        let layout = Layout::of(&self.shape);
        let problem = Problem::of(
            [taps, 2 * bins, self.pairs()],
            Side::along_depth(Layout::in_order(taps, 2 * bins)),
            Side::across(layout),
        )
        .into(layout);
        product::<Shared2, Correlations, IntoTaps>(
            client,
            problem,
            &self.for_taps,
            &correlations,
            &weight,
        );
        weight.0
    }

    /// Pairs of maps, for each taxel of the kernel.
    fn pairs(&self) -> usize {
        self.shape.kernel[1] * self.shape.maps_in * self.shape.maps_out
    }

    /// Sizes of windows of so many maps.
    fn windowed(&self, maps: usize) -> Layout {
        let windows = &self.windows;
        Layout {
            maps,
            ranges: windows.ranges,
            range: windows.range,
            windows: self.shape.batch * windows.ranges,
            bins: windows.bins,
            ..Layout::of(&self.shape)
        }
    }

    /// Spectra `[windows][2 bins][taxels][maps]` of `values` `[batch][steps][taxels][maps]`.
    fn spectra(&self, client: &Client, values: &Buffer, layout: Layout) -> Buffer {
        let (rows, columns) = (2 * self.windows.bins, self.shape.taxels * layout.maps);
        let out = floats(client, layout.windows * rows * columns);
        let problem = Problem::of(
            [rows, layout.filled, columns],
            Side::along_depth(Layout::in_order(rows, self.windows.window)),
            Side::across(layout),
        )
        .members(layout.windows);
        product::<Shared2, InWindows, InOrder>(client, problem, &self.forward, values, &out);
        out
    }

    /// Products over taxels and maps for each frequency: `[bins][windows][taxels][2][maps]`.
    fn multiply<F: Matrix>(
        &self,
        client: &Client,
        layout: Layout,
        factors: Side,
        maps: usize,
        [left, right]: [&Buffer; 2],
    ) -> Buffer {
        let (rows, columns) = (layout.windows * self.shape.taxels, 2 * maps);
        let out = floats(client, layout.bins * rows * columns);
        let depth = self.shape.kernel[1] * 2 * layout.maps;
        let problem = Problem::of([rows, depth, columns], Side::along_depth(layout), factors)
            .members(layout.bins);
        product::<Neighbours, F, InOrder>(client, problem, left, right, &out);
        out
    }

    /// From products back to steps: `[batch][steps][taxels][maps]`.
    fn to_steps(
        &self,
        client: &Client,
        layout: Layout,
        table: &Buffer,
        products: &Buffer,
    ) -> Buffer {
        let columns = self.shape.taxels * layout.maps;
        let depth = (2 * layout.neighbours + 1) * 2 * layout.bins;
        let out = floats(client, self.shape.batch * self.shape.steps * columns);
        let problem = Problem::of(
            [layout.range, depth, columns],
            Side::along_depth(Layout::in_order(layout.range, depth)),
            Side::across(layout),
        )
        .members(layout.windows)
        .into(Layout { columns, ..layout });
        product::<Shared2, ByBin, IntoSteps>(client, problem, table, products, &out);
        out
    }
}
