//! One file a subcommand: arguments, progress, exit code.

pub mod bench;
pub mod catch;
pub mod channel;
pub mod choices;
pub mod completions;
pub mod dashboard;
pub mod data;
pub mod demo;
pub mod doctor;
pub mod enroll;
pub mod eval;
pub mod experiment;
pub mod export;
pub mod man;
pub mod predict;
pub mod progress_line;
pub mod record;
pub mod replay;
pub mod run_choice;
pub mod serve;
pub mod simulate;
pub mod task;
pub mod train;
pub mod version;
pub mod view;
