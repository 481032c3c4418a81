//! The run whose network is served.

use std::path::Path;

use tactnet_pipeline::{RunDir, quoted};

/// Opens the run directory `run`, or that of its network if it is a committee, and says so.
pub fn served_run(run: &Path) -> anyhow::Result<RunDir> {
    let network = RunDir::open(run)?.network("be served")?;
    if network.path() != run {
        let folder = quoted(&run.display().to_string());
        say!(
            "note: a committee needs whole sweeps, so its network `{}` is served; `tactnet distill {folder}` makes a network that is closer to the committee",
            network.config()?.recipe.name()
        );
    }
    Ok(network)
}
