//! What can go wrong.

use tactnet_data::DataError;
use tactnet_pipeline::PipelineError;

/// An error of reading, fitting, predicting or saving.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A data set that cannot be read, written or split.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A recipe, a fit, a prediction or a saved classifier.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
}

impl Error {
    /// Returns true if the call must be corrected, false if something broke.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Data(error) => error.is_usage(),
            Self::Pipeline(error) => error.is_usage(),
        }
    }
}
