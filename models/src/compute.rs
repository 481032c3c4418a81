//! Compute devices.

use burn::tensor::Device;
use serde::{Deserialize, Serialize};

use crate::{ModelError, left_out};

/// The device a network runs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Compute {
    /// The processor, through Burn's Flex backend.
    #[default]
    Cpu,
    /// Any GPU with a Vulkan driver; needs the cargo feature `vulkan`.
    Vulkan,
    /// An NVIDIA GPU; needs the cargo feature `cuda`.
    Cuda,
}

impl Compute {
    /// Opens the device, without autodiff.
    ///
    /// # Errors
    /// The binary was built without the device's cargo feature.
    pub fn open(self) -> Result<Device, ModelError> {
        match self {
            Self::Cpu => Ok(Device::flex()),
            // Burn's WGSL kernels: its SPIR-V ones (`Device::vulkan`) make mesa's lavapipe crash while it reads them.
            #[cfg(feature = "vulkan")]
            Self::Vulkan => Ok(Device::wgpu(burn::tensor::DeviceKind::DefaultDevice)),
            #[cfg(not(feature = "vulkan"))]
            Self::Vulkan => Err(missing("vulkan")),
            #[cfg(feature = "cuda")]
            Self::Cuda => Ok(Device::cuda(0)),
            #[cfg(not(feature = "cuda"))]
            Self::Cuda => Err(missing("cuda")),
        }
    }
}

#[cfg(not(all(feature = "vulkan", feature = "cuda")))]
fn missing(feature: &'static str) -> ModelError {
    ModelError::Compute {
        device: feature,
        reason: left_out(feature),
    }
}
