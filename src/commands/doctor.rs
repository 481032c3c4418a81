//! `tactnet doctor`: what this machine has and lacks.

use std::process::ExitCode;

use clap::Args;
use tactnet_serving::doctor::{Diagnosis, Status};

use super::version;
use crate::failure;
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(
    after_help = "Examples:\n  tactnet doctor\n  tactnet doctor --json\n\n\
    Nothing is changed. Exit code 1 if something does not work, 0 otherwise, also with warnings."
)]
pub struct DoctorArgs {
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &DoctorArgs) -> anyhow::Result<ExitCode> {
    let found = Diagnosis::of_this_machine(version::name(), &version::features());
    let code = if found.worst() == Status::Failure {
        ExitCode::from(failure::FAILED)
    } else {
        ExitCode::SUCCESS
    };
    match OutputFormat::from_flag(arguments.json) {
        OutputFormat::Json => output::print_json(&found)?,
        OutputFormat::Table => output::print(found)?,
    }
    Ok(code)
}
