//! Where balls are and how they fly (thesis, section 3.4.1): unscented Kalman filters in a multiple hypothesis tracker.
//!
//! ```text
//! circles of both cameras, head's pose ─> BallTracker ─> up to two balls: position, velocity, drag, covariance, existence
//! ```
//!
//! A picture's circles are balls that are tracked, balls that are new, or none at all. A hypothesis says of all circles so far which is
//! which (Cox and Hingorani 1996); a [filter](BallState) for each of its balls says how probable that is. Both pictures of a pair are
//! taken one after the other: the left circles are given to tracks or left over; then the right ones are given to tracks, left over, or
//! make a pair with a left one that is left over, from which a new track is born. So an assignment never has more than two sides, and the
//! k best ones are found exactly ([`murty`]).
//!
//! Estimates are in the inertial frame as it is, not as the head believes it to be: covariances hold the head's error, which is the
//! same in all pictures but for its drift, as consider states (`ukf.rs`).

mod birth;
mod camera;
mod config;
mod head;
mod mht;
pub mod murty;
#[cfg(test)]
mod throws;
mod tracker;
mod triangular;
mod ukf;

pub use camera::{CAMERAS, Camera, View};
pub use config::{CLUTTER_OF_PICTURES, ThrowPrior, TrackConfig, TrackError};
pub use head::Head;
pub use tracker::BallTracker;
pub use ukf::{BallState, STATES, Sight};
