//! From sweeps to predictions: features, training, evaluation, run directories.
//!
//! ```text
//! TrainSplit ─> Normalizer ─> Training (step by step) ─> RunDir ─> Classifier ─> Predictions ─> Evaluation
//! ```
//!
//! | room | content |
//! |---|---|
//! | `spec` | settings of one training, shared by command line, plans and child processes |
//! | `features` | scaling, augmentation and the features of baselines |
//! | `network` | training of networks, embeddings, novelty scores |
//! | `baseline` | features followed by a classical classifier |
//! | `adapt` | adaptation to sweeps of another skin, robot or day |
//! | `likeness` | comparison of sweeps with the training sweeps: like them or unlike, and what differs |
//! | `predict` | offline and online classifiers, predictions, evaluations |
//! | `run` | run directories and the session that fills one |
//! | `export` | ONNX and safetensors files for other programs |
//!
//! Only a [`tactnet_data::TrainSplit`] can be fitted to; any view can be predicted. A [`Training`] runs one batch per call and can
//! stop after any of them, because every random choice is derived from seed, epoch and batch.

mod adapt;
mod baseline;
mod committee;
mod error;
mod export;
mod features;
mod likeness;
mod model_recipe;
mod network;
mod predict;
mod recipe;
mod regress;
mod remedy;
mod requirements;
mod run;
mod spec;

pub use adapt::{
    ADAPT_MINIMUM, AdaptRisk, Adaptation, Adapted, AdaptedSweeps, NewSweeps, Presence, RiskPolicy,
    Shift, adapt,
};
pub use baseline::extra_trees::ExtraTreesRecipe;
pub use baseline::fit::{BaselineFit, fit_baseline};
pub use baseline::knn::KnnRecipe;
pub use baseline::lda::LdaRecipe;
pub use baseline::recipe::{BaselineRecipe, ClassicalClassifier, FeatureScaling};
pub use baseline::ridge::RidgeRecipe;
pub use baseline::svm::SvmRecipe;
pub use burn::tensor::Device;
pub use committee::enroll::{FormerSweeps, enroll_into_committee};
pub use committee::fitted::MemberConfig;
pub use committee::recipe::{CommitteeRecipe, LeftOutMember};
pub use committee::training::{FittedModel, fit_model};
pub use error::PipelineError;
pub use export::onnx::{OnnxInputs, to_onnx};
pub use export::safetensors::to_safetensors;
pub use features::augment::Augmentation;
pub use features::disturbance::{DeadTaxels, Disturbance};
pub use features::extractor::FeatureSet;
#[doc(hidden)]
pub use features::feature_timing::FeatureTimer;
pub use features::mean_removal::MeanRemoval;
pub use features::normalize::{Normalizer, Scaling};
pub use likeness::{Difference, Likeness, LikenessReport, LikenessVerdict, Property, TaxelOrder};
pub use model_recipe::ModelRecipe;
pub use network::batch_report::BatchReport;
pub use network::embedding::Embedding;
pub use network::fit_mlp::{
    MlpTraining, SweepPair, fit_difference, fit_embedding, fit_labels, predict_difference,
};
pub use network::measured::{Figures, Measured};
pub use network::novelty::{NoveltyScore, NoveltyScorer};
pub use network::objective::{Pass, Perturbation, Targets, adversarial_pass, base_pass};
#[cfg(any(feature = "vulkan", feature = "cuda"))]
pub use network::stacked::{StackMember, StackedTraining};
pub use network::train_embeddings::TrainEmbeddings;
pub use network::train_network::{train_network, train_siamese};
pub use network::training::{Position, Training, TrainingState};
pub use predict::by_length::LengthAccuracy;
pub use predict::by_method::serialize_by_method;
pub use predict::calibration::{
    Calibration, CalibrationTarget, Verdict, least_probability, prediction_set, upper_quantile,
};
pub use predict::classifier::Classifier;
pub use predict::classifier_config::{ClassifierConfig, ModelConfig, NetworkSetup, StepRange};
pub use predict::classify::{ClassifiedObject, ClassifiedSweep, ClassifiedSweeps};
pub use predict::conditions::{TrainedCondition, TrainedConditions};
pub use predict::confounded_accuracy::ConfoundedAccuracy;
pub use predict::confusion::Confusion;
pub use predict::enroll::{
    Enrolled, EnrolledMaterial, EnrolmentCost, RowPrior, Thresholds, enroll, weights_sha256,
};
pub use predict::evaluation::{Evaluation, evaluate_all_ways};
pub use predict::metrics::{Estimate, FusedAccuracy};
pub use predict::online::{OnlineClassifier, SweepBelief};
pub use predict::overlap::without_sweeps_of;
pub use predict::predictions::{PredictionSource, Predictions, SweepScore};
pub use predict::runtime::{RuntimeComparison, RuntimeKind, compare_runtime};
pub use predict::same::{SameMaterial, probability_of_different_materials};
pub use predict::unknown_detector::{UnknownDetector, novelty_scores};
pub use predict::verdicts::Verdicts;
pub use recipe::{
    AdversarialMask, AdversarialStatistics, AttackedLabel, Input, LearningRateDrop, NetworkRecipe,
    OneCycle, PenalizedParameters, Prediction, PredictionMethod, Teacher, TrainingMethod,
    TrainingSettings,
};
pub use regress::{Interval, Recovery, RegressionReport};
pub use remedy::PipelineRemedy;
pub use run::evaluate_run::{TrainingSummary, evaluate_run};
pub use run::provenance::{Provenance, peak_rss_mib};
pub use run::random_fold::RandomFold;
pub use run::reevaluate::{EvalResult, Reevaluation, RuntimeSummary};
pub use run::result::{RunResult, describe_split};
pub use run::run_config::{EpochMetrics, LabelOrder, RunConfig};
pub use run::run_dir::RunDir;
pub use run::session::{Program, Session, TrainEvent, TrainOutcome};
pub use run::test_sweeps::TestSweeps;
pub use run::together::{Ended, train_together};
pub use run::training_steps::TrainingSteps;
pub use run::write_whole::write_whole;
pub use spec::{SplitKind, SweepLengths, TrainJob, TrainSpec, quoted};
pub use tactnet_data::UNFINISHED;
