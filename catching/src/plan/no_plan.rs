//! Reasons for the failure of a plan.

/// Reason why there is no plan.
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
    #[error("obstacles are in the way of every catch that was found")]
    Obstructed,
    /// The time limit expired before a catch was found.
    #[error("time was up")]
    OutOfTime,
}

/// Reason why a request is invalid.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RequestError {
    /// A value is not finite.
    #[error("the request has numbers that are not finite")]
    NotFinite,
    /// A joint starts outside its range.
    #[error("joint {joint} begins at {found}, outside its range")]
    Range {
        /// Index of the joint.
        joint: usize,
        /// Joint angle, in rad.
        found: f64,
    },
    /// A joint starts above its maximum speed.
    #[error("joint {joint} begins with {found} rad/s, faster than it may be")]
    Speed {
        /// Index of the joint.
        joint: usize,
        /// Joint velocity, in rad/s.
        found: f64,
    },
    /// The catch times are out of range.
    #[error(
        "the catch is to be between {earliest} and {latest} s, expected 0 <= earliest < latest <= 2"
    )]
    Times {
        /// Earliest catch time, in s.
        earliest: f64,
        /// Latest catch time, in s.
        latest: f64,
    },
    /// The ball's speed or drag is out of range.
    #[error("the ball's velocity or drag makes no sense")]
    Ball,
}
