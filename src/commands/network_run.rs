//! The run of a committee's network, for what committees cannot do.

use std::path::Path;

use tactnet_pipeline::{PipelineError, RunDir, quoted};

/// Use of a network in place of a committee.
#[derive(Debug, Clone, Copy)]
pub enum NetworkUse {
    /// Classification frame by frame.
    Serve,
    /// Export to ONNX.
    Export,
}

/// Opens the run directory `run`, or that of its network if it is a committee, and says so.
///
/// # Errors
/// A baseline, or a committee without a network.
pub fn network_run(run: &Path, using: NetworkUse) -> Result<RunDir, PipelineError> {
    let (reason, what) = match using {
        NetworkUse::Serve => ("a committee needs whole sweeps", "served"),
        NetworkUse::Export => (
            "not all members of this committee have an ONNX form",
            "exported",
        ),
    };
    let network = RunDir::open(run)?.network(&format!("be {what}"))?;
    if network.path() != run {
        let folder = quoted(&run.display().to_string());
        say!(
            "note: {reason}, so its network `{}` is {what}; `tactnet distill {folder}` makes one network of the committee",
            network.config()?.recipe.name()
        );
    }
    Ok(network)
}
