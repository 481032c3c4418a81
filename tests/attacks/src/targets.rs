//! Targets: all readers of files and foreign packets.

mod datasets;
mod messages;
mod recording;
mod run_dir;
mod texts;

use anyhow::bail;

/// Names of all targets.
pub const NAMES: [&str; 13] = [
    "npz",
    "npz members",
    "hdf5",
    "mat",
    "csv",
    "recordings",
    "parquet",
    "folders",
    "mcap",
    "topics",
    "messages",
    "run",
    "tables",
];

/// Returns the reason why this build lacks a target; `None` if it has it.
pub fn lacking(name: &str) -> Option<&'static str> {
    let is_lacking = name == "parquet" && !tactnet_data::format::READS_PARQUET;
    is_lacking.then_some("this build does not read Parquet; build with `--features parquet`")
}

/// Reads an input; returns true if it accepts it as valid.
type Run = dyn FnMut(&[u8]) -> bool;

/// A reader under attack.
pub struct Target {
    /// Valid inputs.
    pub seeds: Vec<Vec<u8>>,
    /// Reads an input; returns true if it accepts it as valid.
    pub run: Box<Run>,
    /// Maximum memory of a call, in bytes.
    pub ceiling: usize,
    /// True if a call might end the process, so that its input is saved first.
    pub may_abort: bool,
}

impl Target {
    fn new(seeds: Vec<Vec<u8>>, run: impl FnMut(&[u8]) -> bool + 'static) -> Self {
        Self {
            seeds,
            run: Box::new(run),
            ceiling: 64 << 20,
            may_abort: true,
        }
    }
}

/// Prepares a target.
///
/// # Errors
/// Fails if the target does not exist or there is no shared memory for its files.
pub fn open(name: &str) -> anyhow::Result<Target> {
    match name {
        "npz" => datasets::whole("npz"),
        "npz members" => datasets::npz_members(),
        "hdf5" => datasets::whole("h5"),
        "mat" => datasets::others("mat"),
        "csv" => datasets::csv(),
        "recordings" => datasets::recordings(),
        "parquet" => datasets::others("parquet"),
        "folders" => datasets::folders(),
        "mcap" => recording::mcap(),
        "topics" => recording::topics(),
        "messages" => Ok(messages::messages()),
        "run" => run_dir::run(),
        "tables" => Ok(texts::tables()),
        _ => bail!("no target `{name}`; there are {}", NAMES.join(", ")),
    }
}
