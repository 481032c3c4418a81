//! Convolution through spectra over time: for each frequency one product over the kernel's taxels and all maps.

use cubecl::client::Client;
use cubecl::prelude::*;
use tactnet_conv::BlockShape;

use crate::device::Buffer;
use crate::matrix::{
    AdjointFactors, ByBin, Correlations, Factors, InOrder, IntoSteps, IntoTaps, Layout, Matrix,
    Neighbours, Shared2, TapsInTime, Transposed, Windows as InWindows,
};
use crate::networks::Stacked;
use crate::norm::Run;
use crate::product::{Problem, Side, product};
use crate::tables::Windows;

/// Route of a shape, with its Fourier matrices on the device.
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

/// Results of a forward pass.
#[derive(Debug)]
pub(crate) struct Convolved {
    /// `[batch][steps][taxels][maps out]`
    pub(crate) out: Stacked,
    /// Spectra of the input: `[windows][2 bins][taxels][maps in]`.
    pub(crate) spectra: Stacked,
    /// Conjugated spectra of the weights: `[2 bins][kernel taxels][maps in][maps out]`.
    pub(crate) factors: Stacked,
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

    pub(crate) fn convolve(&self, run: &Run<'_>, input: &Stacked, weight: &Stacked) -> Convolved {
        let windows = &self.windows;
        let incoming = Layout {
            offset: windows.offset,
            filled: windows.window.min(self.shape.steps + windows.offset),
            ..self.windowed(self.shape.maps_in)
        };
        let spectra = self.spectra(run, input, incoming);
        let taps = self.shape.kernel[0];
        let rows = 2 * windows.bins;
        let factors = Stacked::floats(run.client, run.networks, rows * self.pairs());
        let problem = Problem::of(
            [rows, taps, self.pairs()],
            Side::along_depth(Layout::in_order(rows, taps)),
            Side::across(Layout::of(&self.shape)).of(weight.place),
        )
        .networks(run.networks, factors.place);
        let [weight, target] = [&weight.buffer, &factors.buffer];
        product::<Shared2, TapsInTime, InOrder>(run.client, problem, &self.of_taps, weight, target);
        let taxels = Side::across(Layout::of(&self.shape));
        let maps = self.shape.maps_out;
        let products = self.multiply::<Factors>(run, incoming, taxels, maps, &spectra, &factors);
        let outgoing = self.windowed(maps);
        let out = self.to_steps(run, outgoing, &self.backward, &products);
        Convolved {
            out,
            spectra,
            factors,
        }
    }

    /// Writes the gradient of the weights to `of_weight`, and returns that of the input if requested.
    pub(crate) fn backward(
        &self,
        run: &Run<'_>,
        spectra: &Stacked,
        factors: &Stacked,
        gradient: &Stacked,
        of_weight: &Stacked,
        need_input: bool,
    ) -> Option<Stacked> {
        let windows = &self.windows;
        let outgoing = Layout {
            filled: windows.range.min(self.shape.steps),
            ..self.windowed(self.shape.maps_out)
        };
        let of_gradient = self.spectra(run, gradient, outgoing);
        let input = need_input.then(|| {
            let mirrored = Layout {
                mirrored: true,
                ..outgoing
            };
            let taxels = Side::along_depth(Layout::of(&self.shape));
            let maps = self.shape.maps_in;
            let products =
                self.multiply::<AdjointFactors>(run, mirrored, taxels, maps, &of_gradient, factors);
            let incoming = Layout {
                neighbours: windows.neighbours,
                ..self.windowed(maps)
            };
            self.to_steps(run, incoming, &self.overlapped, &products)
        });
        self.weight_gradient(run, outgoing, spectra, &of_gradient, of_weight);
        input
    }

    fn weight_gradient(
        &self,
        run: &Run<'_>,
        outgoing: Layout,
        spectra: &Stacked,
        of_gradient: &Stacked,
        out: &Stacked,
    ) {
        let BlockShape {
            maps_in,
            maps_out,
            kernel: [taps, across],
            ..
        } = self.shape;
        let bins = self.windows.bins;
        let (rows, columns) = (across * 2 * maps_in, 2 * maps_out);
        let correlations = Stacked::floats(run.client, run.networks, bins * rows * columns);
        let single = Layout {
            kernel: [1, 1],
            ..outgoing
        };
        let problem = Problem::of(
            [rows, outgoing.windows * self.shape.taxels, columns],
            Side::across(self.windowed(maps_in)).of(spectra.place),
            Side::across(single).of(of_gradient.place),
        )
        .members(bins)
        .networks(run.networks, correlations.place);
        product::<Transposed<Neighbours>, Neighbours, InOrder>(
            run.client,
            problem,
            &spectra.buffer,
            &of_gradient.buffer,
            &correlations.buffer,
        );
        let layout = Layout::of(&self.shape);
        let problem = Problem::of(
            [taps, 2 * bins, self.pairs()],
            Side::along_depth(Layout::in_order(taps, 2 * bins)),
            Side::across(layout).of(correlations.place),
        )
        .into(layout)
        .networks(run.networks, out.place);
        product::<Shared2, Correlations, IntoTaps>(
            run.client,
            problem,
            &self.for_taps,
            &correlations.buffer,
            &out.buffer,
        );
    }

    /// Returns the number of map pairs times the kernel's taxels.
    fn pairs(&self) -> usize {
        self.shape.kernel[1] * self.shape.maps_in * self.shape.maps_out
    }

    /// Returns the layout of windows of `maps` maps.
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

    /// Returns the spectra `[windows][2 bins][taxels][maps]` of `values` `[batch][steps][taxels][maps]`.
    fn spectra(&self, run: &Run<'_>, values: &Stacked, layout: Layout) -> Stacked {
        let (rows, columns) = (2 * self.windows.bins, self.shape.taxels * layout.maps);
        let out = Stacked::floats(run.client, run.networks, layout.windows * rows * columns);
        let problem = Problem::of(
            [rows, layout.filled, columns],
            Side::along_depth(Layout::in_order(rows, self.windows.window)),
            Side::across(layout).of(values.place),
        )
        .members(layout.windows)
        .networks(run.networks, out.place);
        let [values, target] = [&values.buffer, &out.buffer];
        product::<Shared2, InWindows, InOrder>(run.client, problem, &self.forward, values, target);
        out
    }

    /// Returns the products over taxels and maps for each frequency, `[bins][windows][taxels][2][maps]`.
    fn multiply<F: Matrix>(
        &self,
        run: &Run<'_>,
        layout: Layout,
        factors: Side,
        maps: usize,
        left: &Stacked,
        right: &Stacked,
    ) -> Stacked {
        let (rows, columns) = (layout.windows * self.shape.taxels, 2 * maps);
        let out = Stacked::floats(run.client, run.networks, layout.bins * rows * columns);
        let depth = self.shape.kernel[1] * 2 * layout.maps;
        let problem = Problem::of(
            [rows, depth, columns],
            Side::along_depth(layout).of(left.place),
            factors.of(right.place),
        )
        .members(layout.bins)
        .networks(run.networks, out.place);
        let [left, right, target] = [&left.buffer, &right.buffer, &out.buffer];
        product::<Neighbours, F, InOrder>(run.client, problem, left, right, target);
        out
    }

    /// Transforms products back to steps, `[batch][steps][taxels][maps]`.
    fn to_steps(
        &self,
        run: &Run<'_>,
        layout: Layout,
        table: &Buffer,
        products: &Stacked,
    ) -> Stacked {
        let columns = self.shape.taxels * layout.maps;
        let depth = (2 * layout.neighbours + 1) * 2 * layout.bins;
        let len = self.shape.batch * self.shape.steps * columns;
        let out = Stacked::floats(run.client, run.networks, len);
        let problem = Problem::of(
            [layout.range, depth, columns],
            Side::along_depth(Layout::in_order(layout.range, depth)),
            Side::across(layout).of(products.place),
        )
        .members(layout.windows)
        .into(Layout { columns, ..layout })
        .networks(run.networks, out.place);
        let [products, target] = [&products.buffer, &out.buffer];
        product::<Shared2, ByBin, IntoSteps>(run.client, problem, table, products, target);
        out
    }
}
