//! Small network for users without a trained one.

use std::path::{Path, PathBuf};
use std::process::Command;

use tactnet_process::run_to_end;

use crate::SimulationError;

/// Number of materials of the small network.
pub const SMALL_MATERIALS: usize = 12;
/// Number of sweeps per material, of which a fifth is held out.
pub const SMALL_SWEEPS: usize = 40;

/// Trains a network on a small synthetic data set and returns its run directory.
///
/// - `program`: path of the command-line program
/// - `folder`: folder for run directory and data set
///
/// # Errors
/// Fails if the command does not start or fails.
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

/// Writes a synthetic data set with `sweeps` sweeps of each of `materials` materials.
///
/// # Errors
/// Fails if the command does not start or fails.
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
