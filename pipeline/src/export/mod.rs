//! Trained networks for other programs: ONNX, safetensors.

pub(crate) mod onnx;
mod properties;
pub(crate) mod safetensors;
