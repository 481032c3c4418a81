//! `tactnet version`: version, commit and features of the build.

use std::process::ExitCode;
use std::sync::LazyLock;

use clap::Args;
use serde::Serialize;

use crate::GIT;
use crate::output::{self, OutputFormat};

/// Optional cargo features, each with true if this build includes it.
const FEATURES: [(&str, bool); 10] = [
    ("catching", cfg!(feature = "catching")),
    ("recording", cfg!(feature = "recording")),
    ("fetch", cfg!(feature = "fetch")),
    ("vulkan", cfg!(feature = "vulkan")),
    ("cuda", cfg!(feature = "cuda")),
    ("zenoh", cfg!(feature = "zenoh")),
    ("onnxruntime", cfg!(feature = "onnxruntime")),
    ("candle", cfg!(feature = "candle")),
    ("rerun", cfg!(feature = "rerun")),
    ("parquet", cfg!(feature = "parquet")),
];

static TEXT: LazyLock<String> = LazyLock::new(|| Version::of_this_build().to_string());

/// Returns the output of `tactnet --version` without the program's name.
pub fn text() -> &'static str {
    &TEXT
}

/// Returns version and commit.
pub fn name() -> &'static str {
    text().lines().next().unwrap_or_default()
}

/// Returns the optional cargo features of this build.
pub fn features() -> Vec<&'static str> {
    Version::of_this_build().features
}

#[derive(Args)]
#[command(after_help = "Examples:\n  tactnet version\n  tactnet version --json")]
pub struct VersionArgs {
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Document of `--json`.
#[derive(Serialize)]
struct Version {
    schema_version: u32,
    version: &'static str,
    git: &'static str,
    /// Optional features of this build.
    features: Vec<&'static str>,
    /// Optional features that this build does not include.
    left_out: Vec<&'static str>,
}

impl Version {
    fn of_this_build() -> Self {
        let names = |built: bool| {
            let found = FEATURES.iter().filter(|(_, has)| *has == built);
            found.map(|(name, _)| *name).collect()
        };
        Self {
            schema_version: 1,
            version: env!("CARGO_PKG_VERSION"),
            git: GIT,
            features: names(true),
            left_out: names(false),
        }
    }
}

impl std::fmt::Display for Version {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let list = |names: &[&str]| match names {
            [] => "none".to_string(),
            names => names.join(", "),
        };
        writeln!(f, "{} (commit {})", self.version, self.git)?;
        writeln!(f, "optional features: {}", list(&self.features))?;
        write!(f, "left out: {}", list(&self.left_out))?;
        if let [first, ..] = self.left_out[..] {
            write!(
                f,
                " (to add one, run `cargo install --path . --features {first}` in a checkout of the source)"
            )?;
        }
        Ok(())
    }
}

/// Prints the version.
pub fn run(arguments: &VersionArgs) -> anyhow::Result<ExitCode> {
    match OutputFormat::from_flag(arguments.json) {
        OutputFormat::Json => output::print_json(&Version::of_this_build())?,
        OutputFormat::Table => output::print(format_args!("tactnet {}", text()))?,
    }
    Ok(ExitCode::SUCCESS)
}
