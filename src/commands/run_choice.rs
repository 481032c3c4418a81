//! Which run directory a command takes.

use std::path::{Path, PathBuf};

use clap::Args;

/// A run directory, named as an argument; `--run` means the same, as with commands that can do without a run.
#[derive(Args)]
#[group(id = "run_directory", required = true, multiple = false)]
pub struct RunChoice {
    /// A run directory
    #[arg(value_name = "DIR")]
    dir: Option<PathBuf>,
    #[arg(long = "run", value_name = "DIR", hide = true)]
    named: Option<PathBuf>,
}

impl RunChoice {
    /// Returns the run directory.
    pub fn dir(&self) -> &Path {
        let chosen = self.dir.as_deref().or(self.named.as_deref());
        chosen.unwrap_or_else(|| panic!("a call names one of the two, or is refused"))
    }
}
