//! The realtime side: single frames in, whole sweeps out; and the stress test of the channels.
//!
//! Pure logic, no clock and no thread: a [`SweepWindow`] is pushed one [`tactnet_data::Frame`] at a time and neither
//! allocates nor blocks after it was made.

mod percentile;
pub mod stress;
mod window;

pub use percentile::percentile;
pub use window::{Push, SweepWindow, WindowConfig, WindowError};
