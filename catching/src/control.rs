//! Controller of all joints. It follows paths, brakes, and returns to the waiting pose.
//!
//! ```text
//! Ready ── path ──> Following ── brake ──> Braking ──> Standing ── go back ──> GoingBack ──> Ready
//!   │                     └────────────────── go back (at rest) ───────────────────┘
//!   └──── throw ──> Throwing ── brake, or end of throw ─> Braking, Standing
//! ```
//!
//! The controller accepts a path only if it continues the current motion within ranges, speeds and accelerations.
//! Commands to the drives therefore stay smooth, whatever is sent or lost. The way back retraces the path that led to
//! the current pose at no more than half the speed, so it passes only positions that were passed before.

mod control_loop;
mod controller;
mod throwing;
mod trail;

pub use control_loop::{ControlConfig, ControlInputs, ControlLoop, ControlOutputs};
pub use controller::{Controller, PathError};
