//! Time of the block, layer by layer, at TactMat's size: `cargo bench -p tactnet-conv --bench block`.

use divan::{Bencher, black_box};
use tactnet_conv::{Block, BlockShape};

fn main() {
    divan::main();
}

/// Layers of TactNet-II: steps, input maps, output maps.
const LAYERS: [(usize, usize, usize); 3] = [(1000, 1, 32), (100, 32, 64), (10, 64, 128)];
const BATCHES: [usize; 2] = [1, 36];

/// Block with deterministic inputs for all passes.
struct Layer {
    block: Block,
    input: Vec<f32>,
    weight: Vec<f32>,
    gamma: Vec<f32>,
    beta: Vec<f32>,
}

fn values(len: usize) -> Vec<f32> {
    (0..len)
        .map(|i| ((i * 7919) % 1013) as f32 / 506.5 - 1.0)
        .collect()
}

impl Layer {
    fn new(batch: usize, layer: usize) -> Self {
        let (steps, maps_in, maps_out) = LAYERS[layer];
        let shape = BlockShape {
            batch,
            steps,
            taxels: 16,
            maps_in,
            maps_out,
            kernel: [15, 5],
            pool: 10,
        };
        Self {
            block: Block::plan(shape),
            input: values(shape.input_len()),
            weight: values(shape.weight_len()),
            gamma: vec![1.0; maps_out],
            beta: vec![0.0; maps_out],
        }
    }
}

#[divan::bench(args = [0, 1, 2], consts = BATCHES)]
fn forward<const BATCH: usize>(bencher: Bencher, layer: usize) {
    let it = Layer::new(BATCH, layer);
    bencher.bench_local(|| {
        let found = it
            .block
            .forward_train(&it.input, &it.weight, &it.gamma, &it.beta);
        it.block.recycle(black_box(found).saved);
    });
}

fn backward<const BATCH: usize>(bencher: Bencher, layer: usize, need_input: bool) {
    let it = Layer::new(BATCH, layer);
    let gradient = values(it.block.shape().output_len());
    bencher
        .with_inputs(|| {
            it.block
                .forward_train(&it.input, &it.weight, &it.gamma, &it.beta)
                .saved
        })
        .bench_local_values(|saved| it.block.backward(saved, &gradient, need_input));
}

#[divan::bench(args = [0, 1, 2], consts = BATCHES)]
fn backward_with_input_gradient<const BATCH: usize>(bencher: Bencher, layer: usize) {
    backward::<BATCH>(bencher, layer, true);
}

#[divan::bench(args = [0, 1, 2], consts = BATCHES)]
fn backward_without_input_gradient<const BATCH: usize>(bencher: Bencher, layer: usize) {
    backward::<BATCH>(bencher, layer, false);
}
