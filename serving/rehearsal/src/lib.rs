//! Stand-ins for a robot that nobody has at hand: a simulated skin, the load of the catching stack, the soak test that runs all of it beside
//! the classifier, and the stress test of the channels.
//!
//! None of it is needed where a robot is. Programs that run beside this one are [`ChildProcess`]es of the `tactnet` command.

mod catching;
mod child_process;
mod company;
mod demo;
mod error;
mod held_skin;
mod own_bus;
mod play_cycle;
mod play_order;
mod put_numbered;
mod replay_alone;
mod skin;
mod skin_driver;
mod small_network;
mod soak;
mod stack;
pub mod stress;
mod write_table;

pub use catching::{CatchingReport, CatchingRole, Trip, catching_table, run_role};
pub use child_process::ChildProcess;
pub use company::Company;
pub use demo::Demo;
pub use error::RehearsalError;
pub use held_skin::HeldSkin;
pub use own_bus::{OwnBus, own_bus_name};
pub use play_cycle::PlayCycle;
pub use play_order::play_order;
pub use put_numbered::put_numbered;
pub use replay_alone::replay_alone;
pub use skin::{SkinSimulator, SkinStep, rest_frames};
pub use skin_driver::SkinDriver;
pub use small_network::{SMALL_MATERIALS, SMALL_SWEEPS, make_twin, train_small_network};
pub use soak::{Played, Soak, SoakReport};
pub use stack::{CatchingStack, LoopTimes, Scheduling, trips};
