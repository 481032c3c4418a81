//! `tactnet view` and `tactnet data view`: channels, recordings and data sets in the Rerun viewer, which is a separate process.

mod arguments;
#[cfg(feature = "rerun")]
mod channels;
#[cfg(feature = "rerun")]
mod sweeps;

pub use arguments::{SweepsArgs, ViewArgs};

#[cfg(feature = "rerun")]
pub use {channels::run, sweeps::run as run_sweeps};

#[cfg(not(feature = "rerun"))]
mod left_out {
    use std::process::ExitCode;

    use tactnet_models::MissingFeature;

    use super::{SweepsArgs, ViewArgs};

    /// Returns the error that names the missing feature.
    pub fn run(_: &ViewArgs) -> anyhow::Result<ExitCode> {
        anyhow::bail!(MissingFeature { feature: "rerun" })
    }

    /// Returns the error that names the missing feature.
    pub fn run_sweeps(_: &SweepsArgs) -> anyhow::Result<ExitCode> {
        anyhow::bail!(MissingFeature { feature: "rerun" })
    }
}

#[cfg(not(feature = "rerun"))]
pub use left_out::{run, run_sweeps};
