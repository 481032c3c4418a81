//! `tactnet man`: manual pages.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::{Args, CommandFactory};
use clap_mangen::{Man, generate_to};

use super::reference;
use crate::{Cli, output};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet man | man -l -                                  show the page of `tactnet`\n  \
    tactnet man --out ~/.local/share/man/man1               write a page per command: `man tactnet-train`")]
pub struct ManArgs {
    /// Folder in which to write a page per command [default: print the page of `tactnet`]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print a reference of all commands as Markdown
    #[arg(long, conflicts_with = "out")]
    markdown: bool,
}

/// Prints or writes the pages.
pub fn run(arguments: &ManArgs) -> anyhow::Result<ExitCode> {
    // A manual does not name the commit and the features of a build.
    let command = Cli::command().version(env!("CARGO_PKG_VERSION"));
    if arguments.markdown {
        output::print(reference::markdown(&command).trim_end())?;
        return Ok(ExitCode::SUCCESS);
    }
    let Some(folder) = &arguments.out else {
        let mut page = Vec::new();
        Man::new(command).render(&mut page)?;
        output::print(String::from_utf8_lossy(&page).trim_end())?;
        return Ok(ExitCode::SUCCESS);
    };
    let refused = || format!("{}: cannot write manual pages", folder.display());
    std::fs::create_dir_all(folder).with_context(refused)?;
    generate_to(command, folder).with_context(refused)?;
    say!("{}: manual pages of section 1", folder.display());
    Ok(ExitCode::SUCCESS)
}
