//! Compute devices.

use burn::tensor::Device;
use serde::{Deserialize, Serialize};

use crate::{MissingFeature, ModelError};

/// The device a network runs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Compute {
    /// The CPU, through Burn's Flex backend.
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
    /// The build lacks the device's cargo feature; no driver; no GPU that the driver supports.
    pub fn open(self) -> Result<Device, ModelError> {
        match self {
            Self::Cpu => Ok(Device::flex()),
            #[cfg(feature = "vulkan")]
            Self::Vulkan => vulkan::gpu().map(|gpu| gpu.device.clone()),
            #[cfg(not(feature = "vulkan"))]
            Self::Vulkan => Err(MissingFeature { feature: "vulkan" }.into()),
            #[cfg(feature = "cuda")]
            Self::Cuda => Ok(Device::cuda(0)),
            #[cfg(not(feature = "cuda"))]
            Self::Cuda => Err(MissingFeature { feature: "cuda" }.into()),
        }
    }
}

/// Driver's description of a GPU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Adapter {
    /// Name that the driver reports.
    pub name: String,
    /// True if the driver computes on the CPU.
    pub software: bool,
}

impl Compute {
    /// Opens the Vulkan device and returns its adapter.
    ///
    /// # Errors
    /// The build lacks the cargo feature; no driver; no GPU that the driver supports.
    pub fn vulkan_adapter() -> Result<Adapter, ModelError> {
        #[cfg(feature = "vulkan")]
        {
            vulkan::gpu().map(|gpu| Adapter {
                name: gpu.name.clone(),
                software: gpu.software,
            })
        }
        #[cfg(not(feature = "vulkan"))]
        Err(MissingFeature { feature: "vulkan" }.into())
    }

    /// Returns the devices of this machine with their names, without GPUs that a driver emulates on the CPU.
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

    /// The GPU of this process.
    pub(super) struct Gpu {
        pub(super) device: Device,
        pub(super) name: String,
        /// True if the driver computes on the CPU.
        pub(super) software: bool,
    }

    /// Opens the GPU at the first call, since wgpu refuses a second initialisation.
    pub(super) fn gpu() -> Result<&'static Gpu, ModelError> {
        static GPU: OnceLock<Result<Gpu, String>> = OnceLock::new();
        GPU.get_or_init(open)
            .as_ref()
            .map_err(|reason| ModelError::Compute {
                device: "vulkan",
                reason: reason.clone(),
            })
    }

    /// Opens the device with Burn's WGSL kernels; SPIR-V kernels crash mesa's lavapipe.
    fn open() -> Result<Gpu, String> {
        let mut options = Device::wgpu_options();
        // Other systems use Metal or DirectX. On Linux, wgpu would silently replace a missing Vulkan driver by Mesa's OpenGL.
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
