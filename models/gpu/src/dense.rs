//! Matrix products of dense layers.

use cubecl::client::Client;

use crate::matrix::{InOrder, Layout, Matrix, Shared2, Transposed};
use crate::networks::Stacked;
use crate::product::{Problem, Side, product};

/// Sizes of a dense layer, which maps `[rows][inputs]` to `[rows][outputs]` with weights `[outputs][inputs]`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DenseShape {
    pub(crate) rows: usize,
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
}

impl DenseShape {
    /// Multiplies the input by the transpose of the weights.
    pub(crate) fn forward(
        self,
        client: &Client,
        networks: usize,
        input: &Stacked,
        weight: &Stacked,
    ) -> Stacked {
        let (rows, inputs, outputs) = (self.rows, self.inputs, self.outputs);
        let left = Side::along_depth(Layout::in_order(rows, inputs)).of(input.place);
        let right = Side::along_depth(Layout::in_order(outputs, inputs)).of(weight.place);
        let out = Stacked::floats(client, networks, rows * outputs);
        let problem = Problem::of([rows, inputs, outputs], left, right);
        multiply::<Shared2, Transposed<Shared2>>(client, networks, problem, input, weight, &out);
        out
    }

    /// Returns the gradient of the input, given that of the output.
    pub(crate) fn input_gradient(
        self,
        client: &Client,
        networks: usize,
        gradient: &Stacked,
        weight: &Stacked,
    ) -> Stacked {
        let (rows, inputs, outputs) = (self.rows, self.inputs, self.outputs);
        let left = Side::along_depth(Layout::in_order(rows, outputs)).of(gradient.place);
        let right = Side::across(Layout::in_order(outputs, inputs)).of(weight.place);
        let out = Stacked::floats(client, networks, rows * inputs);
        let problem = Problem::of([rows, outputs, inputs], left, right);
        multiply::<Shared2, Shared2>(client, networks, problem, gradient, weight, &out);
        out
    }

    /// Writes the gradient of the weights to `into`, given that of the output.
    pub(crate) fn weight_gradient(
        self,
        client: &Client,
        networks: usize,
        gradient: &Stacked,
        input: &Stacked,
        into: &Stacked,
    ) {
        let (rows, inputs, outputs) = (self.rows, self.inputs, self.outputs);
        let left = Side::across(Layout::in_order(rows, outputs)).of(gradient.place);
        let right = Side::across(Layout::in_order(rows, inputs)).of(input.place);
        let problem = Problem::of([outputs, rows, inputs], left, right);
        multiply::<Transposed<Shared2>, Shared2>(client, networks, problem, gradient, input, into);
    }
}

fn multiply<L: Matrix, R: Matrix>(
    client: &Client,
    networks: usize,
    problem: Problem,
    left: &Stacked,
    right: &Stacked,
    out: &Stacked,
) {
    let problem = problem.networks(networks, out.place);
    let [left, right, target] = [&left.buffer, &right.buffer, &out.buffer];
    product::<L, R, InOrder>(client, problem, left, right, target);
}
