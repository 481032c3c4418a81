//! Closed choices of the command line, as clap shows them.

use std::net::SocketAddr;

use clap::ValueEnum;
use tactnet_data::DataError;
use tactnet_data::format::Keep;
use tactnet_models::Compute;
use tactnet_pipeline::{MeanRemoval, RuntimeKind, SplitKind};

/// Kind of model to train.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum ModelChoice {
    /// TactNet-II, the thesis's convolutional network
    Tactnet2,
    /// A small network on the spectra of short windows
    Spectra,
    /// k nearest neighbours on roughness and two spectral centroids
    KnnL,
    /// k nearest neighbours on the short-time spectrum
    KnnH,
    /// Support vector machine on roughness and two spectral centroids
    SvmL,
    /// Support vector machine on the short-time spectrum
    SvmH,
    /// Linear discriminant on levels and logarithmic spectra
    Lda,
    /// Support vector machine on levels and logarithmic spectra
    SvmSpectra,
    /// MiniRocket and a ridge classifier
    Minirocket,
    /// MultiRocket and Hydra and a ridge classifier
    MultirocketHydra,
    /// QUANT: quantiles over intervals and extremely randomised trees
    Quant,
    /// The mean of the probabilities of six of these models
    Committee,
    /// Nearest neighbour on the taxels' means: a probe of what the data set gives away
    Means,
    /// Nearest neighbour on the first frame: another probe
    FirstFrame,
    /// Nearest neighbour on the last frame: another probe
    LastFrame,
}

impl ModelChoice {
    /// Returns the model's default recipe.
    pub fn recipe(self) -> &'static str {
        match self {
            Self::Tactnet2 => "fast",
            Self::Spectra => "spectra",
            Self::KnnL => "knn-l",
            Self::KnnH => "knn-h",
            Self::SvmL => "svm-l",
            Self::SvmH => "svm-h",
            Self::Lda => "lda",
            Self::SvmSpectra => "svm-spectra",
            Self::Minirocket => "minirocket",
            Self::MultirocketHydra => "multirocket-hydra",
            Self::Quant => "quant",
            Self::Committee => "committee",
            Self::Means => "means",
            Self::FirstFrame => "first-frame",
            Self::LastFrame => "last-frame",
        }
    }
}

/// Parses an address with a port, or a port on the loopback interface.
pub fn listen(text: &str) -> Result<SocketAddr, String> {
    match text.parse() {
        Ok(port) => Ok(SocketAddr::from(([127, 0, 0, 1], port))),
        Err(_) => text
            .parse()
            .map_err(|_| "expected an address like 127.0.0.1:8750, or a port like 8750".into()),
    }
}

/// Use of each taxel's mean level.
#[derive(Clone, Copy, ValueEnum)]
pub enum LevelsChoice {
    /// Levels are kept
    Kept,
    /// Subtract each taxel's mean over the sweep
    Removed,
}

impl From<LevelsChoice> for MeanRemoval {
    fn from(choice: LevelsChoice) -> Self {
        match choice {
            LevelsChoice::Kept => Self::None,
            LevelsChoice::Removed => Self::PerSweep,
        }
    }
}

/// Split into training and test sweeps.
#[derive(Clone, Copy, ValueEnum)]
pub enum SplitChoice {
    /// Stratified folds: 5, or the sweep count of the smallest material if that is less
    KFold,
    /// A random fifth of each material's sweeps
    HoldOut,
    /// The test sweeps marked in the file
    TestFlag,
    /// Fold k tests on the k-th recording block of each material
    LeaveBlockOut,
    /// Folds of whole recording blocks, with about equal shares of each material
    GroupKFold,
}

impl From<SplitChoice> for SplitKind {
    fn from(choice: SplitChoice) -> Self {
        match choice {
            SplitChoice::KFold => Self::KFold,
            SplitChoice::HoldOut => Self::HoldOut,
            SplitChoice::TestFlag => Self::TestFlag,
            SplitChoice::LeaveBlockOut => Self::LeaveBlockOut,
            SplitChoice::GroupKFold => Self::GroupKFold,
        }
    }
}

/// Compute device.
#[derive(Clone, Copy, Default, ValueEnum)]
pub enum DeviceChoice {
    /// The processor
    #[default]
    Cpu,
    /// A GPU with a Vulkan driver (needs a build with `--features vulkan`)
    Vulkan,
    /// An NVIDIA GPU (needs a build with `--features cuda`)
    Cuda,
}

impl From<DeviceChoice> for Compute {
    fn from(choice: DeviceChoice) -> Self {
        match choice {
            DeviceChoice::Cpu => Self::Cpu,
            DeviceChoice::Vulkan => Self::Vulkan,
            DeviceChoice::Cuda => Self::Cuda,
        }
    }
}

/// Compute device for training.
#[derive(Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum TrainDeviceChoice {
    /// The processor
    #[default]
    Cpu,
    /// A GPU with a Vulkan driver (needs a build with `--features vulkan`)
    Vulkan,
    /// An NVIDIA GPU (needs a build with `--features cuda`)
    Cuda,
    /// The fastest device of this machine, by a few steps of the published network
    Auto,
}

impl TrainDeviceChoice {
    /// Returns the named device; the processor for `auto`.
    pub fn named(self) -> Compute {
        match self {
            Self::Cpu | Self::Auto => Compute::Cpu,
            Self::Vulkan => Compute::Vulkan,
            Self::Cuda => Compute::Cuda,
        }
    }
}

/// Runtime that computes the scores.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RuntimeChoice {
    /// Burn, in batches, as in training
    Burn,
    /// Frame by frame, as in `tactnet serve`
    Online,
    /// The exported ONNX file in ONNX Runtime (needs a build with `--features onnxruntime`)
    Onnxruntime,
    /// The exported weights in candle (needs a build with `--features candle`)
    Candle,
}

impl From<RuntimeChoice> for RuntimeKind {
    fn from(choice: RuntimeChoice) -> Self {
        match choice {
            RuntimeChoice::Burn => Self::Burn,
            RuntimeChoice::Online => Self::Online,
            RuntimeChoice::Onnxruntime => Self::OnnxRuntime,
            RuntimeChoice::Candle => Self::Candle,
        }
    }
}

/// Parses a number between 0 and 1, both excluded.
pub fn share(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_string())?;
    if value > 0.0 && value < 1.0 {
        Ok(value)
    } else {
        Err("expected a number between 0 and 1".into())
    }
}

/// Parses a number of time steps, `shortest` or `all`.
pub fn steps(text: &str) -> Result<Keep, String> {
    text.parse().map_err(|error: DataError| error.to_string())
}

/// Parses a number of time steps, or `all`.
pub fn steps_or_all(text: &str) -> Result<Keep, String> {
    match steps(text)? {
        Keep::Shortest => Err("expected a number of time steps, or `all`".into()),
        keep => Ok(keep),
    }
}

/// Parses a sample rate: a positive number of Hz.
pub fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("expected a positive number of Hz".into()),
    }
}
