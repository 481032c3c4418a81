//! The planner's choice compared with all its tilings: `cargo bench -p tactnet-conv --bench planner`.
//! `RAYON_NUM_THREADS` sets the number of threads.
//!
//! Times a training step with the input's gradient for each candidate of each shape in a grid, interleaved, as medians. `choice` is the time of
//! the first candidate over that of the fastest; the cost model aims at 1.15 or less.

use std::time::Instant;

use tactnet_conv::{Block, BlockShape, Candidate, Isa};

const TURNS: usize = 5;
/// Taxels, steps, kernel, batch; each with two pairs of maps.
const GRID: [(usize, usize, [usize; 2], usize); 16] = [
    (1, 880, [15, 5], 36),
    (4, 300, [9, 3], 36),
    (9, 64, [15, 5], 36),
    (16, 100, [15, 5], 36),
    (16, 100, [31, 7], 16),
    (16, 2000, [15, 5], 2),
    (19, 40, [15, 5], 36),
    (25, 60, [15, 5], 36),
    (33, 50, [15, 5], 16),
    (48, 100, [3, 1], 16),
    (60, 75, [15, 5], 16),
    (64, 40, [15, 5], 36),
    (64, 400, [31, 7], 2),
    (100, 20, [5, 3], 16),
    (256, 100, [15, 5], 2),
    (1024, 10, [15, 5], 4),
];
const MAPS: [[usize; 2]; 2] = [[32, 64], [64, 128]];

fn values(len: usize) -> Vec<f32> {
    (0..len)
        .map(|i| ((i * 7919) % 1013) as f32 / 506.5 - 1.0)
        .collect()
}

fn step(block: &Block, input: &[f32], weight: &[f32]) -> f64 {
    let maps = block.shape().maps_out;
    let (gamma, beta) = (vec![1.0; maps], vec![0.0; maps]);
    let begun = Instant::now();
    let forward = block.forward_train(input, weight, &gamma, &beta);
    let gradients = block.backward(forward.saved, &forward.pooled, true);
    let seconds = begun.elapsed().as_secs_f64();
    if let Some(input) = gradients.input {
        tactnet_conv::spare::give(input);
    }
    tactnet_conv::spare::give(forward.pooled);
    seconds * 1e3
}

/// Candidate with its median time in ms.
struct Timed {
    candidate: Candidate,
    median: f64,
}

/// Times the candidates of a shape in turns; the first is the planner's choice.
fn time_candidates(shape: BlockShape, isa: Isa) -> Vec<Timed> {
    let (input, weight) = (values(shape.input_len()), values(shape.weight_len()));
    let candidates = Block::candidates(shape, isa);
    // Skips candidates with three times the best predicted time.
    let limit = 3.0 * candidates[0].predicted_ms;
    let mut timed: Vec<_> = candidates
        .into_iter()
        .filter(|candidate| candidate.predicted_ms <= limit)
        .map(|candidate| {
            let block = Block::plan_candidate(shape, isa, &candidate);
            step(&block, &input, &weight);
            (candidate, block, Vec::new())
        })
        .collect();
    for _ in 0..TURNS {
        for (_, block, times) in &mut timed {
            times.push(step(block, &input, &weight));
        }
    }
    timed
        .into_iter()
        .map(|(candidate, _, mut times)| {
            times.sort_by(f64::total_cmp);
            let median = times[TURNS / 2];
            Timed { candidate, median }
        })
        .collect()
}

fn main() {
    let threads = std::env::var("RAYON_NUM_THREADS").unwrap_or_else(|_| "all".into());
    let mut worst = Vec::new();
    let sets = Isa::all();
    for isa in sets.into_iter().filter(|isa| *isa != Isa::Portable) {
        for (taxels, steps, kernel, batch) in GRID {
            for maps in MAPS {
                let shape = BlockShape {
                    batch,
                    steps,
                    taxels,
                    maps_in: maps[0],
                    maps_out: maps[1],
                    kernel,
                    pool: 10,
                };
                let timed = time_candidates(shape, isa);
                let medians = timed.iter().map(|timed| timed.median);
                let choice = timed[0].median / medians.fold(f64::INFINITY, f64::min);
                worst.push(choice);
                println!(
                    "{isa:?} {batch} x {steps} x {taxels}, {maps:?}, kernel {kernel:?}, {threads} threads: choice {choice:.2}"
                );
                for Timed { candidate, median } in timed {
                    println!(
                        "    {candidate}: {median:.2} ms, predicted {:.2}",
                        candidate.predicted_ms
                    );
                }
            }
        }
    }
    worst.sort_by(f64::total_cmp);
    let within = worst.iter().filter(|&&choice| choice <= 1.15).count();
    println!(
        "{within} of {} within 15 %; worst {:.2}",
        worst.len(),
        worst[worst.len() - 1]
    );
}
