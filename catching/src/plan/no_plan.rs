//! Reasons for the failure of a plan.

/// Reason for a missing plan.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoPlan {
    /// The request is invalid.
    #[error("{0}")]
    Request(#[from] RequestError),
    /// The ball stays out of reach.
    #[error("the ball does not come within reach")]
    OutOfReach,
    /// The arm cannot arrive in time, or only outside its ranges or inside a body.
    #[error("no catch within ranges, speeds and accelerations")]
    NoCatch,
    /// All catches that were found come too close to obstacles of the map.
    #[error("obstacles block all catches that were found")]
    Obstructed,
    /// The time limit expired before a catch was found.
    #[error("the time limit expired before a catch was found")]
    OutOfTime,
}

/// Reason why a request is invalid.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RequestError {
    /// A value is not finite.
    #[error("the request has values that are not finite")]
    NotFinite,
    /// A joint starts outside its range.
    #[error("joint {joint} starts at {found} rad, outside its range")]
    Range {
        /// Index of the joint.
        joint: usize,
        /// Joint angle, in rad.
        found: f64,
    },
    /// A joint starts above its maximum speed.
    #[error("joint {joint} starts at {found} rad/s, above its maximum speed")]
    Speed {
        /// Index of the joint.
        joint: usize,
        /// Joint velocity, in rad/s.
        found: f64,
    },
    /// The catch times are out of range.
    #[error("expected catch times 0 <= earliest < latest <= 2 s, found {earliest} and {latest} s")]
    Times {
        /// Earliest catch time, in s.
        earliest: f64,
        /// Latest catch time, in s.
        latest: f64,
    },
    /// The ball's speed or drag is out of range.
    #[error("the ball's speed must be 0.1 to 100 m/s and its drag 0 to 1 1/m")]
    Ball,
}
