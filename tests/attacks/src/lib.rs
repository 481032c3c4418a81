//! Damaged and hostile input for all readers of files and foreign packets, in process.
//!
//! [`open`] prepares a target, [`attack`] runs it on mutations of valid inputs, [`Report`] attacks all targets in
//! separate processes.

mod ceiling;
mod mutate;
mod report;
mod run;
mod targets;

pub use ceiling::{Allocator, most_held};
pub use report::Report;
pub use run::{Limits, Row, attack};
pub use targets::{NAMES, Target, open};
