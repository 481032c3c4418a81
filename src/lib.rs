//! Tactile material classification: which material did the fingertip sweep over, and how sure is that?
//!
//! ```
//! # use tactnet::{Dataset, Recipe, Seed, TwinConfig};
//! # let folder = tempfile::tempdir()?;
//! # std::env::set_current_dir(folder.path())?;
//! # let small = TwinConfig { materials: 3, sweeps: 20, steps: 120, ..TwinConfig::default() };
//! # Dataset::twin(&small)?.write("sweeps.h5")?;
//! let dataset = Dataset::read("sweeps.h5")?;
//! let fold = dataset.folds(Seed(1)).first();
//! let classifier = Recipe::named("fast")?.fit(&fold.train)?;
//! println!("{}", classifier.predict(&fold.test)?.accuracy());
//! classifier.save("classifier")?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! - [`Dataset`]: sweeps with their materials, read from HDF5 or npz, or generated (the twin).
//! - [`Fold`]: the sweeps to learn from and the sweeps to be measured on; only the former can be fitted to.
//! - [`Recipe`]: how a classifier comes about, of a network or of a baseline.
//! - [`Classifier`]: a fitted one. What it saves, the command line opens: `tactnet eval`, `enroll`, `export`, `serve`.
//! - [`OnlineClassifier`]: the same, frame by frame.
//!
//! The crates behind it have the parts: `tactnet_data`, `tactnet_models`, `tactnet_pipeline`.

mod classifier;
mod recipe;

pub use classifier::Classifier;
pub use recipe::Recipe;
pub use tactnet_data::twin::TwinConfig;
pub use tactnet_data::{
    CheckedDataset as Dataset, Fold, Folds, Seed, SweepView, TestSplit, TrainSplit,
};
pub use tactnet_models::{Belief, Compute};
pub use tactnet_pipeline::{
    BatchReport, MeanRemoval, OnlineClassifier, PipelineError as Error, PredictionMethod,
    Predictions, SweepBelief,
};
