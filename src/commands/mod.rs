//! Subcommands, one per file: arguments, progress, exit code.

pub mod adapt;
mod array_names;
pub mod bench;
mod block_text;
#[cfg_attr(not(feature = "catching"), path = "without_catching.rs")]
pub mod catch;
pub mod channel;
pub mod choices;
mod classified_text;
pub mod completions;
pub mod dashboard;
pub mod data;
pub mod demo;
pub mod distill;
pub mod doctor;
pub mod enroll;
pub mod eval;
mod eval_text;
mod evaluation_table;
pub mod experiment;
pub mod export;
pub mod man;
mod network_run;
pub mod predict;
pub mod progress_line;
mod recall_text;
#[cfg(feature = "recording")]
pub mod record;
mod reference;
pub mod regress;
#[cfg(feature = "recording")]
pub mod replay;
pub mod run_choice;
pub mod run_classifier;
pub mod same;
mod same_text;
pub mod serve;
pub mod simulate;
#[cfg(feature = "catching")]
pub mod stage_source;
pub mod task;
pub mod train;
pub mod version;
pub mod view;
#[cfg(not(feature = "recording"))]
pub mod without_recording;

#[cfg(not(feature = "recording"))]
pub use {without_recording as record, without_recording as replay};
