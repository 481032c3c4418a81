//! Lock that allows one training process per run directory.

use std::fs;
use std::path::Path;

use tactnet_data::UNFINISHED;

use crate::{PipelineError, RunDir};

/// Name of the lock file.
pub(super) const LOCK: &str = ".lock";

impl RunDir {
    /// Returns true if a process is training in the folder `path`; false if the folder does not exist.
    pub fn is_busy(path: &Path) -> bool {
        let Ok(file) = fs::File::open(path.join(LOCK)) else {
            return false;
        };
        matches!(file.try_lock_shared(), Err(fs::TryLockError::WouldBlock))
    }

    /// Locks the folder for training and removes unfinished files of processes that were killed.
    ///
    /// # Errors
    /// Another process that trains in the folder; a folder that cannot be read.
    pub fn locked(mut self) -> Result<Self, PipelineError> {
        self.lock = Some(Self::lock(&self.path)?);
        let failed = |error| PipelineError::io(&self.path, "clear up", error);
        for entry in fs::read_dir(&self.path).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            if entry.file_name().to_string_lossy().starts_with(UNFINISHED) {
                fs::remove_file(entry.path()).map_err(failed)?;
            }
        }
        Ok(self)
    }

    /// Creates the folder `path` if it does not exist and locks it. [`RunDir::is_busy`] then returns true until the returned file is dropped or
    /// the process ends.
    ///
    /// # Errors
    /// Another process that holds the lock.
    pub fn lock(path: &Path) -> Result<fs::File, PipelineError> {
        fs::create_dir_all(path)
            .map_err(|error| PipelineError::io(path, "make the folder", error))?;
        let name = path.join(LOCK);
        // Not truncated, since the path may be a link to another file.
        let file = fs::File::options()
            .write(true)
            .create(true)
            .truncate(false)
            .open(&name)
            .map_err(|error| PipelineError::io(&name, "make the lock file", error))?;
        let mut outcome = file.try_lock();
        for _ in 0..20 {
            // `is_busy` holds the lock for a moment.
            if !matches!(outcome, Err(fs::TryLockError::WouldBlock)) {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(10));
            outcome = file.try_lock();
        }
        match outcome {
            Ok(()) => Ok(file),
            Err(fs::TryLockError::WouldBlock) => Err(PipelineError::run(
                path,
                "another process is training in this folder",
            )),
            Err(fs::TryLockError::Error(error)) => Err(PipelineError::io(&name, "lock", error)),
        }
    }
}
