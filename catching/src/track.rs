//! Ball tracking (thesis, section 3.4.1): unscented Kalman filters in a multiple hypothesis tracker.
//!
//! ```text
//! circles of both cameras, head pose ─> BallTracker ─> up to two balls: position, velocity, drag, covariance, existence
//! ```
//!
//! A circle is a tracked ball, a new ball, or clutter. A hypothesis assigns one of these to each circle so far (Cox and
//! Hingorani 1996); a [filter](BallState) for each of its balls gives its probability. The two pictures of a pair are
//! processed one after the other. First, left circles are assigned to tracks or left over. Then, right circles are
//! assigned to tracks, left over, or paired with a left-over left circle, which creates a track. Each assignment
//! therefore has only two sides, and the k best ones are computed exactly ([`murty`]).
//!
//! Estimates refer to the true inertial frame. Covariances include the head's error as consider states (`ukf.rs`),
//! because it is the same in all pictures except for its drift.

mod birth;
mod camera;
mod config;
mod head;
mod mht;
pub mod murty;
mod pair_tracker;
mod tracker;
mod triangular;
mod ukf;

pub use camera::{CAMERAS, Camera, View};
pub use config::{CLUTTER_OF_PICTURES, ThrowPrior, TrackConfig, TrackError};
pub use head::Head;
pub use pair_tracker::PairTracker;
pub use tracker::BallTracker;
pub use ukf::{BallState, STATES, Sight};
