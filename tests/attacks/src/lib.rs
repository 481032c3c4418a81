//! Damaged and hostile input against everything that reads files or packets of others, in process.
//!
//! [`open`] makes a target ready, [`attack`] gives it inputs that were made from valid ones, [`Report`] attacks all of them in processes of
//! their own.

mod ceiling;
mod mutate;
mod report;
mod run;
mod targets;

pub use ceiling::{Allocator, most_held};
pub use report::Report;
pub use run::{Limits, Row, attack};
pub use targets::{NAMES, Target, open};
