//! Tactile channels in the Rerun viewer (<https://rerun.io>): live, from a recording, or the sweeps of a data set.
//!
//! | entity | content |
//! |---|---|
//! | `FINGER/heatmap` | `[rows, cols]` digits, 25 times a second |
//! | `FINGER/traces` | one line per taxel, every frame, digits |
//! | `FINGER/belief/bars/length`, `…/name` | the most likely materials of the newest belief |
//! | `FINGER/belief/posterior` | one line per material, every belief |
//! | `FINGER/belief/text` | the belief as text |
//! | `FINGER/latency/plain`, `…/dropout` | time from the last frame to the belief, ms |
//! | `events` | events of the classifier and the motion controller |
//!
//! `FINGER` is the id of its channel. All entities use the timeline `time`; frames also use `frame`, their sequence
//! number.

mod bars;
mod beliefs;
mod layout;
mod live;
mod motion;
mod scene;
mod show_channels;
mod show_sweeps;
mod skin;
mod target;

pub use live::LiveView;
pub use motion::{Ball, Capsule, Curves, Lines, Motion, Points, show_motion};
pub use scene::{Play, Scene, TimeOrigin};
pub use show_channels::{Viewed, show_channels, show_recording};
pub use show_sweeps::{first_sweeps, show_sweeps};
pub use skin::Stretch;
pub use target::Target;
