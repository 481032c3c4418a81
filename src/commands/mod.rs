//! One file a subcommand: arguments, progress, exit code.

pub mod choices;
pub mod data;
pub mod enroll;
pub mod eval;
pub mod experiment;
pub mod export;
pub mod task;
pub mod train;
