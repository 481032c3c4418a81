//! Networks on a Vulkan device (a GPU, or mesa's lavapipe) against the processor.

use burn::optim::GradientsParams;
use burn::tensor::{Device, Int, Tensor, TensorData};
use tactnet_data::twin;
use tactnet_data::{Fold, Scheme, Seed};
use tactnet_models::{
    Architecture, Compute, InputShape, Network, NetworkConfig, Spectra, Trunk, Weights,
    cross_entropy, dropout_masks,
};
use tactnet_pipeline::{ClassifierConfig, ModelConfig, NetworkRecipe, NetworkSetup, Training};

fn logits_and_gradients(device: &Device, architecture: Architecture) -> (Vec<f32>, Weights) {
    let device = device.clone().autodiff();
    let input = InputShape {
        steps: 100,
        taxels: 4,
    };
    let config = NetworkConfig::new(architecture, input, 3).unwrap();
    let net = Network::init(&config, &device, &mut Seed(1).rng("initial weights"));
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
    let spectra = Spectra {
        bands: 6,
        taxel_units: 5,
        units: 7,
        ..Spectra::default()
    };
    let spectra = Architecture {
        trunk: Trunk::Spectra(spectra),
        hidden: 8,
        ..Architecture::default()
    };
    for architecture in [Architecture::tactnet2(&[4, 6], 8), spectra] {
        let of =
            |compute: Compute| logits_and_gradients(&compute.open().unwrap(), architecture.clone());
        let (expected, expected_gradients) = of(Compute::Cpu);
        let (found, gradients) = of(Compute::Vulkan);
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
}

/// Returns the mean loss of each epoch of ten steps, and the final weights. The network covers blocks with one and
/// several input maps, Adam and running statistics.
///
/// With `threads`, every step runs on a new thread.
fn trained(device: Compute, layers: &str, method: &str, threads: bool) -> (Vec<f64>, Weights) {
    let text = format!(
        "name = \"small\"\nnetwork = {{ {layers}, hidden = 8 }}\n\
         [training]\nepochs = 5\nbatch = 8\nlearning_rate = 0.01\nmethod = {method}\n"
    );
    let recipe = NetworkRecipe::parse("small", &text).unwrap();
    let twin = twin::small(3, 5, 60).unwrap();
    let fold = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0).unwrap();
    let setup = NetworkSetup::fit(&recipe, &fold.train);
    let model = ModelConfig::Network(setup.clone());
    let config = ClassifierConfig::new(model, &fold.train, Seed(1))
        .network_config(&setup)
        .unwrap();
    let device = device.open().unwrap();
    let normalizer = &setup.normalizer;
    let mut training =
        Training::start(&recipe, &fold.train, normalizer, &config, Seed(1), &device).unwrap();
    let mut losses = Vec::new();
    for _ in 0..10 {
        let report = if threads {
            std::thread::scope(|scope| scope.spawn(|| training.step()).join().unwrap())
        } else {
            training.step()
        };
        let report = report.unwrap().unwrap();
        if report.ends_epoch() {
            losses.push(report.mean_loss.unwrap());
        }
    }
    (losses, training.state().unwrap().weights)
}

#[test]
fn vulkan_trains_as_the_processor_does_and_always_the_same() {
    const MAPS: &str = "maps = [4, 6]";
    const SPECTRA: &str = "spectra = { bands = 6, taxel_units = 5, units = 7 }";
    for (layers, method, tolerance) in [
        (MAPS, "{ kind = \"base\" }", 1e-3),
        (SPECTRA, "{ kind = \"base\" }", 1e-3),
        // The sign of a gradient near zero may differ.
        (
            MAPS,
            "{ kind = \"adversarial\", alpha = 0.5, epsilon = 4.0 }",
            1e-2,
        ),
    ] {
        let (expected, _) = trained(Compute::Cpu, layers, method, false);
        let found = trained(Compute::Vulkan, layers, method, false);
        assert!(
            found == trained(Compute::Vulkan, layers, method, false),
            "to the bit"
        );
        let elsewhere = trained(Compute::Vulkan, layers, method, true);
        assert!(found == elsewhere, "to the bit, from other threads");
        for (a, b) in found.0.iter().zip(&expected) {
            assert!(
                (a - b).abs() < tolerance * b,
                "{method}: {:?} instead of {expected:?}",
                found.0
            );
        }
    }
}
