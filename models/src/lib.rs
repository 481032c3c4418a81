//! Neural networks, classical classifiers and the belief over materials: arrays in, scores out.
//!
//! ```text
//! sweeps [batch, 1, steps, taxels] ─> trunk ─> features ─> dropout mask ─> Dense ─> logits [batch, materials]
//!
//! trunk of TactNet-II: 3 x ConvBlock        trunk on spectra: log spectra of windows ─> 2 x Dense ─> mean and deviation over windows
//! ```
//!
//! This crate reads no files, clocks or data sets. The caller passes the generator for dropout masks and initial weights, so equal seeds
//! give equal networks.

mod adam_update;
mod architecture;
mod belief;
mod block;
mod columns;
mod compute;
mod config;
mod conv;
#[cfg(any(feature = "vulkan", feature = "cuda"))]
mod conv_gpu;
mod conv_stream;
mod conv_trunk;
mod dense;
mod dense_product;
mod dropout;
mod extra_trees;
mod features;
mod filter_bank;
mod folded_dft;
mod heads;
mod initial;
mod knn;
mod lbfgs;
mod lda;
mod log_spectra;
mod log_spectra_op;
mod loss;
mod missing_feature;
mod mlp;
#[cfg(any(feature = "vulkan", feature = "cuda"))]
mod net_stack;
mod network;
mod norm_relu;
mod ridge;
mod ridge_regression;
mod safetensors_bytes;
mod setting;
mod siamese;
mod spectral_shape;
mod spectral_stream;
mod spectral_trunk;
mod streaming;
mod svm;
mod temperature;
mod values;
mod weights;

pub use adam_update::adam_update;
pub use architecture::{
    Architecture, Convolutions, InputShape, Spectra, Trunk, default_pools, default_window,
};
pub use belief::{
    Belief, argmax, entropy, log_mean_exp_into, log_softmax, log_softmax_into, majority_vote,
    mutual_information,
};
pub use block::{BatchStatistics, BlockConfig, ConvBlock, NORM_EPSILON};
pub use columns::Columns;
pub use compute::{Adapter, Compute};
pub use config::NetworkConfig;
pub use conv::{is_cpu, is_fused};
pub use dense::NormalizedDense;
pub use dropout::{dropout_bits, dropout_masks};
pub use extra_trees::{ExtraTrees, ExtraTreesSettings, LeafCount, TreeNode, TreeSweeps};
pub use features::Features;
pub use heads::{
    LinearHead, NearestMean, NewClass, SimpleShot, WeightPrior, Whitening, fit_new_class,
};
pub use knn::Knn;
pub use lda::Lda;
pub use log_spectra::{ENERGY_FLOOR, LOG_GAIN, LOG_OFFSET, SpectralTables};
pub use loss::{cross_entropy, soft_cross_entropy, weighted_cross_entropy};
pub use missing_feature::MissingFeature;
pub use mlp::{DenseWeights, Mlp, matrix};
#[cfg(any(feature = "vulkan", feature = "cuda"))]
pub use net_stack::{NetStack, StackSettings, StackedNet};
pub use network::{Network, TrainingForward};
pub use ridge::{Gram, Ridge, RidgeTargets, default_penalties};
pub use ridge_regression::RidgeRegression;
pub use safetensors_bytes::safetensors_bytes;
pub use siamese::{batch_contrastive_loss, contrastive_loss, distance, probability_of_difference};
pub use spectral_shape::SpectralShape;
pub use spectral_trunk::DEVIATION_EPSILON;
pub use streaming::StreamingNet;
pub use svm::{Pair, PlattSigmoids, Svm, SvmSettings, fit_platt};
pub use tactnet_conv::spare::take as spare_memory;
pub use tactnet_conv::{AdamStep, Isa};
#[cfg(any(feature = "vulkan", feature = "cuda"))]
pub use tactnet_conv_gpu::{StackAttack, StackBatch, StackDigits, StackMeasured, StackSweeps};
pub use temperature::fit_inverse_temperature;
pub use values::values;
pub use weights::{NamedTensor, Weights};

/// Errors of network descriptions, weights, devices and fits.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// A setting is out of range.
    #[error("network setting `{setting}`: expected {expected}, found {found}")]
    Setting {
        /// Name of the setting in a recipe.
        setting: &'static str,
        /// Allowed values.
        expected: String,
        /// Value found.
        found: String,
    },
    /// Weights do not match the network.
    #[error("weights: tensor `{tensor}`: expected {expected}, found {found}")]
    Weights {
        /// Name of the tensor.
        tensor: String,
        /// Expected shape or type.
        expected: String,
        /// Shape or type found.
        found: String,
    },
    /// Bytes are not a valid safetensors file.
    #[error("weights: not a safetensors file: {0}")]
    Safetensors(#[from] safetensors::SafeTensorError),
    /// The build lacks a cargo feature.
    #[error("{0}")]
    MissingFeature(#[from] MissingFeature),
    /// A device cannot be used on this machine.
    #[error("compute device `{device}`: {reason}")]
    Compute {
        /// Name of the device.
        device: &'static str,
        /// Message of the driver.
        reason: String,
    },
    /// A classifier could not be fitted.
    #[error("{what}: {reason}")]
    Fit {
        /// Name of the classifier.
        what: &'static str,
        /// Reason for the failure.
        reason: String,
    },
}
