//! Cache of the networks that a task has trained, so that a resumed task does not train them again.

use std::cell::Cell;
use std::fs;
use std::path::{Path, PathBuf};

use tactnet_data::sha256_hex;
use tactnet_models::Weights;
use tactnet_pipeline::{Classifier, PipelineError, write_whole};

use crate::ExperimentError;

/// The folder `networks` of a task, in the order of training.
pub(crate) struct FinishedNetworks {
    folder: PathBuf,
    asked: Cell<usize>,
}

impl FinishedNetworks {
    /// Opens the cache in a task's folder.
    pub(crate) fn of_task(folder: &Path) -> Self {
        Self {
            folder: folder.join("networks"),
            asked: Cell::new(0),
        }
    }

    /// Returns the cache entry of the next network.
    ///
    /// - `identity`: text of everything that determines its weights; entries of another identity are ignored
    pub(crate) fn next(&self, identity: &str) -> FinishedNetwork {
        let number = self.asked.get();
        self.asked.set(number + 1);
        let name = format!("{number:03}-{}.safetensors", &sha256_hex(identity)[..16]);
        FinishedNetwork(self.folder.join(name))
    }

    /// Removes all entries once the task has its result.
    ///
    /// # Errors
    /// Files that cannot be removed.
    pub(crate) fn remove(&self) -> Result<(), ExperimentError> {
        if self.folder.exists() {
            fs::remove_dir_all(&self.folder)
                .map_err(|error| ExperimentError::io(&self.folder, "remove", error))?;
        }
        Ok(())
    }
}

/// Cache entry of one network's weights.
pub(crate) struct FinishedNetwork(PathBuf);

impl FinishedNetwork {
    /// Reads the weights; `None` if no earlier session wrote them.
    ///
    /// # Errors
    /// A file that cannot be read or holds no weights.
    pub(crate) fn read(&self) -> Result<Option<Weights>, ExperimentError> {
        if !self.0.exists() {
            return Ok(None);
        }
        let bytes =
            fs::read(&self.0).map_err(|error| ExperimentError::io(&self.0, "read", error))?;
        let weights = Weights::from_safetensors(&bytes).map_err(PipelineError::from)?;
        Ok(Some(weights))
    }

    /// Writes the weights atomically.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(crate) fn write(&self, classifier: &Classifier) -> Result<(), ExperimentError> {
        if let Some(folder) = self.0.parent() {
            fs::create_dir_all(folder)
                .map_err(|error| ExperimentError::io(folder, "make", error))?;
        }
        let metadata = [("format".to_string(), "tactnet weights 1".to_string())].into();
        let bytes = classifier
            .network()?
            .weights()
            .to_safetensors(metadata)
            .map_err(PipelineError::from)?;
        write_whole(&self.0, &bytes)?;
        Ok(())
    }
}
