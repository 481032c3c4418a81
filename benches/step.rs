//! Time of whole training steps and predictions, by batch and sweep length: `cargo bench --bench step`.
//!
//! It covers everything from raw u8 values to Adam, on simulated sweeps.

use divan::Bencher;
use tactnet_data::twin::{TwinConfig, generate};
use tactnet_data::{Dataset, Fold, Scheme, Seed};
use tactnet_pipeline::{
    ClassifierConfig, Device, ModelConfig, NetworkRecipe, NetworkSetup, Training, TrainingMethod,
};

fn main() {
    divan::main();
}

fn twin(steps: usize) -> Dataset {
    generate(&TwinConfig {
        sweeps: 10,
        steps,
        ..TwinConfig::default()
    })
    .unwrap_or_else(|error| panic!("the twin has no size limit here: {error}"))
}

/// Times training steps with batches of `batch` sweeps of `steps` time steps.
fn train(bencher: Bencher, batch: usize, steps: usize, adversarial: bool) {
    let twin = twin(steps);
    let fold = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0)
        .unwrap_or_else(|error| panic!("ten sweeps make five folds: {error}"));
    let mut recipe = NetworkRecipe::load("thesis").unwrap_or_else(|error| panic!("{error}"));
    recipe.training.epochs = usize::MAX;
    recipe.training.batch = batch;
    if !adversarial {
        recipe.training.method = TrainingMethod::Base;
    }
    let setup = NetworkSetup::fit(&recipe, &fold.train);
    let config = ClassifierConfig::new(ModelConfig::Network(setup.clone()), &fold.train, Seed(1));
    let network = config
        .network_config(&setup)
        .unwrap_or_else(|error| panic!("{error}"));
    let device = Device::flex();
    let mut training = Training::start(
        &recipe,
        &fold.train,
        &setup.normalizer,
        &network,
        Seed(1),
        &device,
    )
    .unwrap_or_else(|error| panic!("{error}"));
    bencher.bench_local(|| {
        training
            .step()
            .map(|_| ())
            .unwrap_or_else(|error| panic!("{error}"))
    });
}

#[divan::bench(args = [false, true], sample_count = 20)]
fn step_of_36_sweeps(bencher: Bencher, adversarial: bool) {
    train(bencher, 36, 1000, adversarial);
}

#[divan::bench(args = [18, 36, 72, 144], sample_count = 10)]
fn step_by_sweeps(bencher: Bencher, batch: usize) {
    train(bencher, batch, 1000, false);
}

#[divan::bench(args = [500, 1000, 2000, 4000], sample_count = 10)]
fn step_of_36_sweeps_by_time_steps(bencher: Bencher, steps: usize) {
    train(bencher, 36, steps, false);
}
