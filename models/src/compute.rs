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
    /// The binary was built without the device's cargo feature; no driver, or no GPU that it drives.
    pub fn open(self) -> Result<Device, ModelError> {
        match self {
            Self::Cpu => Ok(Device::flex()),
            #[cfg(feature = "vulkan")]
            Self::Vulkan => vulkan::gpu().map(|gpu| gpu.device.clone()),
            #[cfg(not(feature = "vulkan"))]
            Self::Vulkan => Err(missing("vulkan")),
            #[cfg(feature = "cuda")]
            Self::Cuda => Ok(Device::cuda(0)),
            #[cfg(not(feature = "cuda"))]
            Self::Cuda => Err(missing("cuda")),
        }
    }
}

/// What answers for a device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Adapter {
    /// Its name, as its driver gives it.
    pub name: String,
    /// Whether the processor plays the GPU.
    pub software: bool,
}

impl Compute {
    /// Returns what answers when a Vulkan device is asked for, which is opened for that.
    ///
    /// # Errors
    /// The binary was built without the cargo feature; no driver, or no GPU that it drives.
    pub fn vulkan_adapter() -> Result<Adapter, ModelError> {
        #[cfg(feature = "vulkan")]
        {
            vulkan::gpu().map(|gpu| Adapter {
                name: gpu.name.clone(),
                software: gpu.software,
            })
        }
        #[cfg(not(feature = "vulkan"))]
        Err(missing("vulkan"))
    }

    /// Returns the devices of this machine with their names; of those that compute in software, the processor alone.
    pub fn present() -> Vec<(Self, String)> {
        #[allow(unused_mut)]
        let mut present = vec![(Self::Cpu, "processor".to_owned())];
        #[cfg(feature = "vulkan")]
        if let Ok(gpu) = vulkan::gpu()
            && !gpu.software
        {
            present.push((Self::Vulkan, gpu.name.clone()));
        }
        present
    }
}

#[cfg(feature = "vulkan")]
mod vulkan {
    use std::sync::OnceLock;

    use burn::tensor::Device;
    use burn::tensor::wgpu::wgpu::DeviceType;
    use burn::tensor::wgpu::{WgpuBackend, WgpuInitError};

    use crate::ModelError;

    /// The GPU that this process uses.
    pub(super) struct Gpu {
        pub(super) device: Device,
        pub(super) name: String,
        /// Whether the processor plays the GPU.
        pub(super) software: bool,
    }

    /// Opens it once: a second attempt would be refused.
    pub(super) fn gpu() -> Result<&'static Gpu, ModelError> {
        static GPU: OnceLock<Result<Gpu, String>> = OnceLock::new();
        GPU.get_or_init(open)
            .as_ref()
            .map_err(|reason| ModelError::Compute {
                device: "vulkan",
                reason: reason.clone(),
            })
    }

    /// Burn's WGSL kernels: its SPIR-V ones make mesa's lavapipe crash while it reads them.
    fn open() -> Result<Gpu, String> {
        let mut options = Device::wgpu_options();
        // Elsewhere it is Metal or DirectX; here Mesa's OpenGL would take the place of a missing driver.
        if cfg!(target_os = "linux") {
            options = options.graphics_api(WgpuBackend::Vulkan);
        }
        let (device, setup) = options.init_with_setup().map_err(|error| match error {
            WgpuInitError::AdapterUnavailable { .. } => "no GPU with a driver was found".to_owned(),
            error => error.to_string(),
        })?;
        let info = setup.adapter.get_info();
        Ok(Gpu {
            device,
            name: info.name,
            software: info.device_type == DeviceType::Cpu,
        })
    }
}

#[cfg(not(all(feature = "vulkan", feature = "cuda")))]
fn missing(feature: &'static str) -> ModelError {
    ModelError::Compute {
        device: feature,
        reason: left_out(feature),
    }
}
