//! Trains networks for some steps, to count kernel launches in CubeCL's log: subtract the lines of a shorter run.
//!
//! ```sh
//! export CUBECL_DEBUG_LOG=/tmp/log CUBECL_DEBUG_OPTION=profile
//! cargo run -p tactnet-pipeline --features vulkan --example launches -- base 0 6         # one network alone
//! cargo run -p tactnet-pipeline --features vulkan --example launches -- adversarial 4 6  # four networks at once
//! ```
//!
//! Arguments: method, number of networks at once (0: alone), number of steps.

use tactnet_data::twin;
use tactnet_data::{Fold, Scheme, Seed};
use tactnet_models::Compute;
use tactnet_pipeline::{
    ClassifierConfig, ModelConfig, NetworkRecipe, NetworkSetup, StackMember, StackedTraining,
    Training,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [method, networks, steps] = &arguments[..] else {
        return Err("expected METHOD NETWORKS STEPS".into());
    };
    let (networks, steps): (usize, usize) = (networks.parse()?, steps.parse()?);
    let method = match method.as_str() {
        "base" => "{ kind = \"base\" }",
        _ => "{ kind = \"adversarial\", alpha = 0.5, epsilon = 4.0 }",
    };
    // Three blocks as in the thesis's network, with fewer maps.
    let recipe = NetworkRecipe::parse(
        "small",
        &format!(
            "name = \"small\"\nnetwork = {{ maps = [4, 6, 8], hidden = 8 }}\n\
             [training]\nepochs = 100\nbatch = 8\nlearning_rate = 0.01\nmethod = {method}\n"
        ),
    )?;
    let twin = twin::small(3, 10, 100)?;
    let fold = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0)?;
    let setup = NetworkSetup::fit(&recipe, &fold.train);
    let model = ModelConfig::Network(setup.clone());
    let config = ClassifierConfig::new(model, &fold.train, Seed(1)).network_config(&setup)?;
    let device = Compute::Vulkan.open()?;
    if networks == 0 {
        let normalizer = &setup.normalizer;
        let seed = Seed(1);
        let mut training =
            Training::start(&recipe, &fold.train, normalizer, &config, seed, &device)?;
        for _ in 0..steps {
            training.step()?;
        }
        return Ok(training.wait()?);
    }
    let member = |network: usize| StackMember {
        recipe: &recipe,
        train: &fold.train,
        normalizer: &setup.normalizer,
        config: &config,
        seed: Seed(network as u64),
    };
    let members = (0..networks).map(member).collect();
    let states = (0..networks).map(|_| None).collect();
    let mut training = StackedTraining::start(members, states, &device)?;
    for _ in 0..steps {
        for report in training.step() {
            report.transpose()?;
        }
    }
    match training.wait().into_iter().next() {
        Some((_, error)) => Err(error.into()),
        None => Ok(()),
    }
}
