//! Child processes: a task of an experiment, a component of a simulated robot, or a command that runs once.
//!
//! | | output | ends |
//! |---|---|---|
//! | [`ChildProcess`] | where its caller sends it, such as a log | by itself, or when asked |
//! | [`ReadyProcess`] | read; its first line is `ready` | when asked |
//! | [`run_to_end`] | read | by itself |
//!
//! The first two are in separate process groups, so Ctrl-C reaches only the program that started them, and are killed
//! when they are dropped. They are asked to end with SIGTERM, which exists only on Unix.
//!
//! [`VirtualNetwork`] runs them on several hosts: network namespaces of Linux.

mod background;
mod child_process;
mod error;
mod last_lines;
mod ready_process;
mod run_to_end;
#[cfg(target_os = "linux")]
mod virtual_network;

pub use background::run_in_background;
pub use child_process::ChildProcess;
pub use error::ProcessError;
pub use last_lines::without_prefix;
pub use ready_process::ReadyProcess;
pub use run_to_end::run_to_end;
#[cfg(target_os = "linux")]
pub use virtual_network::{NetworkError, VirtualNetwork};
