//! Sweeps to predictions.
//!
//! ```text
//! TrainSplit ─> Normalizer ─> Training (step by step) ─> RunDir ─> Classifier ─> Predictions ─> Evaluation
//! ```
//!
//! Only a [`tactnet_data::TrainSplit`] can be fitted to; any view can be predicted. A [`Training`] does one batch at a
//! time and can be stopped anywhere: every random choice is named by seed, epoch and batch.

mod adam;
mod arrays;
mod augment;
mod baseline;
mod baseline_fit;
mod calibration;
mod checkpoint;
mod classifier;
mod confusion_picture;
mod embedding;
mod enroll;
mod error;
mod evaluate_run;
mod evaluation;
mod extractor;
mod feature_timing;
mod fit_mlp;
#[cfg(test)]
mod golden;
mod hydra;
mod mean_removal;
mod metrics;
mod model_recipe;
mod network_scorer;
mod normalize;
mod novelty;
mod objective;
mod online;
mod onnx;
mod overlap;
mod predictions;
mod provenance;
mod recipe;
mod result;
mod rocket;
mod run_config;
mod run_dir;
mod scaler;
mod series;
mod spec;
mod spectrum;
mod train_embeddings;
mod train_network;
mod training;
mod write_whole;

pub use augment::Augmentation;
pub use baseline::{BaselineRecipe, ClassicalClassifier, FeatureScaling};
pub use baseline_fit::{BaselineFit, fit_baseline};
pub use burn::tensor::Device;
pub use calibration::{
    Calibration, CalibrationTarget, Verdict, least_probability, prediction_set, upper_quantile,
};
pub use classifier::{Classifier, ClassifierConfig, ModelConfig, TactNetSetup};
pub use embedding::Embedding;
pub use enroll::{Enrolled, EnrolledMaterial, enroll};
pub use error::PipelineError;
pub use evaluate_run::{TrainingSummary, evaluate_run};
pub use evaluation::{Evaluation, evaluate_all_ways};
pub use extractor::FeatureSet;
#[doc(hidden)]
pub use feature_timing::FeatureTimer;
pub use fit_mlp::{
    MlpTraining, SweepPair, fit_difference, fit_embedding, fit_labels, predict_difference,
};
pub use mean_removal::MeanRemoval;
pub use metrics::{Estimate, FusedAccuracy};
pub use model_recipe::ModelRecipe;
pub use normalize::{Normalizer, Scaling};
pub use novelty::{NoveltyScore, NoveltyScorer};
pub use objective::{Pass, Perturbation, adversarial_pass, base_pass};
pub use online::{OnlineClassifier, SweepBelief};
pub use onnx::{to_onnx, to_safetensors};
pub use overlap::without_sweeps_of;
pub use predictions::{PredictionSource, Predictions, SweepScore};
pub use provenance::{Provenance, peak_rss_mib};
pub use recipe::{
    Input, LearningRateDrop, OneCycle, Prediction, PredictionMethod, Recipe, TrainingMethod,
    TrainingSettings,
};
pub use result::{RunResult, describe_split};
pub use run_config::{EpochMetrics, LabelOrder, RunConfig};
pub use run_dir::RunDir;
pub use spec::{SplitKind, TrainJob, TrainSpec};
pub use train_embeddings::TrainEmbeddings;
pub use train_network::train_network;
pub use training::{BatchReport, Position, Training, TrainingState};
pub use write_whole::{UNFINISHED, write_whole};
