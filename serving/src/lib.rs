//! The realtime side: single frames in, whole sweeps out; and the stress test of the channels.
//!
//! Pure logic, no clock and no thread: a [`SweepWindow`] is pushed one [`tactnet_data::Frame`] at a time and neither
//! allocates nor blocks after it was made.

mod follow;
mod line;
mod measures;
mod model;
mod model_worker;
pub mod packets;
mod percentile;
mod realtime;
mod serve_config;
mod serve_error;
mod service;
pub mod simulate;
pub mod stress;
mod window;

pub use follow::{Contact, FollowConfig, Followed, Reject, Segmentation, SweepSegmenter};
pub use measures::Measures;
pub use model::{ModelSource, ServedModel};
pub use percentile::percentile;
pub use realtime::Realtime;
pub use serve_config::ServeConfig;
pub use serve_error::ServeError;
pub use service::Service;
pub use window::{Push, SweepWindow, WindowConfig, WindowError};
