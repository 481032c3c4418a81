//! What can be wrong with a world that is asked for.

/// Why there is no such world.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// A setting out of range.
    #[error("`{setting}`: expected {expected}, found {found}")]
    Setting {
        /// Its name, with the table that it is in.
        setting: &'static str,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// A joint that does not start within its range.
    #[error("joint {joint} starts at {found}, expected {low} to {high}")]
    Start {
        /// Its number.
        joint: usize,
        /// Where it would start, rad or m.
        found: f64,
        /// Least position.
        low: f64,
        /// Greatest position.
        high: f64,
    },
    /// A corner of the box that no throw gets to, not even the fastest from the least distance.
    #[error(
        "`thrower.box`: its corner {corner:?} is out of reach, even at {speed} m/s from {distance} m"
    )]
    OutOfThrow {
        /// The corner, m.
        corner: [f64; 3],
        /// `thrower.speed`'s greatest, m/s.
        speed: f64,
        /// `thrower.distance`'s least, m.
        distance: f64,
    },
    /// A hand that is to let go of a ball, or to be given one.
    #[error("hand {arm} holds {found}, expected {expected}")]
    Hand {
        /// 0 left, 1 right.
        arm: usize,
        /// What must be in it.
        expected: &'static str,
        /// What is.
        found: &'static str,
    },
    /// An arm that there is not.
    #[error("there is no arm {arm}, expected 0 (left) or 1 (right)")]
    Arm {
        /// Its number.
        arm: usize,
    },
    /// Torso springs that give way under the robot's own weight.
    #[error("`torso.frequencies`: springs of {frequencies:?} Hz do not carry the robot")]
    Collapses {
        /// The setting, Hz.
        frequencies: [f64; 3],
    },
}

/// Returns an error unless `value` is at least 0.
pub(crate) fn not_negative(setting: &'static str, value: f64) -> Result<(), WorldError> {
    within(setting, value, [0.0, f64::MAX], "a number, 0 or greater")
}

/// Returns an error unless `value` is greater than 0.
pub(crate) fn positive(setting: &'static str, value: f64) -> Result<(), WorldError> {
    within(
        setting,
        value,
        [f64::MIN_POSITIVE, f64::MAX],
        "a number greater than 0",
    )
}

/// Returns an error unless `value` is a probability.
pub(crate) fn probability(setting: &'static str, value: f64) -> Result<(), WorldError> {
    within(setting, value, [0.0, 1.0], "a number from 0 to 1")
}

/// Returns an error unless `value` lies within `limits`, ends included.
pub(crate) fn within(
    setting: &'static str,
    value: f64,
    limits: [f64; 2],
    expected: &'static str,
) -> Result<(), WorldError> {
    if (limits[0]..=limits[1]).contains(&value) {
        return Ok(());
    }
    Err(WorldError::Setting {
        setting,
        expected,
        found: value.to_string(),
    })
}

/// Returns an error unless `range` is `[least, greatest]`, both at least `least`; they may be equal.
pub(crate) fn range(
    setting: &'static str,
    range: [f64; 2],
    least: f64,
    expected: &'static str,
) -> Result<(), WorldError> {
    let [low, high] = range;
    if low.is_finite() && high.is_finite() && least <= low && low <= high {
        return Ok(());
    }
    Err(WorldError::Setting {
        setting,
        expected,
        found: format!("{range:?}"),
    })
}
