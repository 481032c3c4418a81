//! The block of `tactnet-conv-gpu`, and Adam, as operations of Burn's CubeCL backend.

use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients as Graph;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, AutodiffBackend, Cube, CubeDevice, TensorMetadata};
use burn_cubecl::kernel::into_contiguous;
use cubecl::server::Handle;
use tactnet_conv::{AdamStep, BlockShape};
use tactnet_conv_gpu::{Block, Saved};

use crate::adam_update::{AdamOutput, AdamUpdate};
use crate::conv::{BlockOutput, FrozenBlock, TrainableBlock, shape_of};

type Primitive = FloatTensor<Cube>;
type Plans = HashMap<(CubeDevice, BlockShape), Arc<Block>>;

/// Plans that are kept; a training uses one for each block and each size of batch.
const MAX_PLANS: usize = 64;

/// Returns the plan for a shape on the device of `input`; constant tables lie on the device once.
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

/// A tensor of `extents` in the buffer `handle`, on the device of `like`.
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

/// The forward pass, and what its backward pass needs.
fn train(inputs: [Primitive; 4], pool: usize) -> (BlockOutput<Cube>, State) {
    let block = plan(&inputs[0], &inputs[1], pool);
    let [input, weight, gamma, beta] = inputs.map(into_contiguous);
    let trained = block.forward_train(&input.handle, &weight.handle, &gamma.handle, &beta.handle);
    let maps = [block.shape().maps_out];
    let output = BlockOutput {
        pooled: pooled(&input, trained.pooled, block.shape()),
        mean: tensor(&input, trained.mean, maps),
        variance: tensor(&input, trained.variance, maps),
    };
    let saved = Arc::new(Mutex::new(Some(trained.saved)));
    (output, State { block, saved })
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

/// State for the backward pass; it can be taken once.
#[derive(Clone)]
struct State {
    block: Arc<Block>,
    saved: Arc<Mutex<Option<Saved>>>,
}

impl fmt::Debug for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("State").field(self.block.shape()).finish()
    }
}

#[derive(Debug)]
struct BlockBackward;

impl Backward<Cube, 4> for BlockBackward {
    type State = State;

    fn backward(self, ops: Ops<State, 4>, graph: &mut Graph, _checkpointer: &mut Checkpointer) {
        let State { block, saved } = &ops.state;
        let shape = *block.shape();
        let saved = saved
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()
            .unwrap_or_else(|| panic!("a block's backward pass runs once"));
        let gradient = into_contiguous(graph.consume::<Cube>(&ops.node));
        let [input, weight, gamma, beta] = ops.parents;
        let found = block.backward(saved, &gradient.handle, input.is_some());
        let maps = [shape.maps_out];
        if let (Some(node), Some(handle)) = (input, found.input) {
            let extents = [shape.batch, shape.steps, shape.taxels, shape.maps_in];
            graph.register::<Cube>(node.id, tensor(&gradient, handle, extents));
        }
        if let Some(node) = weight {
            let [kernel_steps, kernel_taxels] = shape.kernel;
            let extents = [shape.maps_out, shape.maps_in, kernel_steps, kernel_taxels];
            graph.register::<Cube>(node.id, tensor(&gradient, found.weight, extents));
        }
        if let Some(node) = gamma {
            graph.register::<Cube>(node.id, tensor(&gradient, found.gamma, maps));
        }
        if let Some(node) = beta {
            graph.register::<Cube>(node.id, tensor(&gradient, found.beta, maps));
        }
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
        let nodes = inputs.each_ref().map(|tensor| tensor.node());
        let prepared = BlockBackward.prepare::<C>(nodes).compute_bound().stateful();
        let (found, state) = train(inputs.map(|tensor| tensor.into_primitive()), pool);
        let pooled = match prepared {
            OpsKind::Tracked(prepared) => prepared.finish(state, found.pooled),
            OpsKind::UnTracked(prepared) => prepared.finish(found.pooled),
        };
        BlockOutput {
            pooled,
            mean: Self::from_inner(found.mean),
            variance: Self::from_inner(found.variance),
        }
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
