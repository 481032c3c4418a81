//! Stage of the catching stack: the simulated world in real time, and runs of all processes in it.
//!
//! ```text
//!            joint/command, hand/target
//! stack ───────────────────────────────> world ─ truth (inside the process) ─> painter ─ camera/left, camera/right ─> eyes
//!   ^                                      │  └─ flights, verdicts (inside the process) ─> judge ─ catch/outcome
//! └── joint/state, imu, ball/circles ────┘   balls that are thrown back: hand/open ─> world ─> judge ─ throw/outcome
//! ```
//!
//! The true state never leaves the process of the world. It is on no channel and in no shared memory, so the stack
//! cannot read it. The judge publishes the outcome after a throw.

mod drive_watch;
mod error;
mod hands;
mod held_report;
mod judge;
mod painter;
mod pairs;
pub mod recorded;
mod run;
mod run_recorder;
mod run_report;
mod throw_report;
mod world_role;
mod world_settings;

pub use error::StageError;
pub use held_report::HeldReport;
pub use pairs::{CatchCounts, PairReport};
pub use run::{CatchRun, Feel, RunEvent};
pub use run_report::{RecordingReport, RunReport, cause};
pub use throw_report::{Misses, ThrowBackReport};
pub use world_role::{WorldReport, WorldRole};
pub use world_settings::{SlipAt, WorldSettings, material_of_grip};
