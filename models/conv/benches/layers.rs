//! Time of a training step by layer of TactNet-II, for an array of any shape:
//! `cargo bench -p tactnet-conv --bench layers -- 6x10x75 [BATCH]` (rows x columns x steps; batch 36 by default).
//!
//! The last line is the memory that all layers together keep for the next step.

use std::hint::black_box;
use std::time::Instant;

use tactnet_conv::{Block, BlockShape, Candidate, Isa, spare, workspace_bytes};

const MAPS: [usize; 4] = [1, 32, 64, 128];
const POOL: usize = 10;

fn values(len: usize) -> Vec<f32> {
    (0..len)
        .map(|i| ((i * 7919) % 1013) as f32 / 506.5 - 1.0)
        .collect()
}

/// Returns the median of 31 runs in milliseconds, without the time of `prepare`.
fn median<T>(mut prepare: impl FnMut() -> T, mut run: impl FnMut(T)) -> f64 {
    let mut times: Vec<f64> = (0..31)
        .map(|_| {
            let prepared = prepare();
            let begin = Instant::now();
            run(prepared);
            begin.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() {
    // On a pool thread, as in `tactnet-models`.
    rayon::scope(|_| run());
}

fn run() {
    let mut arguments = std::env::args().skip(1).filter(|word| word != "--bench");
    let array = arguments.next().unwrap_or_else(|| "4x4x1000".into());
    let number = |text: &str| -> usize {
        text.parse()
            .unwrap_or_else(|_| panic!("expected a number, found {text}"))
    };
    let batch = arguments.next().map_or(36, |text| number(&text));
    let sizes: Vec<usize> = array.split('x').map(number).collect();
    let [rows, cols, mut steps] = sizes[..] else {
        panic!("expected ROWSxCOLSxSTEPS, found {array}");
    };
    println!(
        "{array}, batch {batch}, {:?}: forward, backward, backward with the input's gradient, frozen statistics, ms",
        Isa::detect()
    );
    for layer in 0..3 {
        let shape = BlockShape {
            batch,
            steps,
            taxels: rows * cols,
            maps_in: MAPS[layer],
            maps_out: MAPS[layer + 1],
            kernel: [15, 5],
            pool: POOL,
        };
        let [ahead, back, with_input, frozen] = times(shape);
        let tiling = Block::candidates(shape, Isa::detect());
        println!(
            "layer {}: {ahead:7.3} {back:7.3} {with_input:7.3} {frozen:7.3}   {}",
            layer + 1,
            tiling.first().map(Candidate::to_string).unwrap_or_default()
        );
        steps = steps.div_ceil(POOL);
    }
    println!(
        "kept between passes: workspaces {} MiB, results {} MiB",
        workspace_bytes() >> 20,
        spare::bytes() >> 20
    );
}

/// Returns the medians in ms of forward, backward, backward with the input's gradient, and forward with fixed statistics.
fn times(shape: BlockShape) -> [f64; 4] {
    let block = Block::plan(shape);
    let (input, weight) = (values(shape.input_len()), values(shape.weight_len()));
    let (gamma, beta) = (vec![1.0; shape.maps_out], vec![0.0; shape.maps_out]);
    let gradient = values(shape.output_len());
    let forward = || block.forward_train(&input, &weight, &gamma, &beta);
    let ahead = median(
        || (),
        |()| {
            let found = forward();
            spare::give(black_box(found.pooled));
            block.recycle(found.saved);
        },
    );
    let back = [false, true].map(|need_input| {
        median(
            || {
                let found = forward();
                spare::give(found.pooled);
                found.saved
            },
            |saved| {
                let found = block.backward(saved, &gradient, need_input);
                spare::give(black_box(found.weight));
                found.input.into_iter().for_each(spare::give);
            },
        )
    });
    let frozen = median(
        || (),
        |()| {
            let found = block.forward_eval(&input, &weight, &gamma, &beta, &beta, &gamma);
            spare::give(black_box(found));
        },
    );
    [ahead, back[0], back[1], frozen]
}
