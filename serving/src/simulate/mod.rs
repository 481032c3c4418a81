//! Components of a robot that nobody has at hand: the skin, and the load of the catching stack.

mod catching;
mod skin;
mod ticker;

pub use catching::{CatchingReport, CatchingRole, catching_table, run_role};
pub use skin::{SkinSimulator, SkinStep};
pub use ticker::Ticker;
