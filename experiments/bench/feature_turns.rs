//! Computes features of N sweeps for each line on standard input and answers with the milliseconds it took:
//! `compare_aeon.py` lets this process and aeon take turns.
//!
//!     feature_turns FILE
//!
//! Lines: `minirocket N`, `multirocket-hydra N`, `h N`. The N sweeps are spread evenly over the file. Random kernels are
//! fitted to the training side of fold 0 when they are first asked for, outside the time.

use std::collections::BTreeMap;
use std::io::{BufRead, Write};
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, bail, ensure};
use tactnet_data::{Fold, Scheme, Seed, SweepView, format};
use tactnet_pipeline::{FeatureSet, FeatureTimer};

fn main() -> anyhow::Result<()> {
    let path: PathBuf = std::env::args_os()
        .nth(1)
        .context("usage: feature_turns FILE")?
        .into();
    let dataset = format::read(&path)?;
    let fold = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0)?;
    let mut timers = BTreeMap::new();

    let mut answers = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let line = line.context("cannot read standard input")?;
        let (work, sweeps) = line.trim().split_once(' ').unwrap_or((&line, ""));
        let set = match work {
            "minirocket" => FeatureSet::MiniRocket,
            "multirocket-hydra" => FeatureSet::MultiRocketHydra,
            "h" => FeatureSet::H,
            other => bail!("unknown work `{other}`"),
        };
        let sweeps: usize = sweeps.parse().context("a number of sweeps")?;
        ensure!(
            (1..=dataset.len()).contains(&sweeps),
            "expected 1 to {} sweeps, found {sweeps}",
            dataset.len()
        );
        if !timers.contains_key(work) {
            let timer = FeatureTimer::fit(set, &fold.train, Seed(1))?;
            timers.insert(work.to_string(), timer);
        }
        let view = SweepView::new(
            &dataset,
            (0..sweeps).map(|i| i * dataset.len() / sweeps).collect(),
        );
        let begin = Instant::now();
        let features = timers[work].transform(&view);
        let milliseconds = begin.elapsed().as_secs_f64() * 1e3;
        ensure!(features.len() == sweeps, "a row for each sweep");
        writeln!(answers, "{milliseconds}")?;
        answers.flush()?;
    }
    Ok(())
}
