//! `tactnet completions`: shell completions of commands and options.

use std::process::ExitCode;

use clap::{Args, CommandFactory};
use clap_complete::{Shell, generate};

use crate::{Cli, output};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet completions bash > ~/.local/share/bash-completion/completions/tactnet\n  \
    tactnet completions zsh > ~/.zfunc/_tactnet                     with ~/.zfunc in fpath\n  \
    tactnet completions fish > ~/.config/fish/completions/tactnet.fish")]
pub struct CompletionsArgs {
    /// Shell for which to print completions
    #[arg(value_enum)]
    shell: Shell,
}

/// Prints the completion script.
pub fn run(arguments: &CompletionsArgs) -> anyhow::Result<ExitCode> {
    let mut script = Vec::new();
    generate(arguments.shell, &mut Cli::command(), "tactnet", &mut script);
    output::print(String::from_utf8_lossy(&script).trim_end())?;
    Ok(ExitCode::SUCCESS)
}
