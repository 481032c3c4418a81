//! Integration tests, one binary.

mod command;
mod data_command;
mod golden;
mod training;
#[cfg(feature = "vulkan")]
mod vulkan;
