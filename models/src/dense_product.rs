//! Matrix product of a dense layer as one differentiable operation of Burn's Flex backend.
//!
//! Burn's product clears its target, copies the result once more and does not use AVX-512. faer writes the result in place.

use std::fmt;

use burn::backend::Autodiff;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, Flex, TensorMetadata, backend_extension};
use burn::tensor::{Tensor, TensorData};
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

use tactnet_conv::spare;

use crate::conv::{in_order, is_cpu};

/// Returns `x W^T`: `[rows, inputs]` and `[outputs, inputs]` to `[rows, outputs]`.
pub(crate) fn dense_product(input: Tensor<2>, weight: Tensor<2>) -> Tensor<2> {
    if is_cpu(&input.device()) {
        Tensor::from_dispatch(<Dispatch as DenseProduct>::dense_product(
            input.into_dispatch(),
            weight.into_dispatch(),
        ))
    } else {
        input.matmul(weight.transpose())
    }
}

/// Backends that compute the product, and both gradients, as one operation each.
#[backend_extension(Flex, Autodiff)]
pub trait DenseProduct: Backend {
    /// See [`dense_product`].
    fn dense_product(input: FloatTensor<Self>, weight: FloatTensor<Self>) -> FloatTensor<Self>;
}

type Primitive = FloatTensor<Flex>;

/// Matrix in row-major order.
#[derive(Clone)]
struct Matrix(Primitive);

impl Matrix {
    fn new(tensor: Primitive) -> Self {
        Self(in_order(tensor))
    }

    fn extents(&self) -> [usize; 2] {
        self.0.shape().dims()
    }

    fn view(&self) -> MatRef<'_, f32> {
        let [rows, columns] = self.extents();
        let values = &self.0.storage::<f32>()[..rows * columns];
        MatRef::from_row_major_slice(values, rows, columns)
    }
}

impl fmt::Debug for Matrix {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Matrix").field(&self.extents()).finish()
    }
}

fn product(left: MatRef<'_, f32>, right: MatRef<'_, f32>) -> Primitive {
    let (rows, columns) = (left.nrows(), right.ncols());
    let mut values = spare::take(rows * columns);
    let target = MatMut::from_row_major_slice_mut(&mut values, rows, columns);
    matmul(target, Accum::Replace, left, right, 1.0, Par::rayon(0));
    Primitive::from_data(TensorData::new(values, [rows, columns]))
}

impl DenseProduct for Flex {
    fn dense_product(input: Primitive, weight: Primitive) -> Primitive {
        let (input, weight) = (Matrix::new(input), Matrix::new(weight));
        product(input.view(), weight.view().transpose())
    }
}

#[derive(Debug)]
struct DenseBackward;

impl Backward<Flex, 2> for DenseBackward {
    type State = [Matrix; 2];

    fn backward(
        self,
        ops: Ops<Self::State, 2>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let [input, weight] = &ops.state;
        let gradient = Matrix::new(gradients.consume::<Flex>(&ops.node));
        let [input_node, weight_node] = ops.parents;
        if let Some(node) = input_node {
            gradients.register::<Flex>(node.id, product(gradient.view(), weight.view()));
        }
        if let Some(node) = weight_node {
            let found = product(gradient.view().transpose(), input.view());
            gradients.register::<Flex>(node.id, found);
        }
    }
}

impl<C: CheckpointStrategy> DenseProduct for Autodiff<Flex, C> {
    fn dense_product(input: FloatTensor<Self>, weight: FloatTensor<Self>) -> FloatTensor<Self> {
        let nodes = [input.node(), weight.node()];
        let [input, weight] = [input, weight].map(|tensor| Matrix::new(tensor.into_primitive()));
        let found = product(input.view(), weight.view().transpose());
        match DenseBackward.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => prepared.finish([input, weight], found),
            OpsKind::UnTracked(prepared) => prepared.finish(found),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::{Device, Distribution};

    /// Returns product and both gradients, by this operation and by Burn's.
    fn both_ways(rows: usize, inputs: usize, outputs: usize) -> [[Vec<f32>; 3]; 2] {
        let device = Device::flex().autodiff();
        let draw = |extents: [usize; 2]| {
            Tensor::<2>::random(extents, Distribution::Uniform(-1.0, 1.0), &device)
        };
        let (x, w, weights) = (
            draw([rows, inputs]),
            draw([outputs, inputs]),
            draw([rows, outputs]),
        );
        let values = |tensor: Tensor<2>| tensor.into_data().try_into_vec::<f32>().unwrap();
        [true, false].map(|ours| {
            let (x, w) = (x.clone().require_grad(), w.clone().require_grad());
            let y = if ours {
                dense_product(x.clone(), w.clone())
            } else {
                x.clone().matmul(w.clone().transpose())
            };
            let found = values(y.clone().inner());
            let gradients = (y * weights.clone()).sum().backward();
            [
                found,
                values(x.grad(&gradients).unwrap()),
                values(w.grad(&gradients).unwrap()),
            ]
        })
    }

    #[test]
    fn product_and_gradients_are_those_of_burn() {
        for (rows, inputs, outputs) in [(36, 2048, 512), (1, 2048, 512), (5, 7, 3), (100, 64, 10)] {
            let [ours, burns] = both_ways(rows, inputs, outputs);
            for (ours, burns) in ours.iter().zip(&burns) {
                assert_eq!(ours.len(), burns.len());
                for (a, b) in ours.iter().zip(burns) {
                    assert!(
                        (a - b).abs() < 2e-4,
                        "{rows} x {inputs} x {outputs}: {a} {b}"
                    );
                }
            }
        }
    }

    #[test]
    fn threads_change_no_bit() {
        let device = Device::flex();
        let draw = |extents: [usize; 2]| {
            Tensor::<2>::random(extents, Distribution::Uniform(-1.0, 1.0), &device)
        };
        let (x, w) = (draw([36, 2048]), draw([512, 2048]));
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads");
            let y = pool.install(|| dense_product(x.clone(), w.clone()));
            let values = y.into_data().try_into_vec::<f32>().unwrap();
            values.into_iter().map(f32::to_bits).collect::<Vec<_>>()
        };
        assert_eq!(on(1), on(2));
        assert_eq!(on(1), on(4));
    }
}
