//! Cost of a frame during a sweep, and of the scores after the last one: `cargo bench --bench online`.
//!
//! A fresh full-size network: the work does not depend on the weights.

use divan::Bencher;
use rand_chacha::ChaCha8Rng;
use tactnet_models::{Architecture, Compute, InputShape, StreamingNet, TactNet, TactNetConfig};

const STEPS: usize = 1000;
const TAXELS: usize = 16;

fn main() {
    divan::main();
}

fn network(mc_samples: usize) -> StreamingNet {
    let input = InputShape {
        steps: STEPS,
        taxels: TAXELS,
    };
    let config = TactNetConfig::new(Architecture::default(), input, 36)
        .unwrap_or_else(|error| panic!("{error}"));
    let device = Compute::Cpu
        .open()
        .unwrap_or_else(|error| panic!("{error}"));
    let mut rng: ChaCha8Rng = rand_chacha::rand_core::SeedableRng::seed_from_u64(1);
    let net = TactNet::init(&config, &device, &mut rng);
    // Four features kept, one dropped, as with a keep probability of 0.8.
    let mask = |i: usize| {
        if (i * 2_654_435_761) >> 16 & 0xff < 205 {
            1.25
        } else {
            0.0
        }
    };
    let masks: Vec<f32> = (0..mc_samples * config.features()).map(mask).collect();
    StreamingNet::new(&net, &config, &masks)
}

fn frame(number: usize) -> [f32; TAXELS] {
    std::array::from_fn(|taxel| ((number * 31 + taxel * 17) % 23) as f32 - 11.0)
}

/// A whole sweep, frame by frame, without scores: divide by 1000.
#[divan::bench(sample_count = 50)]
fn all_frames_of_a_sweep(bencher: Bencher) {
    let mut net = network(0);
    bencher.bench_local(|| {
        net.restart();
        (0..STEPS).for_each(|number| net.push(&frame(number)));
    });
}

/// The frame that moves all three blocks.
#[divan::bench(sample_count = 100)]
fn heaviest_frame(bencher: Bencher) {
    // Layer 1 closes its windows seven frames late, layer 2 seven rows late.
    let heaviest = 99 + 7 + 70 + 1;
    bencher
        .with_inputs(|| {
            let mut net = network(0);
            (0..heaviest - 1).for_each(|number| net.push(&frame(number)));
            net
        })
        .bench_local_refs(|net| net.push(&frame(heaviest - 1)));
}

/// From the last frame to the scores; 0: plainly, else with so many dropout masks.
#[divan::bench(args = [0, 100], sample_count = 200)]
fn after_the_last_frame(bencher: Bencher, mc_samples: usize) {
    let mut net = network(mc_samples);
    (0..STEPS - 1).for_each(|number| net.push(&frame(number)));
    net.push(&frame(STEPS - 1));
    bencher.bench_local(|| {
        let mut sum = 0.0;
        if mc_samples == 0 {
            net.scores(|scores| sum += scores[0]);
        } else {
            net.monte_carlo_scores(|scores| sum += scores[0]);
        }
        sum
    });
}
