//! Times one piece of work for each line on standard input, in milliseconds, so that `compare_torch.py` can alternate
//! between this process and PyTorch.
//!
//! `turns [ROWSxCOLSxSTEPS [BATCH [ISA]]]`, by default `4x4x1000 36`: shape of the sweeps, batch size, and the largest
//! instruction set for convolutions (`portable`, `avx2`, `avx512`).
//!
//! Work: `train_step`, `adversarial_step` (one batch through loading, forward, backward and Adam), `forward`,
//! `single_forward` (a batch of sweeps or one, digits to probabilities), `mc_forward` (one sweep, Monte Carlo dropout
//! with M = 100).

use std::io::{BufRead, Write};
use std::time::Instant;

use anyhow::{Context, bail};
use tactnet_data::{
    Dataset, Fold, LabelSet, Samples, Scheme, Seed, SweepRecord, SweepShape, SweepView,
};
use tactnet_models::Isa;
use tactnet_pipeline::{
    Classifier, ClassifierConfig, Device, ModelConfig, NetworkRecipe, NetworkSetup,
    PredictionMethod, Training, TrainingMethod,
};

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let shape = arguments.next().unwrap_or_else(|| "4x4x1000".into());
    let batch: usize = arguments.next().map_or(Ok(36), |text| text.parse())?;
    if let Some(name) = arguments.next() {
        let all = Isa::all();
        let named = |isa: &&Isa| format!("{isa:?}").eq_ignore_ascii_case(&name);
        let found = all.iter().find(named);
        found
            .with_context(|| format!("expected one of {all:?}, found `{name}`"))?
            .limit();
    }
    let dataset = digits(&shape)?;
    let device = Device::flex();
    let split = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0)?.train;
    let mut recipe = NetworkRecipe::load("thesis")?;
    recipe.training.epochs = usize::MAX;
    recipe.training.batch = batch;
    let mut plain = recipe.clone();
    plain.training.method = TrainingMethod::Base;
    let setup = NetworkSetup::fit(&recipe, &split);
    let config = ClassifierConfig::new(ModelConfig::Network(setup.clone()), &split, Seed(1));
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
    let batch = SweepView::new(&dataset, (0..batch).collect());
    let sweep = SweepView::new(&dataset, vec![0]);
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

/// Returns scattered digits, 0 to 39, of 36 materials; the time of a step does not depend on the values.
fn digits(shape: &str) -> anyhow::Result<Dataset> {
    let sizes: Vec<usize> = shape
        .split('x')
        .map(str::parse)
        .collect::<Result<_, _>>()
        .with_context(|| format!("expected ROWSxCOLSxSTEPS, found `{shape}`"))?;
    let [rows, cols, steps] = sizes[..] else {
        bail!("expected ROWSxCOLSxSTEPS, found `{shape}`");
    };
    let shape = SweepShape { steps, rows, cols };
    let records: Vec<SweepRecord> = (0..36 * 5)
        .map(|index| SweepRecord::new(index % 36, index / 36))
        .collect();
    let scattered = |index: u64| index.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
    let count = (records.len() * steps * shape.taxels()) as u64;
    let values = (0..count).map(|index| (scattered(index) % 40) as u8);
    let labels = LabelSet::new((0..36).map(|label| format!("material {label}")))?;
    let samples = Samples::U8(values.collect());
    Ok(Dataset::new(
        "digits", 750.0, shape, labels, records, samples,
    )?)
}
