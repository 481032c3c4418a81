//! The subcommands: arguments, progress and exit codes.

pub mod channel;
pub mod dashboard;
pub mod demo;
pub mod record;
pub mod replay;
pub mod serve;
pub mod simulate;
pub mod view;
