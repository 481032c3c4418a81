//! Convolution block and Adam of `tactnet-conv-gpu` as operations of Burn's CubeCL backend.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients as Graph;
use burn::backend::autodiff::ops::{Backward, Ops};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Cube, CubeDevice, TensorMetadata};
use burn_cubecl::kernel::into_contiguous;
use cubecl::server::Handle;
use tactnet_conv::{AdamStep, BlockShape};
use tactnet_conv_gpu::{Block, Saved};

use crate::adam_update::{AdamOutput, AdamUpdate};
use crate::conv::{
    BlockOutput, FrozenBlock, State, TrainableBlock, as_one_node, extents, hand_on, shape_of,
};

type Primitive = FloatTensor<Cube>;
type Plans = HashMap<(CubeDevice, BlockShape), Arc<Block>>;

/// Maximum number of cached plans; training uses one plan for each block and batch size.
const MAX_PLANS: usize = 64;

/// Returns the cached plan of a shape on the device of `input`; a new plan uploads its constant tables once.
fn plan(input: &Primitive, weight: &Primitive, pool: usize) -> Arc<Block> {
    static PLANS: LazyLock<Mutex<Plans>> = LazyLock::new(Mutex::default);
    let shape = shape_of(input.shape().dims(), weight.shape().dims(), pool);
    let mut plans = PLANS.lock().unwrap_or_else(PoisonError::into_inner);
    if plans.len() >= MAX_PLANS {
        plans.clear();
    }
    let plan = plans
        .entry((input.device.clone(), shape))
        .or_insert_with(|| Arc::new(Block::plan(&input.client, shape)));
    Arc::clone(plan)
}

/// Returns a tensor of `extents` over the buffer `handle`, on the device of `like`.
fn tensor<const D: usize>(like: &Primitive, handle: Handle, extents: [usize; D]) -> Primitive {
    let (client, device) = (like.client.clone(), like.device.clone());
    Primitive::new_contiguous(client, device, extents.into(), handle, like.dtype)
}

fn pooled(like: &Primitive, handle: Handle, shape: &BlockShape) -> Primitive {
    let extents = [
        shape.batch,
        shape.pooled_steps(),
        shape.taxels,
        shape.maps_out,
    ];
    tensor(like, handle, extents)
}

/// Runs the forward pass and returns the output with the state for the backward pass.
fn train(inputs: [Primitive; 4], pool: usize) -> (BlockOutput<Cube>, State<Block, Saved>) {
    let block = plan(&inputs[0], &inputs[1], pool);
    let [input, weight, gamma, beta] = inputs.map(into_contiguous);
    let trained = block.forward_train(&input.handle, &weight.handle, &gamma.handle, &beta.handle);
    let maps = [block.shape().maps_out];
    let output = BlockOutput {
        pooled: pooled(&input, trained.pooled, block.shape()),
        mean: tensor(&input, trained.mean, maps),
        variance: tensor(&input, trained.variance, maps),
    };
    (output, State::new(block, trained.saved))
}

impl TrainableBlock for Cube {
    fn block_train(
        input: Primitive,
        weight: Primitive,
        gamma: Primitive,
        beta: Primitive,
        pool: usize,
    ) -> BlockOutput<Self> {
        train([input, weight, gamma, beta], pool).0
    }
}

impl FrozenBlock for Cube {
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
        let [input, weight] = [input, weight].map(into_contiguous);
        let norm = [gamma, beta, mean, variance].map(into_contiguous);
        let norm = norm.each_ref().map(|tensor| &tensor.handle);
        let found = block.forward_eval(&input.handle, &weight.handle, norm);
        pooled(&input, found, block.shape())
    }
}

#[derive(Debug)]
struct BlockBackward;

impl Backward<Cube, 4> for BlockBackward {
    type State = State<Block, Saved>;

    fn backward(
        self,
        ops: Ops<Self::State, 4>,
        graph: &mut Graph,
        _checkpointer: &mut Checkpointer,
    ) {
        let block = &ops.state.block;
        let saved = ops.state.take();
        let gradient = into_contiguous(graph.consume::<Cube>(&ops.node));
        let found = block.backward(saved, &gradient.handle, ops.parents[0].is_some());
        let (input, weight, maps) = extents(block.shape());
        let gradients = [
            found.input.map(|handle| tensor(&gradient, handle, input)),
            Some(tensor(&gradient, found.weight, weight)),
            Some(tensor(&gradient, found.gamma, maps)),
            Some(tensor(&gradient, found.beta, maps)),
        ];
        let parents = ops.parents.map(|node| node.map(|node| node.id));
        hand_on::<Cube>(graph, parents, gradients);
    }
}

impl<C: CheckpointStrategy> TrainableBlock for Autodiff<Cube, C> {
    fn block_train(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        pool: usize,
    ) -> BlockOutput<Self> {
        let inputs = [input, weight, gamma, beta];
        as_one_node::<Cube, C, _>(BlockBackward, inputs, |inputs| train(inputs, pool), drop)
    }
}

impl AdamUpdate for Cube {
    fn adam_update(
        parameter: Primitive,
        gradient: Primitive,
        first: Primitive,
        second: Primitive,
        step: AdamStep,
    ) -> AdamOutput<Self> {
        let [parameter, gradient, first, second] =
            [parameter, gradient, first, second].map(into_contiguous);
        let found = tactnet_conv_gpu::adam_update(
            &gradient.client,
            step,
            gradient.shape().num_elements(),
            [
                &parameter.handle,
                &gradient.handle,
                &first.handle,
                &second.handle,
            ],
        );
        let [parameter, first, second] = found.map(|handle| {
            let (client, device) = (gradient.client.clone(), gradient.device.clone());
            Primitive::new_contiguous(client, device, gradient.shape(), handle, gradient.dtype)
        });
        AdamOutput {
            parameter,
            first,
            second,
        }
    }
}
