//! A network for people who have trained none yet.

use std::path::{Path, PathBuf};
use std::process::Command;

use tactnet_process::run_to_end;

use crate::SimulationError;

/// Materials of the small network.
pub const SMALL_MATERIALS: usize = 12;
/// Sweeps of each, a fifth of which the network does not learn from.
pub const SMALL_SWEEPS: usize = 40;

/// Trains a network on a small twin, and returns its run directory.
///
/// - `program`: the `tactnet` command
/// - `folder`: where run directory and data set are written
///
/// # Errors
/// The command cannot be started, or fails.
pub fn train_small_network(program: &Path, folder: &Path) -> Result<PathBuf, SimulationError> {
    let data = folder.join("small.h5");
    make_twin(program, &data, SMALL_MATERIALS, SMALL_SWEEPS)?;
    let run = folder.join("small");
    let mut train = Command::new(program);
    train.args(["train", "--calibrate", "--epochs", "12", "--data"]);
    train.arg(&data).arg("--out").arg(&run);
    finish(train, "training")?;
    Ok(run)
}

/// Writes a twin of `materials` with `sweeps` each.
///
/// # Errors
/// The command cannot be started, or fails.
pub fn make_twin(
    program: &Path,
    path: &Path,
    materials: usize,
    sweeps: usize,
) -> Result<(), SimulationError> {
    let mut make = Command::new(program);
    make.args(["data", "twin", "--materials", &materials.to_string()]);
    make.args(["--sweeps", &sweeps.to_string(), "--out"]);
    make.arg(path);
    finish(make, "making of the twin")
}

fn finish(mut command: Command, name: &str) -> Result<(), SimulationError> {
    match run_to_end(&mut command) {
        Ok(_) => Ok(()),
        Err(error) => Err(SimulationError::process(name, &error)),
    }
}
