//! Simulated stand-ins for a robot: a skin that plays recorded sweeps, the message load of a catching stack, and the
//! soak test that runs both beside the classifier.
//!
//! Production code does not depend on this crate. Other processes are [`ChildProcess`]es of the command-line program.

mod child_process;
mod company;
mod demo;
mod error;
#[cfg(feature = "catching")]
mod held_skin;
mod load;
mod play_cycle;
mod play_order;
#[cfg(feature = "recording")]
mod replay_alone;
mod skin;
mod skin_driver;
mod skin_fault;
mod small_network;
mod soak;
mod stack;
mod write_table;

pub use child_process::ChildProcess;
pub use company::Company;
pub use demo::Demo;
pub use error::SimulationError;
#[cfg(feature = "catching")]
pub use held_skin::HeldSkin;
pub use load::{LoadReport, LoadRole, Trip, load_table, run_role};
pub use play_cycle::PlayCycle;
pub use play_order::play_order;
#[cfg(feature = "recording")]
pub use replay_alone::replay_alone;
pub use skin::{SkinSimulator, SkinStep, rest_frames};
pub use skin_driver::SkinDriver;
pub use skin_fault::SkinFault;
pub use small_network::{SMALL_MATERIALS, SMALL_SWEEPS, make_twin, train_small_network};
pub use soak::{Played, Soak, SoakReport};
pub use stack::{CatchingLoad, LoopTimes, Scheduling, trips};
