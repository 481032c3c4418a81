//! TactNet-II on a Vulkan device (a GPU, or mesa's lavapipe) against the processor.

use burn::optim::GradientsParams;
use burn::tensor::{Device, Int, Tensor, TensorData};
use tactnet_data::Seed;
use tactnet_models::{
    Architecture, Compute, InputShape, TactNet, TactNetConfig, Weights, cross_entropy,
    dropout_masks,
};

fn logits_and_gradients(device: &Device) -> (Vec<f32>, Weights) {
    let device = device.clone().autodiff();
    let input = InputShape {
        steps: 100,
        taxels: 4,
    };
    let architecture = Architecture {
        maps: vec![4, 6],
        hidden: 8,
        ..Architecture::default()
    };
    let config = TactNetConfig::new(architecture, input, 3).unwrap();
    let net = TactNet::init(&config, &device, &mut Seed(1).rng("initial weights"));
    let values: Vec<f32> = (0..6 * 400)
        .map(|i| ((i * 7919) % 101) as f32 / 50.0 - 1.0)
        .collect();
    let sweeps = Tensor::<4>::from_data(TensorData::new(values, [6, 1, 100, 4]), &device);
    let mask = dropout_masks(
        6,
        config.features(),
        0.8,
        &device,
        &mut Seed(1).rng("dropout"),
    );
    let labels = TensorData::new(vec![0_i32, 1, 2, 0, 1, 2], [6]);
    let labels = Tensor::<1, Int>::from_data(labels, &device);
    let logits = net.forward_train(sweeps, mask).logits;
    let mut gradients = cross_entropy(logits.clone(), labels).backward();
    let gradients = GradientsParams::from_module(&mut gradients, &net);
    let logits = logits.into_data_as::<f32>().try_into_vec().unwrap();
    (logits, net.gradients(&gradients))
}

#[test]
fn vulkan_gives_the_logits_and_gradients_of_the_processor() {
    let (expected, expected_gradients) = logits_and_gradients(&Compute::Cpu.open().unwrap());
    let (found, gradients) = logits_and_gradients(&Compute::Vulkan.open().unwrap());
    for (a, b) in found.iter().zip(&expected) {
        assert!((a - b).abs() < 1e-3, "logit {a} instead of {b}");
    }
    assert_eq!(gradients.0.len(), expected_gradients.0.len());
    for (name, gradient) in &gradients.0 {
        let expected = &expected_gradients.0[name].values;
        let scale = expected.iter().fold(1e-3_f32, |m, v| m.max(v.abs()));
        for (a, b) in gradient.values.iter().zip(expected) {
            assert!((a - b).abs() < 1e-3 * scale, "{name}: {a} instead of {b}");
        }
    }
}
