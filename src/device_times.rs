//! Training times on the devices of this machine.

use std::time::Instant;

use anyhow::Context;
use tactnet_data::twin::{TwinConfig, generate};
use tactnet_data::{Dataset, Fold, Scheme, Seed};
use tactnet_models::Compute;
use tactnet_pipeline::{ClassifierConfig, ModelConfig, ModelRecipe, NetworkSetup, Training};
#[cfg(any(feature = "vulkan", feature = "cuda"))]
use tactnet_pipeline::{StackMember, StackedTraining};

/// Number of steps before the timed ones, in which a GPU compiles its kernels.
const WARM_UP: usize = 3;
/// Number of steps by which devices are compared.
const COMPARED: usize = 5;

/// Training times, in ms.
pub struct Times {
    /// Number of sweeps in a batch.
    pub batch: usize,
    /// Time of a step: the median on the processor, the mean on a GPU, which runs steps asynchronously.
    pub step: f64,
    /// Time of all timed steps together.
    pub all: f64,
}

/// Times an epoch of training, or `limit` steps of it.
///
/// # Errors
/// Fails if the device does not open.
pub fn time(
    fold: &Fold<'_>,
    recipe: &str,
    device: Compute,
    limit: Option<usize>,
) -> anyhow::Result<Times> {
    let ModelRecipe::Network(recipe) = ModelRecipe::load(recipe)? else {
        anyhow::bail!("{recipe} is no recipe of a network");
    };
    let setup = NetworkSetup::fit(&recipe, &fold.train);
    let model = ModelConfig::Network(setup.clone());
    let config = ClassifierConfig::new(model, &fold.train, Seed(1)).network_config(&setup)?;
    let (compute, device) = (device, device.open()?);
    let start = || {
        Training::start(
            &recipe,
            &fold.train,
            &setup.normalizer,
            &config,
            Seed(1),
            &device,
        )
    };
    let mut warm_up = start()?;
    for _ in 0..WARM_UP {
        warm_up.step()?;
    }
    warm_up.wait()?;
    let mut training = start()?;
    let steps = limit.unwrap_or_else(|| training.batches());
    let begin = Instant::now();
    let mut times = Vec::new();
    for _ in 0..steps {
        let step = Instant::now();
        training
            .step()?
            .context("recipes have at least one epoch")?;
        times.push(step.elapsed().as_secs_f64() * 1e3);
    }
    training.wait()?;
    let all = begin.elapsed().as_secs_f64() * 1e3;
    times.sort_by(f64::total_cmp);
    Ok(Times {
        batch: recipe.training.batch,
        step: match compute {
            Compute::Cpu => times[times.len() / 2],
            Compute::Vulkan | Compute::Cuda => all / steps as f64,
        },
        all,
    })
}

/// Times `steps` steps of `networks` networks that train together on folds of `dataset`. Returns ms per step and
/// network, or `None` on devices that train one network at a time.
///
/// Fails if the device does not open.
/// A device that does not open.
#[cfg(any(feature = "vulkan", feature = "cuda"))]
pub fn time_stack(
    dataset: &Dataset,
    recipe: &str,
    device: Compute,
    (networks, steps): (usize, usize),
) -> anyhow::Result<Option<f64>> {
    if device == Compute::Cpu {
        return Ok(None);
    }
    let ModelRecipe::Network(recipe) = ModelRecipe::load(recipe)? else {
        anyhow::bail!("{recipe} is no recipe of a network");
    };
    let scheme = Scheme::default();
    let folds = scheme.folds(dataset)?;
    let fold = |network: usize| {
        let repeat = network / folds % scheme.repeats();
        Fold::new(dataset, scheme, Seed(1), repeat, network % folds)
    };
    let all = (0..networks)
        .map(fold)
        .collect::<Result<Vec<Fold<'_>>, _>>()?;
    let mut fitted = Vec::with_capacity(networks);
    for fold in &all {
        let setup = NetworkSetup::fit(&recipe, &fold.train);
        let model = ModelConfig::Network(setup.clone());
        let config = ClassifierConfig::new(model, &fold.train, Seed(1)).network_config(&setup)?;
        fitted.push((setup, config));
    }
    let members = all.iter().zip(&fitted).enumerate();
    let members = members.map(|(network, (fold, (setup, config)))| StackMember {
        recipe: &recipe,
        train: &fold.train,
        normalizer: &setup.normalizer,
        config,
        seed: Seed(network as u64),
    });
    let members: Vec<StackMember<'_>> = members.collect();
    let states = members.iter().map(|_| None).collect();
    let mut training = StackedTraining::start(members, states, &device.open()?)?;
    let mut take = |steps: usize| -> anyhow::Result<()> {
        for _ in 0..steps {
            for report in training.step() {
                report.transpose()?;
            }
        }
        match training.wait().into_iter().next() {
            Some((_, error)) => Err(error.into()),
            None => Ok(()),
        }
    };
    take(WARM_UP)?;
    let begin = Instant::now();
    take(steps)?;
    let all = begin.elapsed().as_secs_f64() * 1e3;
    Ok(Some(all / (steps * networks) as f64))
}

/// Returns `None`: without a GPU, networks are trained one at a time.
#[cfg(not(any(feature = "vulkan", feature = "cuda")))]
pub fn time_stack(
    _dataset: &Dataset,
    _recipe: &str,
    _device: Compute,
    _networks_and_steps: (usize, usize),
) -> anyhow::Result<Option<f64>> {
    Ok(None)
}

/// Returns the device that trains the published network fastest, and prints the comparison.
///
/// # Errors
/// Fails if a device does not open.
pub fn fastest() -> anyhow::Result<Compute> {
    let present = Compute::present();
    if present.len() == 1 {
        let reason = if cfg!(any(feature = "vulkan", feature = "cuda")) {
            "no GPU with a driver was found"
        } else {
            "this build has no GPU support (feature `vulkan`)"
        };
        say!("device: the processor; {reason}");
        return Ok(Compute::Cpu);
    }
    let twin = generate(&TwinConfig {
        sweeps: 5,
        ..TwinConfig::default()
    })?;
    let fold = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0)?;
    let mut found = Vec::new();
    for (device, name) in present {
        let step = time(&fold, "fast", device, Some(COMPARED))?.step;
        found.push((device, name, step));
    }
    found.sort_by(|a, b| a.2.total_cmp(&b.2));
    let times: Vec<String> = found
        .iter()
        .map(|(_, name, step)| format!("{name} {step:.1} ms"))
        .collect();
    say!(
        "device: {}; time per training step of the published network: {}",
        found[0].1,
        times.join(", ")
    );
    Ok(found[0].0)
}
