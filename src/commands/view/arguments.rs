//! Arguments of `tactnet view` and `tactnet data view`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet view --table robot.toml                       what happens now, in a viewer of its own\n  \
    tactnet view today.mcap                               a recording\n  \
    tactnet view today.mcap --save today.rrd              for later: `rerun today.rrd`\n  \
    tactnet view --table robot.toml --connect rerun+http://127.0.0.1:9876/proxy\n\n\
    The viewer is a program of its own: pip install rerun-sdk==0.36.3. Whoever serves or records does not notice whether somebody looks on: \
    what the viewer is too slow for is left out.")]
pub struct ViewArgs {
    /// A recording of `tactnet record`
    #[arg(value_name = "FILE.mcap", required_unless_present = "table")]
    pub(super) file: Option<PathBuf>,
    /// The table of channels: look on live
    #[arg(long, value_name = "FILE", conflicts_with = "file")]
    pub(super) table: Option<PathBuf>,
    /// End after so many seconds [default: go on]
    #[arg(long, value_name = "S", requires = "table")]
    pub(super) seconds: Option<f64>,
    #[command(flatten)]
    pub(super) target: TargetArgs,
}

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet data view sweeps.h5                           the first three sweeps of every material\n  \
    tactnet data view twin --material felt --sweeps 20\n  \
    tactnet data view sweeps.h5 --save sweeps.rrd         for later: `rerun sweeps.rrd`")]
pub struct SweepsArgs {
    /// A data set (.h5, .npz), or `twin`
    #[arg(value_name = "FILE|twin")]
    pub(super) data: String,
    /// Only this material; may be given more than once
    #[arg(long, value_name = "NAME")]
    pub(super) material: Vec<String>,
    /// So many sweeps of each material
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(super) sweeps: usize,
    #[command(flatten)]
    pub(super) target: TargetArgs,
}

/// Where the pictures go.
#[derive(Args)]
pub struct TargetArgs {
    /// Write a file for the viewer instead
    #[arg(long, value_name = "FILE.rrd")]
    pub(super) save: Option<PathBuf>,
    /// Show it in a viewer that runs already
    #[arg(long, value_name = "URL", conflicts_with = "save")]
    pub(super) connect: Option<String>,
    /// Above this the viewer forgets the oldest
    #[arg(long, value_name = "SIZE", default_value = "2GB")]
    pub(super) memory_limit: String,
    /// Print one JSON document at the end
    #[arg(long)]
    pub(super) json: bool,
}
