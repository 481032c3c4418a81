//! Simulated skin of the hand that sweeps over caught balls: a process of `tactnet catch run --feel`.

use std::path::PathBuf;

use anyhow::Context;
use serde::{Deserialize, Serialize};
use tactnet_channel::Bus;
use tactnet_data::DataSource;
use tactnet_data::twin::{self, TwinConfig};
use tactnet_pipeline::{LabelOrder, RunDir};
use tactnet_simulation::{HeldSkin, SMALL_SWEEPS};
use tactnet_skin::ServeConfig;

use crate::commands::simulate::{check_fit, unseen_by};
use crate::source;

/// Settings of the skin, a line of JSON on its standard input.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkinSettings {
    /// Run directory of the network; sweeps of its training data are excluded.
    pub run: PathBuf,
    /// Data set of the sweeps: a file, or `twin`.
    pub data: String,
    /// Possible materials of the balls.
    pub materials: Vec<String>,
    /// Seed of the world, which determines the material of each ball.
    pub seed: u64,
}

/// Plays sweeps of the held material until `stopped` returns true.
pub fn run(
    settings: &SkinSettings,
    bus: &Bus,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> anyhow::Result<()> {
    let config = RunDir::open(&settings.run)?.config()?;
    let dataset = match DataSource::named(&settings.data) {
        DataSource::Twin(version) => twin::generate(&TwinConfig {
            version,
            sweeps: SMALL_SWEEPS,
            ..TwinConfig::default()
        })?,
        DataSource::File(_) => source::load_as(&config.spec, &settings.data, LabelOrder::True)?,
    };
    check_fit(&dataset, &settings.data, &config.classifier)?;
    let sweeps = unseen_by(&dataset, &settings.run)?;
    let skip = ServeConfig::of(bus.table())?.segmenter.skip;
    let lead = skip.frames(dataset.sample_rate_hz());
    let mut skin = HeldSkin::new(&dataset, &sweeps, &settings.materials, lead)
        .with_context(|| settings.data.clone())?;
    Ok(skin.run(bus, settings.seed, ready, stopped)?)
}
