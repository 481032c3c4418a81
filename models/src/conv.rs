//! Convolution block of `tactnet-conv` as one differentiable operation of Burn's Flex backend.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use burn::backend::Autodiff;
use burn::backend::autodiff::NodeId;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients as Graph;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{
    AutodiffBackend, Backend, Dispatch, DispatchDevice, ExtensionType, Flex, TensorMetadata,
    backend_extension,
};
use burn::tensor::{Device, Tensor, TensorData};
use tactnet_conv::{Block, BlockShape, Saved, Weight, shared_block, spare};

/// Returns true if `device` runs the fused operations: the CPU (Burn's Flex backend) and GPUs.
pub fn is_fused(device: &Device) -> bool {
    match device.as_dispatch() {
        DispatchDevice::Autodiff(device) => fused(device),
        device => fused(device),
    }
}

fn fused(device: &DispatchDevice) -> bool {
    match device {
        DispatchDevice::Flex(_) => true,
        #[cfg(any(feature = "vulkan", feature = "cuda"))]
        DispatchDevice::Cube(_) => true,
        #[allow(unreachable_patterns)]
        _ => false,
    }
}

/// Returns true if `device` is the CPU, with or without autodiff.
pub fn is_cpu(device: &Device) -> bool {
    match device.as_dispatch() {
        DispatchDevice::Flex(_) => true,
        DispatchDevice::Autodiff(device) => matches!(**device, DispatchDevice::Flex(_)),
        #[allow(unreachable_patterns)]
        _ => false,
    }
}

/// Pooled output of a block and the batch statistics that normalised it.
pub(crate) struct TrainedBlock {
    /// `[batch, pooled steps, taxels, maps_out]`
    pub(crate) pooled: Tensor<4>,
    /// `[maps_out]`, detached from the graph
    pub(crate) mean: Tensor<1>,
    /// `[maps_out]`, biased, detached from the graph
    pub(crate) variance: Tensor<1>,
}

/// Runs the block with batch statistics; differentiable in `input` `[batch, steps, taxels, maps_in]`, `weight`
/// `[maps_out, maps_in, kernel steps, kernel taxels]`, `gamma` and `beta` `[maps_out]`.
pub(crate) fn block_train(
    input: Tensor<4>,
    weight: Tensor<4>,
    gamma: Tensor<1>,
    beta: Tensor<1>,
    pool: usize,
) -> TrainedBlock {
    let found = <Dispatch as TrainableBlock>::block_train(
        input.into_dispatch(),
        weight.into_dispatch(),
        gamma.into_dispatch(),
        beta.into_dispatch(),
        pool,
    );
    TrainedBlock {
        pooled: Tensor::from_dispatch(found.pooled),
        mean: Tensor::from_dispatch(found.mean),
        variance: Tensor::from_dispatch(found.variance),
    }
}

/// Runs the block with fixed statistics, not differentiable; shapes as for [`block_train`].
pub(crate) fn block_eval(
    input: Tensor<4>,
    weight: Tensor<4>,
    [gamma, beta, mean, variance]: [Tensor<1>; 4],
    pool: usize,
) -> Tensor<4> {
    Tensor::from_dispatch(<Dispatch as FrozenBlock>::block_eval(
        input.into_dispatch(),
        weight.into_dispatch(),
        gamma.into_dispatch(),
        beta.into_dispatch(),
        mean.into_dispatch(),
        variance.into_dispatch(),
        pool,
    ))
}

/// Result of [`TrainableBlock::block_train`]; shapes as in [`TrainedBlock`].
#[derive(ExtensionType)]
pub struct BlockOutput<B: Backend> {
    pub(crate) pooled: FloatTensor<B>,
    pub(crate) mean: FloatTensor<B>,
    pub(crate) variance: FloatTensor<B>,
}

/// Backends that train the block with one operation.
#[backend_extension(Flex, Cube: cfg(any(feature = "vulkan", feature = "cuda")), Autodiff)]
pub trait TrainableBlock: Backend {
    /// See [`block_train`].
    fn block_train(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        pool: usize,
    ) -> BlockOutput<Self>;
}

/// Backends that evaluate the block with one operation.
#[backend_extension(Flex, Cube: cfg(any(feature = "vulkan", feature = "cuda")))]
pub trait FrozenBlock: Backend {
    /// See [`block_eval`].
    fn block_eval(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        mean: FloatTensor<Self>,
        variance: FloatTensor<Self>,
        pool: usize,
    ) -> FloatTensor<Self>;
}

pub(crate) type Primitive = FloatTensor<Flex>;

/// Returns the values of a contiguous tensor that starts at the beginning of its memory.
pub(crate) fn slice(tensor: &Primitive) -> &[f32] {
    &tensor.storage()[..tensor.shape().num_elements()]
}

/// Returns the tensor as contiguous from the beginning of its memory; copies it if it is not.
pub(crate) fn in_order(tensor: Primitive) -> Primitive {
    if tensor.is_contiguous() && tensor.layout().start_offset() == 0 {
        tensor
    } else {
        tensor.to_contiguous()
    }
}

/// Returns the memory of a large tensor to [`spare`], unless the tensor is shared.
pub(crate) fn reclaim(tensor: Primitive) {
    let large = tensor.layout().num_elements() >= spare::MIN_LEN;
    if large && tensor.is_unique() && tensor.is_contiguous() {
        tensor
            .into_data()
            .try_into_vec()
            .into_iter()
            .for_each(spare::give);
    }
}

/// Contiguous f32 tensor that derefs to its values.
struct Values(Primitive);

impl Values {
    fn of(tensor: Primitive) -> Self {
        Self(in_order(tensor))
    }

    /// Returns the values as weights, identified by their memory: Burn changes a tensor only through `Arc::make_mut`.
    fn weight(&self) -> Weight<'_> {
        let memory = Arc::downgrade(&self.0.data_arc());
        Weight::known(self.slice(), memory)
    }

    fn slice(&self) -> &[f32] {
        slice(&self.0)
    }
}

fn tensor<const D: usize>(values: Vec<f32>, extents: [usize; D]) -> Primitive {
    Primitive::from_data(TensorData::new(values, extents))
}

fn plan(input: &Primitive, weight: &Primitive, pool: usize) -> Arc<Block> {
    shared_block(shape_of(input.shape().dims(), weight.shape().dims(), pool))
}

/// Returns the shape of a block with input `[batch, steps, taxels, maps_in]` and weights
/// `[maps_out, maps_in, kernel steps, kernel taxels]`.
pub(crate) fn shape_of(input: [usize; 4], weight: [usize; 4], pool: usize) -> BlockShape {
    let [batch, steps, taxels, maps_in] = input;
    let [maps_out, _, kernel_steps, kernel_taxels] = weight;
    BlockShape {
        batch,
        steps,
        taxels,
        maps_in,
        maps_out,
        kernel: [kernel_steps, kernel_taxels],
        pool,
    }
}

/// Runs `pass` on a thread of rayon's pool.
///
/// From a thread outside the pool, rayon would hand over each parallel part separately and wait for it.
fn in_pool<R: Send>(pass: impl FnOnce() -> R + Send) -> R {
    rayon::scope(|_| pass())
}

fn pooled(values: Vec<f32>, shape: &BlockShape) -> Primitive {
    let extents = [
        shape.batch,
        shape.pooled_steps(),
        shape.taxels,
        shape.maps_out,
    ];
    tensor(values, extents)
}

/// Runs the forward pass and returns the output with the state for the backward pass.
fn train(inputs: [Primitive; 4], pool: usize) -> (BlockOutput<Flex>, State<Block, Saved>) {
    let block = plan(&inputs[0], &inputs[1], pool);
    let [input, weight, gamma, beta] = inputs.map(Values::of);
    let trained = in_pool(|| {
        block.forward_train(input.slice(), weight.weight(), gamma.slice(), beta.slice())
    });
    let maps = [block.shape().maps_out];
    reclaim(input.0);
    let output = BlockOutput {
        pooled: pooled(trained.pooled, block.shape()),
        mean: tensor(trained.mean, maps),
        variance: tensor(trained.variance, maps),
    };
    (output, State::new(block, trained.saved))
}

fn recycle(state: State<Block, Saved>) {
    state.block.recycle(state.take());
}

impl TrainableBlock for Flex {
    fn block_train(
        input: Primitive,
        weight: Primitive,
        gamma: Primitive,
        beta: Primitive,
        pool: usize,
    ) -> BlockOutput<Self> {
        let (output, state) = train([input, weight, gamma, beta], pool);
        recycle(state);
        output
    }
}

impl FrozenBlock for Flex {
    fn block_eval(
        input: Primitive,
        weight: Primitive,
        gamma: Primitive,
        beta: Primitive,
        mean: Primitive,
        variance: Primitive,
        pool: usize,
    ) -> Primitive {
        let block = plan(&input, &weight, pool);
        let [input, weight, gamma, beta, mean, variance] =
            [input, weight, gamma, beta, mean, variance].map(Values::of);
        let out = in_pool(|| {
            block.forward_eval(
                input.slice(),
                weight.weight(),
                gamma.slice(),
                beta.slice(),
                mean.slice(),
                variance.slice(),
            )
        });
        reclaim(input.0);
        pooled(out, block.shape())
    }
}

/// Planned block with the forward pass's state, which the backward pass takes once.
pub(crate) struct State<B, S> {
    pub(crate) block: Arc<B>,
    saved: Arc<Mutex<Option<S>>>,
}

impl<B, S> State<B, S> {
    pub(crate) fn new(block: Arc<B>, saved: S) -> Self {
        let saved = Arc::new(Mutex::new(Some(saved)));
        Self { block, saved }
    }

    /// Returns the state that the forward pass saved.
    ///
    /// # Panics
    /// If it has been taken before.
    pub(crate) fn take(&self) -> S {
        self.saved
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()
            .unwrap_or_else(|| panic!("a block's backward pass runs once"))
    }
}

impl<B, S> Clone for State<B, S> {
    fn clone(&self) -> Self {
        Self {
            block: Arc::clone(&self.block),
            saved: Arc::clone(&self.saved),
        }
    }
}

impl<B: fmt::Debug, S> fmt::Debug for State<B, S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("State").field(&self.block).finish()
    }
}

/// Returns the extents of a block's input, weights and per-map values.
pub(crate) fn extents(shape: &BlockShape) -> ([usize; 4], [usize; 4], [usize; 1]) {
    let BlockShape {
        batch,
        steps,
        taxels,
        maps_in,
        maps_out,
        kernel: [kernel_steps, kernel_taxels],
        ..
    } = *shape;
    (
        [batch, steps, taxels, maps_in],
        [maps_out, maps_in, kernel_steps, kernel_taxels],
        [maps_out],
    )
}

/// Runs a block's forward pass as one node of the autodiff graph; `unused` receives the saved state if no gradient is needed.
pub(crate) fn as_one_node<B, C, K>(
    operation: K,
    inputs: [FloatTensor<Autodiff<B, C>>; 4],
    train: impl FnOnce([FloatTensor<B>; 4]) -> (BlockOutput<B>, K::State),
    unused: impl FnOnce(K::State),
) -> BlockOutput<Autodiff<B, C>>
where
    B: Backend,
    C: CheckpointStrategy,
    K: Backward<B, 4>,
{
    let nodes = inputs.each_ref().map(|tensor| tensor.node());
    let prepared = operation.prepare::<C>(nodes).compute_bound().stateful();
    let (found, state) = train(inputs.map(|tensor| tensor.into_primitive()));
    let pooled = match prepared {
        OpsKind::Tracked(prepared) => prepared.finish(state, found.pooled),
        OpsKind::UnTracked(prepared) => {
            unused(state);
            prepared.finish(found.pooled)
        }
    };
    BlockOutput {
        pooled,
        mean: Autodiff::<B, C>::from_inner(found.mean),
        variance: Autodiff::<B, C>::from_inner(found.variance),
    }
}

/// Registers the gradients of input, weight, gamma and beta with the nodes that need them.
pub(crate) fn hand_on<B: Backend>(
    graph: &mut Graph,
    parents: [Option<NodeId>; 4],
    gradients: [Option<FloatTensor<B>>; 4],
) {
    for (node, gradient) in parents.into_iter().zip(gradients) {
        if let (Some(node), Some(gradient)) = (node, gradient) {
            graph.register::<B>(node, gradient);
        }
    }
}

#[derive(Debug)]
struct BlockBackward;

impl Backward<Flex, 4> for BlockBackward {
    type State = State<Block, Saved>;

    fn backward(
        self,
        ops: Ops<Self::State, 4>,
        graph: &mut Graph,
        _checkpointer: &mut Checkpointer,
    ) {
        let block = &ops.state.block;
        let saved = ops.state.take();
        let gradient = Values::of(graph.consume::<Flex>(&ops.node));
        let need_input = ops.parents[0].is_some();
        let found = in_pool(|| block.backward(saved, gradient.slice(), need_input));
        reclaim(gradient.0);
        let (input, weight, maps) = extents(block.shape());
        let gradients = [
            found.input.map(|values| tensor(values, input)),
            Some(tensor(found.weight, weight)),
            Some(tensor(found.gamma, maps)),
            Some(tensor(found.beta, maps)),
        ];
        let parents = ops.parents.map(|node| node.map(|node| node.id));
        hand_on::<Flex>(graph, parents, gradients);
    }
}

impl<C: CheckpointStrategy> TrainableBlock for Autodiff<Flex, C> {
    fn block_train(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        pool: usize,
    ) -> BlockOutput<Self> {
        let inputs = [input, weight, gamma, beta];
        as_one_node::<Flex, C, _>(BlockBackward, inputs, |inputs| train(inputs, pool), recycle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // No other test uses these sizes.
    fn tensor(len: usize) -> Primitive {
        Primitive::from_data(TensorData::new(vec![7f32; len], [len]))
    }

    #[test]
    fn memory_of_a_tensor_is_taken_again() {
        let len = spare::MIN_LEN + 1234;
        // Other tests may evict this memory in between, but not in all attempts.
        let found = (0..100).any(|_| {
            let lost = tensor(len);
            reclaim(lost);
            let (again, other) = (spare::take(len), spare::take(len));
            // The memory is handed out once with its old content; new memory is zero.
            assert!(other.iter().all(|&value| value == 0.0));
            again.iter().all(|&value| value == 7.0)
        });
        assert!(found);
    }

    #[test]
    fn memory_of_a_shared_tensor_is_not_taken() {
        let len = spare::MIN_LEN + 4321;
        let held = tensor(len);
        reclaim(held.clone());
        let mut taken = spare::take(len);
        taken.fill(1.0);
        assert!(held.storage::<f32>().iter().all(|&value| value == 7.0));
    }
}
