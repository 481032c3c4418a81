//! `tactnet data fetch` in a build without the feature `fetch`.

use std::process::ExitCode;

use clap::Args;
use tactnet_models::MissingFeature;

#[derive(Args)]
pub struct FetchArgs {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    _any: Vec<std::ffi::OsString>,
}

/// Returns the error that names the missing feature.
pub fn run(_: &FetchArgs) -> anyhow::Result<ExitCode> {
    anyhow::bail!(MissingFeature { feature: "fetch" })
}
