//! [`LogSpectra`] as one differentiable operation of Burn's Flex backend; matrix products on other devices.

use std::fmt;
use std::sync::Arc;

use burn::backend::Autodiff;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, Flex, TensorMetadata, backend_extension};
use burn::tensor::{Tensor, TensorData};
use rayon::prelude::*;
use tactnet_conv::spare;

use crate::conv::{Primitive, in_order, is_cpu, reclaim, slice};
use crate::log_spectra::{ENERGY_FLOOR, LOG_GAIN, LOG_OFFSET, LogSpectra};

/// Returns the log spectra of `[batch, steps, taxels]` as `[batch, windows, taxels, bands + 1]`.
pub(crate) fn log_spectra(sweeps: Tensor<3>, plan: &Arc<LogSpectra>) -> Tensor<4> {
    if is_cpu(&sweeps.device()) {
        let sweeps = sweeps.into_dispatch();
        let found = <Dispatch as LogSpectraOp>::log_spectra(sweeps, Arc::clone(plan));
        return Tensor::from_dispatch(found);
    }
    let device = sweeps.device();
    let [batch, _, taxels] = sweeps.dims();
    let (window, bands) = (plan.window(), plan.values() - 1);
    let windows: Tensor<4> = sweeps.unfold(1, window, plan.hop());
    let count = windows.dims()[1];
    let rows = windows.reshape([batch * count * taxels, window]);
    let tables = plan.tables();
    let constant = |values: &[f32], extents: [usize; 2]| {
        Tensor::<2>::from_data(TensorData::new(values.to_vec(), extents), &device).transpose()
    };
    let parts = rows
        .clone()
        .matmul(constant(&tables.fourier, [window, window]));
    let squares = parts.clone() * parts;
    let half = window / 2;
    let powers = squares.clone().narrow(1, 0, half) + squares.narrow(1, half, half);
    let energies = powers.matmul(constant(&tables.bands, [bands, half]));
    let logarithms = energies
        .add_scalar(ENERGY_FLOOR)
        .log()
        .mul_scalar(LOG_GAIN)
        .add_scalar(LOG_OFFSET);
    Tensor::cat(vec![logarithms, rows.mean_dim(1)], 1).reshape([batch, count, taxels, bands + 1])
}

/// Backends that compute log spectra with one operation.
#[backend_extension(Flex, Autodiff)]
pub trait LogSpectraOp: Backend {
    /// See [`log_spectra`].
    fn log_spectra(sweeps: FloatTensor<Self>, plan: Arc<LogSpectra>) -> FloatTensor<Self>;
}

fn forward(sweeps: &Primitive, plan: &LogSpectra) -> Primitive {
    let [batch, steps, taxels]: [usize; 3] = sweeps.shape().dims();
    let windows = plan.windows(steps);
    let each = windows * taxels * plan.values();
    let mut values = spare::take(batch * each);
    values
        .par_chunks_exact_mut(each)
        .zip(slice(sweeps).par_chunks_exact(steps * taxels))
        .for_each_init(
            || plan.scratch(windows),
            |scratch, (output, sweep)| plan.forward(sweep, output, scratch),
        );
    let extents = [batch, windows, taxels, plan.values()];
    Primitive::from_data(TensorData::new(values, extents))
}

impl LogSpectraOp for Flex {
    fn log_spectra(sweeps: Primitive, plan: Arc<LogSpectra>) -> Primitive {
        forward(&in_order(sweeps), &plan)
    }
}

/// Inputs that the backward pass needs.
#[derive(Clone)]
struct State {
    sweeps: Primitive,
    plan: Arc<LogSpectra>,
}

impl fmt::Debug for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("State").field(&self.plan.window()).finish()
    }
}

#[derive(Debug)]
struct LogSpectraBackward;

impl Backward<Flex, 1> for LogSpectraBackward {
    type State = State;

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let gradient = in_order(gradients.consume::<Flex>(&ops.node));
        let State { sweeps, plan } = &ops.state;
        let extents: [usize; 3] = sweeps.shape().dims();
        let each = extents[1] * extents[2];
        let windows = plan.windows(extents[1]);
        let of_each = windows * extents[2] * plan.values();
        let mut found = spare::take(extents[0] * each);
        found
            .par_chunks_exact_mut(each)
            .zip(slice(sweeps).par_chunks_exact(each))
            .zip(slice(&gradient).par_chunks_exact(of_each))
            .for_each_init(
                || plan.scratch(windows),
                |scratch, ((found, sweep), gradient)| {
                    found.fill(0.0);
                    plan.backward(sweep, gradient, found, scratch);
                },
            );
        reclaim(gradient);
        let [node] = ops.parents;
        if let Some(node) = node {
            let found = Primitive::from_data(TensorData::new(found, extents));
            gradients.register::<Flex>(node.id, found);
        }
    }
}

impl<C: CheckpointStrategy> LogSpectraOp for Autodiff<Flex, C> {
    fn log_spectra(sweeps: FloatTensor<Self>, plan: Arc<LogSpectra>) -> FloatTensor<Self> {
        let node = sweeps.node();
        let sweeps = in_order(sweeps.into_primitive());
        let found = forward(&sweeps, &plan);
        match LogSpectraBackward
            .prepare::<C>([node])
            .compute_bound()
            .stateful()
        {
            OpsKind::Tracked(prepared) => prepared.finish(State { sweeps, plan }, found),
            OpsKind::UnTracked(prepared) => prepared.finish(found),
        }
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Distribution};

    use super::*;
    use crate::values;

    #[test]
    fn values_and_gradients_pass_through() {
        let device = Device::flex().autodiff();
        let plan = Arc::new(LogSpectra::new(16, 4, 6, 3));
        let sweeps = Tensor::<3>::random([5, 41, 3], Distribution::Uniform(-1.0, 1.0), &device)
            .require_grad();
        let found = log_spectra(sweeps.clone(), &plan);
        assert_eq!(found.dims(), [5, 7, 3, 7]);
        let weights = Tensor::<4>::random([5, 7, 3, 7], Distribution::Uniform(-1.0, 1.0), &device);
        let gradients = (found.clone() * weights.clone()).sum().backward();
        let gradient = values(sweeps.grad(&gradients).unwrap());
        let (sweeps, weights) = (values(sweeps.inner()), values(weights.inner()));
        let mut scratch = plan.scratch(7);
        for sweep in 0..5 {
            let own = &sweeps[sweep * 123..][..123];
            let mut output = vec![0.0; 7 * 21];
            plan.forward(own, &mut output, &mut scratch);
            assert_eq!(output, values(found.clone().inner())[sweep * 147..][..147]);
            let mut expected = vec![0.0; 123];
            plan.backward(
                own,
                &weights[sweep * 147..][..147],
                &mut expected,
                &mut scratch,
            );
            assert_eq!(expected, gradient[sweep * 123..][..123]);
        }
    }

    #[test]
    fn threads_change_no_bit() {
        let device = Device::flex().autodiff();
        let plan = Arc::new(LogSpectra::new(16, 4, 6, 3));
        let draw = |extents: [usize; 3]| {
            Tensor::<3>::random(extents, Distribution::Uniform(-1.0, 1.0), &device)
        };
        let (sweeps, weights) = (draw([9, 41, 3]), draw([9, 7 * 3, 7]).reshape([9, 7, 3, 7]));
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| {
                let sweeps = sweeps.clone().require_grad();
                let found = log_spectra(sweeps.clone(), &plan);
                let gradients = (found.clone() * weights.clone()).sum().backward();
                let both = [
                    values(found.inner()),
                    values(sweeps.grad(&gradients).unwrap()),
                ];
                both.concat()
                    .into_iter()
                    .map(f32::to_bits)
                    .collect::<Vec<_>>()
            })
        };
        assert_eq!(on(1), on(2));
        assert_eq!(on(1), on(4));
    }
}
