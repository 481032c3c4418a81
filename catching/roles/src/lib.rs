//! The catching stack on a robot's channels (thesis, figure 3.2). Every part is a process that may stop and restart
//! at any time.
//!
//! ```text
//! camera/left, camera/right ─> eyes ─ ball/circles ─> tracker ─ ball/prediction ─> coordinator ─ plan/request ─> planner (left, right)
//! imu, joint/state ─> pose ─ head/pose ──────────────────┘            │    └─<─ plan/result ─┘
//!                                                                     ├─ arm/path, body/path, head/gaze ─> controller ─ joint/command ─> drives
//!                                                                     │                                       ^            │
//!                                                                     │                        safety/state ──┴── safety <─┘
//!                                                                     └─ hand/command ─> hand ─ hand/target, hand/open ─> hands
//! hand/state ─> thrower ─ throw/path ─> controller                                             ^
//!                  └──────────────────────────────────────── hand/release ─────────────────────┘
//! marker/features, joint/state ─> slip-watch ─ calibration/state ─> user interface
//! ```
//!
//! The algorithms are in `tactnet-catching`, which has neither clocks nor channels; this crate adds both. It does not
//! depend on the simulated world: a robot may as well send `joint/state`, `imu` and circles or pictures.

mod catch_times;
pub mod channels;
mod controller;
mod coordinator;
mod error;
mod eyes;
mod feel;
mod hand;
mod latest_value;
mod picture;
mod planner;
mod pose;
mod role;
mod safety;
mod settings;
mod slip_watch;
mod stage_view;
mod thrower;
mod times;
mod tracker;

pub use catch_times::CatchTimes;
pub use channels::{PICTURE_HEAD, catching_channels};
pub use coordinator::{CoordinatorShell, coordinator_shell};
pub use error::RoleError;
pub use latest_value::drain;
pub use picture::PictureHead;
pub use role::Role;
pub use settings::RoleSettings;
pub use stage_view::{Side, Stage, StageView};
pub use tactnet_channel::Milliseconds;
pub use times::{RoleReport, Times};
