//! The run directory of a command.

use std::path::{Path, PathBuf};

use clap::Args;

/// A run directory as a positional argument. `--run` is a hidden alias, for consistency with other commands.
#[derive(Args)]
#[group(id = "run_directory", required = true, multiple = false)]
pub struct RunChoice {
    /// Run directory
    #[arg(value_name = "DIR")]
    dir: Option<PathBuf>,
    #[arg(long = "run", value_name = "DIR", hide = true)]
    named: Option<PathBuf>,
}

impl RunChoice {
    /// Returns the run directory.
    pub fn dir(&self) -> &Path {
        let chosen = self.dir.as_deref().or(self.named.as_deref());
        chosen.unwrap_or_else(|| panic!("clap requires one of the two"))
    }
}
