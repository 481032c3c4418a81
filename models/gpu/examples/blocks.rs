//! Times of the three blocks of TactNet-II on the default device in ms: medians of ten runs of twenty passes each.
use std::time::Instant;

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;
use tactnet_conv::BlockShape;
use tactnet_conv_gpu::Block;

const PASSES: usize = 20;

fn time(client: &Client, mut pass: impl FnMut()) -> f64 {
    let sync = || cubecl::future::block_on(client.sync()).expect("a working device");
    pass();
    pass();
    sync();
    let mut times: Vec<f64> = (0..10)
        .map(|_| {
            let begin = Instant::now();
            for _ in 0..PASSES {
                pass();
            }
            sync();
            begin.elapsed().as_secs_f64() * 1e3 / PASSES as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[5]
}

fn main() {
    let client = cubecl::Device::default().client();
    println!("{}", client.name());
    let [batch, taxels]: [usize; 2] = [36, 16];
    let mut whole = [0.0; 2];
    for (layer, steps, maps_in, maps_out) in [(1, 1000, 1, 32), (2, 100, 32, 64), (3, 10, 64, 128)]
    {
        let shape = BlockShape {
            batch,
            steps,
            taxels,
            maps_in,
            maps_out,
            kernel: [15, 5],
            pool: 10,
        };
        let noise = |len: usize, seed: u32| -> Handle {
            let mut state = seed;
            let values: Vec<f32> = (0..len)
                .map(|_| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (state >> 8) as f32 / 16_777_216.0 - 0.5
                })
                .collect();
            client.create_from_slice(f32::as_bytes(&values))
        };
        let block = Block::plan(&client, shape);
        let input = noise(shape.input_len(), 1);
        let weight = noise(shape.weight_len(), 2);
        let [gamma, beta] = [3, 4].map(|seed| noise(maps_out, seed));
        let gradient = noise(shape.output_len(), 5);
        let forward = time(&client, || {
            block.forward_train(&input, &weight, &gamma, &beta);
        });
        let train = |need_input: bool| {
            time(&client, || {
                let found = block.forward_train(&input, &weight, &gamma, &beta);
                block.backward(found.saved, &gradient, need_input);
            })
        };
        let (without, with) = (train(false), train(true));
        println!("layer {layer}: forward {forward:.3} both {without:.3} with input {with:.3} ms");
        whole[0] += if layer == 1 { without } else { with };
        whole[1] += with;
    }
    println!(
        "blocks of a step: clean {:.3} ms, with the gradient of the input {:.3} ms",
        whole[0], whole[1]
    );
}
