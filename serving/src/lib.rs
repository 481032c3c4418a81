//! The online classifier as a component on the robot's channels; and the stress test of the channels.

mod line;
mod measures;
mod model;
mod model_worker;
mod percentile;
mod realtime;
mod serve_error;
mod service;
pub mod simulate;
pub mod stress;

pub use measures::Measures;
pub use model::{ModelSource, ServedModel};
pub use percentile::percentile;
pub use realtime::Realtime;
pub use serve_error::ServeError;
pub use service::Service;
