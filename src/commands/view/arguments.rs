//! Arguments of `tactnet view` and `tactnet data view`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet view --table robot.toml                       live channels, in a new viewer\n  \
    tactnet view today.mcap                               a recording\n  \
    tactnet view today.mcap --save today.rrd              a file for `rerun today.rrd`\n  \
    tactnet view --table robot.toml --connect rerun+http://127.0.0.1:9876/proxy\n\n\
    The viewer is a separate program: pip install rerun-sdk==0.36.3. It does not slow down the service or a recorder: \
        packets that it is too slow for are dropped.")]
pub struct ViewArgs {
    /// Recording of `tactnet record`
    #[arg(value_name = "FILE.mcap", required_unless_present = "table")]
    pub(super) file: Option<PathBuf>,
    /// Channel table of the channels to show live
    #[arg(long, value_name = "FILE", conflicts_with = "file")]
    pub(super) table: Option<PathBuf>,
    /// Duration, in s [default: until Ctrl-C]
    #[arg(long, value_name = "S", requires = "table")]
    pub(super) seconds: Option<f64>,
    #[command(flatten)]
    pub(super) target: TargetArgs,
}

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet data view sweeps.h5                           the first three sweeps of every material\n  \
    tactnet data view twin --material felt --sweeps 20\n  \
    tactnet data view sweeps.h5 --save sweeps.rrd         a file for `rerun sweeps.rrd`")]
pub struct SweepsArgs {
    /// Data set (.h5, .npz), or `twin`
    #[arg(value_name = "FILE|twin")]
    pub(super) data: String,
    /// Material to show; may be repeated [default: all]
    #[arg(long, value_name = "NAME")]
    pub(super) material: Vec<String>,
    /// Number of sweeps of each material
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(super) sweeps: usize,
    #[command(flatten)]
    pub(super) target: TargetArgs,
}

/// Output of the viewer data.
#[derive(Args)]
pub struct TargetArgs {
    /// Write a file for the viewer instead of opening one
    #[arg(long, value_name = "FILE.rrd")]
    pub(super) save: Option<PathBuf>,
    /// URL of a running viewer
    #[arg(long, value_name = "URL", conflicts_with = "save")]
    pub(super) connect: Option<String>,
    /// Memory limit of the viewer, above which it drops the oldest data
    #[arg(long, value_name = "SIZE", default_value = "2GB")]
    pub(super) memory_limit: String,
    /// Print one JSON document at the end
    #[arg(long)]
    pub(super) json: bool,
}
