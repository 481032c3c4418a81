//! Errors of the world.

use tactnet_catching_packets::Numbers;

/// Error of the settings or the use of a world.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// A setting is out of range.
    #[error("`{setting}`: expected {expected}, found {found}")]
    Setting {
        /// Name of the setting, including its table.
        setting: &'static str,
        /// Expected values.
        expected: &'static str,
        /// Value found.
        found: String,
    },
    /// A joint starts out of range.
    #[error("joint {joint} starts at {found}, expected {low} to {high}")]
    Start {
        /// Number of the joint.
        joint: usize,
        /// Start position, in rad or m.
        found: f64,
        /// Minimum position, in rad or m.
        low: f64,
        /// Maximum position, in rad or m.
        high: f64,
    },
    /// No throw reaches a corner of the target box, not even the fastest from the minimum distance.
    #[error(
        "`thrower.box`: its corner {corner:?} is out of reach, even at {speed} m/s from {distance} m"
    )]
    OutOfThrow {
        /// Corner, in m.
        corner: [f64; 3],
        /// Maximum of `thrower.speed`, in m/s.
        speed: f64,
        /// Minimum of `thrower.distance`, in m.
        distance: f64,
    },
    /// A hand cannot take another ball.
    #[error("hand {arm} holds a ball, expected nothing")]
    Hand {
        /// Arm, 0 for left and 1 for right.
        arm: usize,
    },
    /// Unknown arm.
    #[error("there is no arm {arm}, expected 0 (left) or 1 (right)")]
    Arm {
        /// Number of the arm.
        arm: usize,
    },
    /// The torso springs are too weak for the weight of the robot.
    #[error("`torso.frequencies`: springs of {frequencies:?} Hz do not carry the robot")]
    Collapses {
        /// Frequencies in the settings, in Hz.
        frequencies: [f64; 3],
    },
}

/// Returns an error unless all numbers are at least 0.
pub(crate) fn not_negative(setting: &'static str, value: &impl Numbers) -> Result<(), WorldError> {
    from_to([0.0, f64::MAX], "a number, 0 or greater")(setting, value)
}

/// Returns an error unless all numbers are greater than 0.
pub(crate) fn positive(setting: &'static str, value: &impl Numbers) -> Result<(), WorldError> {
    from_to([f64::MIN_POSITIVE, f64::MAX], "a number greater than 0")(setting, value)
}

/// Returns an error unless the value is a probability.
pub(crate) fn probability(setting: &'static str, value: &f64) -> Result<(), WorldError> {
    from_to([0.0, 1.0], "a number from 0 to 1")(setting, value)
}

/// Returns a check that all numbers are within `limits`, including both ends.
pub(crate) fn from_to<T: Numbers>(
    limits: [f64; 2],
    expected: &'static str,
) -> impl Fn(&'static str, &T) -> Result<(), WorldError> {
    move |setting, value| {
        let mut numbers = value.numbers();
        numbers.try_for_each(|number| within(setting, number, limits, expected))
    }
}

/// Returns a check for `[minimum, maximum]` with both values at least `least`.
pub(crate) fn rising(
    least: f64,
    expected: &'static str,
) -> impl Fn(&'static str, &[f64; 2]) -> Result<(), WorldError> {
    move |setting, value| range(setting, *value, least, expected)
}

/// Returns an error unless `value` is within `limits`, including both ends.
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

/// Returns an error unless `range` is `[minimum, maximum]` with both values at least `least`; they may be equal.
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
