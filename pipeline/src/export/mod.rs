//! Export of trained networks as ONNX and safetensors.

pub(crate) mod onnx;
mod properties;
pub(crate) mod safetensors;
