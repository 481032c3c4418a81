//! Tactile material classification: predicts the material under a sweeping fingertip, with probabilities.
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
//! - [`Fold`]: training sweeps and test sweeps; fitting accepts only the training sweeps.
//! - [`Recipe`]: settings of a classifier, a network or a baseline.
//! - [`Classifier`]: a fitted classifier. The command line opens the folders that it saves.
//! - [`OnlineClassifier`]: classifies a sweep frame by frame.
//!
//! The parts are in the crates `tactnet_data`, `tactnet_models` and `tactnet_pipeline`.

mod classifier;
mod recipe;

pub use classifier::Classifier;
pub use recipe::Recipe;
pub use tactnet_data::twin::TwinConfig;
pub use tactnet_data::{
    CheckedDataset as Dataset, Condition, ConditionValues, Fold, Folds, Quantity, Scheme, Seed,
    SweepView, TestSplit, TrainSplit,
};
pub use tactnet_models::{Belief, Compute};
pub use tactnet_pipeline::{
    AdaptRisk, Adaptation, BatchReport, LeftOutMember, LikenessReport, LikenessVerdict,
    MeanRemoval, NewSweeps, OnlineClassifier, PipelineError as Error, PredictionMethod,
    Predictions, Recovery, RegressionReport, RiskPolicy, SweepBelief,
};
