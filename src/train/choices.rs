//! What can be chosen on the command line of `tactnet train`.

use clap::ValueEnum;
use tactnet_models::Compute;
use tactnet_pipeline::MeanRemoval;

/// What to train.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum ModelChoice {
    /// TactNet-II, the thesis's convolutional network
    Tactnet2,
    /// k nearest neighbours on roughness and two spectral centroids
    KnnL,
    /// k nearest neighbours on the short-time spectrum
    KnnH,
    /// Support vector machine on roughness and two spectral centroids
    SvmL,
    /// Support vector machine on the short-time spectrum
    SvmH,
    /// MiniRocket and a ridge classifier
    Minirocket,
    /// MultiRocket and Hydra and a ridge classifier
    MultirocketHydra,
    /// Nearest neighbour on the taxels' means: a probe of what the data set gives away
    Means,
}

impl ModelChoice {
    /// The recipe that it has by itself.
    pub fn recipe(self) -> &'static str {
        match self {
            Self::Tactnet2 => "fast",
            Self::KnnL => "knn-l",
            Self::KnnH => "knn-h",
            Self::SvmL => "svm-l",
            Self::SvmH => "svm-h",
            Self::Minirocket => "minirocket",
            Self::MultirocketHydra => "multirocket-hydra",
            Self::Means => "means",
        }
    }
}

/// What happens to levels.
#[derive(Clone, Copy, ValueEnum)]
pub enum LevelsChoice {
    /// They may be used
    Kept,
    /// Each taxel's mean over the sweep is subtracted
    Removed,
}

impl LevelsChoice {
    /// For recipes.
    pub fn levels(self) -> MeanRemoval {
        match self {
            Self::Kept => MeanRemoval::None,
            Self::Removed => MeanRemoval::PerSweep,
        }
    }
}

/// How to split.
#[derive(Clone, Copy, ValueEnum)]
pub enum SplitChoice {
    /// Stratified 5-fold cross-validation, 2 runs
    KFold,
    /// The file's own test sweeps
    TestFlag,
    /// Fold k tests on the k-th recording block of every material
    LeaveBlockOut,
}

/// Where to compute.
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

impl DeviceChoice {
    /// The device of the models crate.
    pub fn compute(self) -> Compute {
        match self {
            Self::Cpu => Compute::Cpu,
            Self::Vulkan => Compute::Vulkan,
            Self::Cuda => Compute::Cuda,
        }
    }
}
