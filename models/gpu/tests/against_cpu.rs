//! The GPU block compared with the CPU block: outputs and all gradients.
#![cfg(feature = "vulkan")]

mod noise;

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;
use tactnet_conv::{AdamStep, Block as CpuBlock, BlockShape, Weight};
use tactnet_conv_gpu::Block;

use noise::noise;

fn upload(client: &Client, values: &[f32]) -> Handle {
    client.create_from_slice(f32::as_bytes(values))
}

fn read(client: &Client, handle: Handle) -> Vec<f32> {
    f32::from_bytes(&client.read_one_unchecked(handle)).to_vec()
}

fn apart(name: &str, found: &[f32], expected: &[f32]) -> f64 {
    assert_eq!(found.len(), expected.len(), "{name}");
    let (mut off, mut all) = (0f64, 0f64);
    for (f, e) in found.iter().zip(expected) {
        off += f64::from(f - e).powi(2);
        all += f64::from(*e).powi(2);
    }
    let apart = (off / all.max(1e-30)).sqrt();
    assert!(apart.is_finite(), "{name}: {apart}");
    apart
}

fn check(shape: BlockShape) {
    let client = cubecl::Device::default().client();
    let input = noise(shape.input_len(), 1);
    let weight = noise(shape.weight_len(), 2);
    let gamma: Vec<f32> = noise(shape.maps_out, 3).iter().map(|v| v + 0.2).collect();
    let beta = noise(shape.maps_out, 4);
    let gradient = noise(shape.output_len(), 5);

    let cpu = CpuBlock::plan(shape);
    let expected = cpu.forward_train(&input, Weight::from(&weight), &gamma, &beta);
    let gradients = cpu.backward(expected.saved, &gradient, true);

    let block = Block::plan(&client, shape);
    let [x, w, g, b, d] = [&input, &weight, &gamma, &beta, &gradient].map(|v| upload(&client, v));
    let found = block.forward_train(&x, &w, &g, &b);
    let frozen = block.forward_eval(&x, &w, [&g, &b, &found.mean, &found.variance]);
    let mut all = vec![
        (
            "pooled",
            apart("pooled", &read(&client, found.pooled), &expected.pooled),
        ),
        (
            "frozen",
            apart("frozen", &read(&client, frozen), &expected.pooled),
        ),
        (
            "mean",
            apart("mean", &read(&client, found.mean), &expected.mean),
        ),
        (
            "variance",
            apart(
                "variance",
                &read(&client, found.variance),
                &expected.variance,
            ),
        ),
    ];
    let back = block.backward(found.saved, &d, true);
    let input = back.input.expect("asked for");
    for (name, handle, expected) in [
        ("weight", back.weight, &gradients.weight),
        ("gamma", back.gamma, &gradients.gamma),
        ("beta", back.beta, &gradients.beta),
        ("input", input, gradients.input.as_ref().expect("asked for")),
    ] {
        all.push((name, apart(name, &read(&client, handle), expected)));
    }
    println!("{shape:?}: {all:?}");
    for (name, apart) in all {
        assert!(apart < 1e-4, "{name} of {shape:?}: {apart:e}");
    }
}

fn shape(
    batch: usize,
    steps: usize,
    taxels: usize,
    maps: [usize; 2],
    kernel: [usize; 2],
    pool: usize,
) -> BlockShape {
    BlockShape {
        batch,
        steps,
        taxels,
        maps_in: maps[0],
        maps_out: maps[1],
        kernel,
        pool,
    }
}

#[test]
fn first_layer() {
    check(shape(3, 100, 16, [1, 32], [15, 5], 10));
    check(shape(2, 37, 5, [1, 7], [9, 3], 4));
    // Fewer taxels than the kernel, fewer steps than a strip, maps of several groups of lanes.
    check(shape(3, 5, 2, [1, 40], [15, 5], 3));
    check(shape(2, 21, 24, [1, 33], [5, 7], 10));
}

#[test]
fn few_maps() {
    check(shape(2, 50, 6, [3, 10], [15, 5], 10));
    // A kernel that is too long for registers.
    check(shape(2, 60, 4, [1, 6], [35, 3], 8));
}

#[test]
fn one_window() {
    check(shape(3, 20, 16, [32, 64], [15, 5], 10));
    check(shape(2, 11, 3, [5, 6], [7, 5], 3));
}

#[test]
fn cut_into_ranges() {
    check(shape(2, 331, 4, [4, 9], [15, 5], 10));
    check(shape(1, 170, 7, [6, 8], [31, 3], 7));
}

#[test]
fn a_kernel_longer_than_the_sweep() {
    check(shape(4, 3, 2, [8, 8], [15, 5], 2));
}

#[test]
fn adam_takes_the_same_step() {
    let client = cubecl::Device::default().client();
    let step = AdamStep {
        l2: 1e-3,
        beta: [0.9, 0.999],
        rate: 1e-2,
        epsilon: 1e-8,
    };
    // Not a multiple of a cube.
    let len = 70_001;
    let [mut parameter, gradient, mut first] = [1, 2, 3].map(|seed| noise(len, seed));
    let mut second: Vec<f32> = noise(len, 4).iter().map(|v| v * v).collect();
    let handles = [&parameter, &gradient, &first, &second].map(|v| upload(&client, v));
    let found = tactnet_conv_gpu::adam_update(&client, step, len, handles.each_ref());
    step.update(&mut parameter, &gradient, [&mut first, &mut second]);
    let [p, m, v] = found.map(|handle| read(&client, handle));
    assert!(apart("parameter", &p, &parameter) < 1e-6);
    assert!(apart("first moment", &m, &first) < 1e-6);
    assert!(apart("second moment", &v, &second) < 1e-6);
}

#[test]
fn runs_agree_to_the_bit() {
    let client = cubecl::Device::default().client();
    let shape = shape(3, 90, 5, [1, 12], [15, 5], 10);
    let block = Block::plan(&client, shape);
    let input = upload(&client, &noise(shape.input_len(), 1));
    let weight = upload(&client, &noise(shape.weight_len(), 2));
    let norm = [3, 4].map(|seed| upload(&client, &noise(shape.maps_out, seed)));
    let gradient = upload(&client, &noise(shape.output_len(), 5));
    let run = || {
        let found = block.forward_train(&input, &weight, &norm[0], &norm[1]);
        let pooled = read(&client, found.pooled.clone());
        let back = block.backward(found.saved, &gradient, true);
        let input = back.input.expect("asked for");
        [pooled, read(&client, back.weight), read(&client, input)]
    };
    assert_eq!(run(), run());
}
