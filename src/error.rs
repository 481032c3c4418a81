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
    /// Too few sweeps to split.
    #[error(
        "data set `{dataset}`, material `{material}`: expected at least 2 sweeps, one to learn from and one to test on, found {found}"
    )]
    TooFewSweeps {
        /// Name of the data set.
        dataset: String,
        /// Its material with the fewest sweeps.
        material: String,
        /// How many that has.
        found: usize,
    },
}

impl Error {
    /// Returns true if the call must be corrected, false if something broke.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Data(error) => error.is_usage(),
            Self::Pipeline(error) => error.is_usage(),
            Self::TooFewSweeps { .. } => true,
        }
    }
}
