//! The controller of all joints: follows paths, brakes, goes back to where the robot waits.
//!
//! ```text
//! Ready ── a path ──> Following ── brake ──> Braking ──> Standing ── go back ──> GoingBack ──> Ready
//!   │                     └────────────────── go back (it stands) ─────────────────┘
//!   └──── a throw ──> Throwing ── brake, or it is over ─> Braking, Standing
//! ```
//!
//! A path is carried out only where it goes on from what the arm does anyway, and within ranges, speeds and accelerations: whoever sends
//! it, and whatever was lost on the way, the commands to the drives stay smooth. The way back is the way that it came, backwards and
//! at most half as fast, so that it passes nothing that it has not passed before.

mod controller;
mod throwing;
mod trail;

pub use controller::{Controller, PathError};
pub use trail::Trail;
