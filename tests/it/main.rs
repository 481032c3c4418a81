//! Integration tests, one binary.

#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should say where"
)]

mod command;
mod data_command;
mod golden;
mod training;
#[cfg(feature = "vulkan")]
mod vulkan;
