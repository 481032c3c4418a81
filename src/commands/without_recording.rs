//! `tactnet record` and `tactnet replay` in a build without the feature `recording`.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Args;
use tactnet_models::MissingFeature;

#[derive(Args)]
pub struct RecordArgs {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    _any: Vec<OsString>,
}

/// Arguments of `tactnet replay`.
pub type ReplayArgs = RecordArgs;

/// Returns the error that names the missing feature.
pub fn run(_: &RecordArgs) -> anyhow::Result<ExitCode> {
    anyhow::bail!(MissingFeature {
        feature: "recording"
    })
}
