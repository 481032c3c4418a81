//! The online classifier as a component on the robot's channels.
//!
//! [`Service`] is the classifier between its channels, [`ModelSource`] the run directories that it serves, [`Measures`] its counters for
//! Prometheus. [`web`] answers browsers, [`systemd`] the service manager.

mod allocations;
pub mod doctor;
mod measures;
mod model;
mod model_worker;
mod realtime;
mod report;
mod serve_error;
mod service;
mod skin_limits;
mod status_line;
pub mod systemd;
pub mod web;

pub use allocations::{CountingAllocator, allocations_of_this_thread};
pub use measures::Measures;
pub use model::{ModelSource, ServedModel};
pub use realtime::Realtime;
pub use report::ServeReport;
pub use serve_error::ServeError;
pub use service::Service;
pub use skin_limits::accepted_values;
