//! Times one piece of work for each line on standard input, in milliseconds: `compare_torch.py` lets this process and
//! PyTorch take turns.
//!
//! Work: `train_step`, `adversarial_step` (one batch of 36 through loading, forward, backward and Adam), `forward`,
//! `single_forward` (36 sweeps or one, digits to probabilities), `mc_forward` (one sweep, Monte Carlo dropout with M = 100).

use std::io::{BufRead, Write};
use std::time::Instant;

use anyhow::{Context, bail};
use tactnet_data::twin::{TwinConfig, generate};
use tactnet_data::{Fold, Scheme, Seed, SweepView};
use tactnet_pipeline::{
    Classifier, ClassifierConfig, Device, ModelConfig, PredictionMethod, Recipe, TactNetSetup,
    Training, TrainingMethod,
};

fn main() -> anyhow::Result<()> {
    let twin = generate(&TwinConfig {
        sweeps: 5,
        ..TwinConfig::default()
    })?;
    let device = Device::flex();
    let split = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0)?.train;
    let mut recipe = Recipe::load("thesis")?;
    recipe.training.epochs = usize::MAX;
    let mut plain = recipe.clone();
    plain.training.method = TrainingMethod::Base;
    let setup = TactNetSetup::fit(&recipe, &split);
    let config = ClassifierConfig::new(ModelConfig::TactNet2(setup.clone()), &split, Seed(1));
    let network = config.network_config(&setup)?;
    let start = |recipe| {
        Training::start(
            recipe,
            &split,
            &setup.normalizer,
            &network,
            Seed(1),
            &device,
        )
    };
    let (mut base, mut adversarial) = (start(&plain)?, start(&recipe)?);
    let classifier = Classifier::new(config, &base.state()?.weights, &device)?;
    let batch = SweepView::new(&twin, (0..36).collect());
    let sweep = SweepView::new(&twin, vec![0]);
    let monte_carlo = PredictionMethod::McDropout { mc_samples: 100 };

    let mut answers = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let work = line.context("cannot read standard input")?;
        let begin = Instant::now();
        match work.trim() {
            "train_step" => {
                base.step()?;
            }
            "adversarial_step" => {
                adversarial.step()?;
            }
            "forward" => drop(classifier.predict(&batch, PredictionMethod::Plain)?),
            "single_forward" => drop(classifier.predict(&sweep, PredictionMethod::Plain)?),
            "mc_forward" => drop(classifier.predict(&sweep, monte_carlo)?),
            other => bail!("unknown work `{other}`"),
        }
        writeln!(answers, "{}", begin.elapsed().as_secs_f64() * 1e3)?;
        answers.flush()?;
    }
    Ok(())
}
