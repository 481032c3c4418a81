//! Time of one frame during a sweep, and of the scores after the last one, for arrays of 1 to 1024 taxels: `cargo bench --bench online`.
//!
//! The network is full-size and untrained, because its computing time does not depend on the weights.

use divan::Bencher;
use rand_chacha::ChaCha8Rng;
use tactnet_models::{Architecture, Compute, InputShape, Network, NetworkConfig, StreamingNet};

const STEPS: usize = 1000;
const ARRAYS: [usize; 5] = [1, 16, 64, 256, 1024];

fn main() {
    divan::main();
}

fn network(taxels: usize, mc_samples: usize) -> StreamingNet {
    let input = InputShape {
        steps: STEPS,
        taxels,
    };
    let config = NetworkConfig::new(Architecture::default(), input, 36)
        .unwrap_or_else(|error| panic!("{error}"));
    let device = Compute::Cpu
        .open()
        .unwrap_or_else(|error| panic!("{error}"));
    let mut rng: ChaCha8Rng = rand_chacha::rand_core::SeedableRng::seed_from_u64(1);
    let net = Network::init(&config, &device, &mut rng);
    // Keeps four features of five, as with a keep probability of 0.8.
    let mask = |i: usize| {
        if (i.wrapping_mul(2_654_435_761)) >> 16 & 0xff < 205 {
            1.25
        } else {
            0.0
        }
    };
    let masks: Vec<f32> = (0..mc_samples * config.features()).map(mask).collect();
    StreamingNet::new(&net, &config, &masks)
}

fn frame(taxels: usize, number: usize) -> Vec<f32> {
    let value = |taxel| ((number * 31 + taxel * 17) % 23) as f32 - 11.0;
    (0..taxels).map(value).collect()
}

/// Returns a network that has received all frames of a sweep except the last.
fn almost_whole(taxels: usize, mc_samples: usize) -> StreamingNet {
    let mut net = network(taxels, mc_samples);
    (0..STEPS - 1).for_each(|number| net.push(&frame(taxels, number)));
    net
}

/// Whole sweep frame by frame, without scores. Divide by 1000 for the time per frame; a real sweep lasts 1333 ms.
#[divan::bench(args = ARRAYS, sample_count = 5, sample_size = 1)]
fn all_frames_of_a_sweep(bencher: Bencher, taxels: usize) {
    let mut net = network(taxels, 0);
    let frames: Vec<Vec<f32>> = (0..STEPS).map(|number| frame(taxels, number)).collect();
    bencher.bench_local(|| {
        net.restart();
        frames.iter().for_each(|frame| net.push(frame));
    });
}

/// Frame that advances all three blocks.
#[divan::bench(args = ARRAYS, sample_count = 20, sample_size = 1)]
fn heaviest_frame(bencher: Bencher, taxels: usize) {
    // Layer 1 closes its windows seven frames late, layer 2 seven rows late.
    let heaviest = 99 + 7 + 70 + 1;
    let mut net = network(taxels, 0);
    let last = frame(taxels, heaviest - 1);
    (0..heaviest - 1).for_each(|number| net.push(&frame(taxels, number)));
    bencher
        .with_inputs(|| net.clone())
        .bench_local_refs(|net| net.push(&last));
}

/// Time from the last frame, including it, to the scores, with 0 or 100 dropout masks.
#[divan::bench(args = [(1, 0), (16, 0), (64, 0), (256, 0), (1024, 0), (16, 100), (64, 100)], sample_count = 20, sample_size = 1)]
fn after_the_last_frame(bencher: Bencher, (taxels, mc_samples): (usize, usize)) {
    let begun = almost_whole(taxels, mc_samples);
    let last = frame(taxels, STEPS - 1);
    bencher
        .with_inputs(|| begun.clone())
        .bench_local_refs(|net| {
            net.push(&last);
            let mut sum = 0.0;
            if mc_samples == 0 {
                net.scores(|scores| sum += scores[0]);
            } else {
                net.monte_carlo_scores(|scores| sum += scores[0]);
            }
            sum
        });
}
