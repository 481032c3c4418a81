//! `tactnet catch` in a build without the feature `catching`.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Subcommand;
use tactnet_models::MissingFeature;

#[derive(Subcommand)]
pub enum CatchCommand {
    /// Any subcommand, whatever its arguments.
    #[command(external_subcommand)]
    Any(#[expect(dead_code, reason = "clap collects the arguments")] Vec<OsString>),
}

/// Returns the error that names the missing feature.
pub fn run(_: CatchCommand) -> anyhow::Result<ExitCode> {
    anyhow::bail!(MissingFeature {
        feature: "catching"
    })
}
