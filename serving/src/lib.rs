//! The online classifier as a component on the robot's channels.
//!
//! [`Service`] is the classifier between its channels, [`ModelSource`] the run directories that it serves, [`Metrics`]
//! its counters for Prometheus. [`web`] serves the live page, [`systemd`] notifies the service manager.

mod allocations;
mod metrics;
mod model;
mod model_worker;
mod realtime;
mod recent_sweeps;
mod report;
mod serve_error;
mod service;
mod skin_limits;
mod status_line;
pub mod systemd;
pub mod web;

pub use allocations::{CountingAllocator, allocations_of_this_thread};
pub use metrics::Metrics;
pub use model::{ModelSource, ServedModel};
pub use realtime::Realtime;
pub use report::ServeReport;
pub use serve_error::ServeError;
pub use service::Service;
pub use skin_limits::accepted_values;
