//! Networks against PyTorch: logits, loss, every gradient, ten adversarial training steps, full-size logits.
//!
//! The values come from `tests/golden/tactnet_torch.py`, which computes in float64. The tolerance of 1e-4 covers f32
//! arithmetic (measured 3e-6) and future kernels.

use std::collections::BTreeMap;
use std::path::Path;

use burn::module::Module;
use burn::optim::decay::WeightDecayConfig;
use burn::optim::{AdamConfig, GradientsParams};
use burn::tensor::{Device, Int, Tensor, TensorData};
use safetensors::SafeTensors;
use tactnet_models::{
    Architecture, Convolutions, InputShape, NamedTensor, Network, NetworkConfig, Trunk, Weights,
    cross_entropy,
};
use tactnet_pipeline::{AttackedLabel, Perturbation, adversarial_pass, base_pass};

struct Golden {
    tensors: BTreeMap<String, NamedTensor>,
    metadata: BTreeMap<String, String>,
}

impl Golden {
    fn read(name: &str) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("tests/golden")
            .join(name);
        let bytes = std::fs::read(path).unwrap();
        let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
        let metadata = header.metadata().clone().unwrap().into_iter().collect();
        Self {
            tensors: Weights::from_safetensors(&bytes).unwrap().0,
            metadata,
        }
    }

    fn setting<T: serde::de::DeserializeOwned>(&self, name: &str) -> T {
        serde_json::from_str(&self.metadata[name]).unwrap()
    }

    fn tensor<const D: usize>(&self, name: &str, device: &Device) -> Tensor<D> {
        let tensor = &self.tensors[name];
        let shape: [usize; D] = tensor.shape.clone().try_into().unwrap();
        Tensor::from_data(TensorData::new(tensor.values.clone(), shape), device)
    }

    fn weights(&self, prefix: &str) -> Weights {
        let named = self.tensors.iter().filter_map(|(name, tensor)| {
            Some((name.strip_prefix(prefix)?.to_string(), tensor.clone()))
        });
        Weights(named.collect())
    }

    fn config(&self) -> NetworkConfig {
        let [_, _, steps, taxels]: [usize; 4] =
            self.tensors["sweeps"].shape.clone().try_into().unwrap();
        let trunk = if self.metadata.contains_key("spectra") {
            Trunk::Spectra(self.setting("spectra"))
        } else {
            Trunk::Convolutions(Convolutions {
                maps: self.setting("maps"),
                kernel: self.setting("kernel"),
                pools: Some(self.setting("pools")),
            })
        };
        let architecture = Architecture {
            trunk,
            hidden: self.setting("hidden"),
            keep_probability: 0.8,
        };
        let materials = self.setting("materials");
        NetworkConfig::new(architecture, InputShape { steps, taxels }, materials).unwrap()
    }
}

/// Returns the largest deviation relative to the largest expected magnitude.
fn deviation(found: &[f32], expected: &[f32]) -> f32 {
    assert_eq!(found.len(), expected.len());
    let scale = expected
        .iter()
        .fold(0.0_f32, |m, v| m.max(v.abs()))
        .max(1e-12);
    found
        .iter()
        .zip(expected)
        .fold(0.0_f32, |m, (f, e)| m.max((f - e).abs()))
        / scale
}

fn assert_close<const D: usize>(found: Tensor<D>, golden: &Golden, name: &str, tolerance: f32) {
    let values: Vec<f32> = found.into_data_as::<f32>().try_into_vec().unwrap();
    let off = deviation(&values, &golden.tensors[name].values);
    assert!(
        off < tolerance,
        "{name} is off by {off:e} of its largest value"
    );
}

fn assert_weights_close(found: &Weights, golden: &Golden, prefix: &str, tolerance: f32) {
    assert!(!found.0.is_empty());
    for (name, tensor) in &found.0 {
        let expected = &golden.tensors[&format!("{prefix}{name}")];
        assert_eq!(tensor.shape, expected.shape, "{name}");
        let off = deviation(&tensor.values, &expected.values);
        assert!(
            off < tolerance,
            "{prefix}{name} is off by {off:e} of its largest value"
        );
    }
}

fn labels(golden: &Golden, device: &Device) -> Tensor<1, Int> {
    let labels: Vec<i64> = golden.tensors["labels"]
        .values
        .iter()
        .map(|v| *v as i64)
        .collect();
    let extent = [labels.len()];
    Tensor::from_data(TensorData::new(labels, extent), device)
}

/// Trains for ten steps with Adam and compares every loss, and the gradients of the first step.
fn ten_adversarial_steps(mut net: Network, golden: &Golden, device: &Device) -> Network {
    let sweeps = golden.tensor::<4>("sweeps", &Device::flex());
    let mut adam = AdamConfig::new()
        .with_epsilon(1e-8)
        .with_weight_decay(Some(WeightDecayConfig::new(1e-3)))
        .init();
    let perturbation = Perturbation {
        alpha: 0.3,
        epsilon: vec![0.1; sweeps.dims()[3]],
        attack: AttackedLabel::True,
    };
    for step in 0..10 {
        let masks = ["clean", "adversarial"]
            .map(|kind| golden.tensor::<2>(&format!("mask.{step}.{kind}"), device));
        let pass = adversarial_pass(
            &net,
            sweeps.clone(),
            labels(golden, device),
            masks,
            &perturbation,
        );
        let [clean, adversarial] = [0, 1].map(|i| golden.tensors["losses"].values[2 * step + i]);
        let expected = f64::from(0.3 * clean + 0.7 * adversarial);
        let loss = pass.measured.read().loss;
        let off = (loss - expected).abs() / expected;
        assert!(
            off < 1e-3,
            "loss of step {step}: {loss} instead of {expected}"
        );
        if step == 0 {
            let combined = net.gradients(&pass.gradients);
            assert_weights_close(&combined, golden, "combined.gradient.", 1e-4);
        }
        net = adam.step(1e-3, net, pass.gradients);
        net.update_running_stats(&pass.statistics);
    }
    net
}

fn check_against_pytorch(name: &str) {
    let golden = Golden::read(name);
    let config = golden.config();
    let plain = Device::flex();
    let device = plain.clone().autodiff();
    let net = Network::from_weights(&config, &golden.weights("initial."), &device).unwrap();

    let sweeps = golden.tensor::<4>("sweeps", &plain);
    let valid = net.valid();
    assert_close(
        valid.head(valid.features(sweeps.clone())),
        &golden,
        "eval.logits",
        1e-4,
    );

    let tracked = sweeps.clone().autodiff().require_grad();
    let mask = golden.tensor::<2>("mask.0.clean", &device);
    let forward = net.forward_train(tracked.clone(), mask.clone());
    assert_close(forward.logits.clone(), &golden, "clean.logits", 1e-4);
    let loss = cross_entropy(forward.logits, labels(&golden, &device));
    let mut gradients = loss.backward();
    let input_gradient = tracked.grad(&gradients).unwrap();
    assert_close(input_gradient, &golden, "clean.gradient.sweeps", 1e-4);
    let gradients = GradientsParams::from_module(&mut gradients, &net);
    let named = net.gradients(&gradients);
    assert_eq!(
        named.0.len(),
        golden.weights("clean.gradient.").0.len() - 1,
        "every parameter has a gradient, besides the sweeps"
    );
    assert_weights_close(&named, &golden, "clean.gradient.", 1e-4);

    let net = ten_adversarial_steps(net, &golden, &device);
    assert_weights_close(&net.weights(), &golden, "final.", 2e-3);
    let valid = net.valid();
    assert_close(
        valid.head(valid.features(sweeps)),
        &golden,
        "final.eval.logits",
        2e-3,
    );
}

#[test]
fn reduced_network_matches_pytorch_through_ten_adversarial_steps() {
    check_against_pytorch("tactnet_reduced.safetensors");
}

#[test]
fn network_with_uneven_pools_matches_pytorch() {
    check_against_pytorch("tactnet_uneven.safetensors");
}

#[test]
fn network_on_spectra_matches_pytorch() {
    check_against_pytorch("spectra.safetensors");
}

#[test]
fn base_objective_is_the_clean_half_of_the_adversarial_one() {
    let golden = Golden::read("tactnet_reduced.safetensors");
    let plain = Device::flex();
    let device = plain.clone().autodiff();
    let net =
        Network::from_weights(&golden.config(), &golden.weights("initial."), &device).unwrap();
    let mask = golden.tensor::<2>("mask.0.clean", &device);
    let pass = base_pass(
        &net,
        golden.tensor::<4>("sweeps", &plain),
        labels(&golden, &device),
        mask,
    );
    let expected = f64::from(golden.tensors["losses"].values[0]);
    assert_weights_close(
        &net.gradients(&pass.gradients),
        &golden,
        "clean.gradient.",
        1e-4,
    );
    let loss = pass.measured.read().loss;
    assert!((loss - expected).abs() < 1e-5 * expected);
}

/// `counter_uniform` of the generator script: splitmix64 of a counter, top 24 bits, mapped to [-1, 1).
fn counter_uniform(stream: u64, count: usize) -> impl Iterator<Item = f64> {
    (0..count as u64).map(move |i| {
        const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;
        let mut z = ((stream << 32) + i)
            .wrapping_mul(GOLDEN)
            .wrapping_add(GOLDEN);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f64 / f64::from(1 << 24) * 2.0 - 1.0
    })
}

#[test]
fn full_size_logits_match_pytorch() {
    let golden = Golden::read("tactnet_full.safetensors");
    let device = Device::flex();
    let input = InputShape {
        steps: 1000,
        taxels: 16,
    };
    let config = NetworkConfig::new(Architecture::default(), input, 36).unwrap();
    let mut rng = tactnet_data::Seed(0).rng("overwritten below");
    let mut weights = Network::init(&config, &device, &mut rng).weights();
    for (stream, (name, tensor)) in weights.0.iter_mut().enumerate() {
        let fan_in: usize = match name.as_str() {
            "output.bias" => 512,
            _ if name.ends_with("weight") => tensor.shape[1..].iter().product(),
            _ => 0,
        };
        for (value, u) in tensor
            .values
            .iter_mut()
            .zip(counter_uniform(stream as u64, usize::MAX))
        {
            *value = if fan_in > 0 {
                u / (fan_in as f64).sqrt()
            } else if name.ends_with("gamma") {
                1.0 + 0.1 * u
            } else if name.ends_with("variance") {
                1.5 + 0.5 * u
            } else {
                0.1 * u
            } as f32;
        }
    }
    let net = Network::from_weights(&config, &weights, &device).unwrap();
    let digits: Vec<f32> = counter_uniform(1000, 2 * 16_000)
        .map(|u| ((u + 1.0) * 20.0).floor() as f32)
        .collect();
    let sweeps = Tensor::from_data(TensorData::new(digits, [2, 1, 1000, 16]), &device);
    assert_close(net.head(net.features(sweeps)), &golden, "logits", 1e-4);
}
