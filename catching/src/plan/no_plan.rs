//! Why there is no plan.

/// Why there is no plan.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoPlan {
    /// The request makes no sense.
    #[error("{0}")]
    Request(#[from] RequestError),
    /// The ball stays out of reach.
    #[error("the ball does not come within reach")]
    OutOfReach,
    /// The arm cannot be there in time, or only outside its ranges or inside a body.
    #[error("no catch within ranges, speeds and accelerations")]
    NoCatch,
    /// There are catches, but all that were found come too near to what the map shows.
    #[error("obstacles are in the way of every catch that was found")]
    Obstructed,
    /// Time was up before anything was found.
    #[error("time was up")]
    OutOfTime,
}

/// What is wrong with a request.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RequestError {
    /// A number that is none.
    #[error("the request has numbers that are not finite")]
    NotFinite,
    /// A joint begins outside its range.
    #[error("joint {joint} begins at {found}, outside its range")]
    Range {
        /// Counted from 0.
        joint: usize,
        /// rad.
        found: f64,
    },
    /// A joint begins faster than it may be.
    #[error("joint {joint} begins with {found} rad/s, faster than it may be")]
    Speed {
        /// Counted from 0.
        joint: usize,
        /// rad/s.
        found: f64,
    },
    /// Not a moment in the future.
    #[error(
        "the catch is to be between {earliest} and {latest} s, expected 0 <= earliest < latest <= 2"
    )]
    Times {
        /// s.
        earliest: f64,
        /// s.
        latest: f64,
    },
    /// The ball does not fly, or its drag is negative.
    #[error("the ball's velocity or drag makes no sense")]
    Ball,
}
