//! Checks of settings, for [`settings!`](crate::settings): functions of the setting's name and its value.

use crate::Numbers;

/// A setting that is out of its range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("`{setting}`: expected {expected}, found {found}")]
pub struct SettingError {
    /// Name of the setting, including its table.
    pub setting: &'static str,
    /// Expected values.
    pub expected: &'static str,
    /// First invalid number.
    pub found: f64,
}

/// Returns an error unless all numbers of a setting satisfy a condition.
pub fn all(
    setting: &'static str,
    value: &impl Numbers,
    expected: &'static str,
    mut is_valid: impl FnMut(f64) -> bool,
) -> Result<(), SettingError> {
    match value.numbers().find(|number| !is_valid(*number)) {
        Some(found) => Err(SettingError {
            setting,
            expected,
            found,
        }),
        None => Ok(()),
    }
}

/// Returns an error unless all numbers are finite.
pub fn finite(setting: &'static str, value: &impl Numbers) -> Result<(), SettingError> {
    all(setting, value, "numbers", f64::is_finite)
}

/// Returns an error unless all numbers are at least 0.
pub fn not_negative(setting: &'static str, value: &impl Numbers) -> Result<(), SettingError> {
    from_to([0.0, f64::MAX], "a number, 0 or greater")(setting, value)
}

/// Returns an error unless all numbers are greater than 0.
pub fn positive(setting: &'static str, value: &impl Numbers) -> Result<(), SettingError> {
    from_to([f64::MIN_POSITIVE, f64::MAX], "a number greater than 0")(setting, value)
}

/// Returns an error unless the value is a probability.
pub fn probability(setting: &'static str, value: &f64) -> Result<(), SettingError> {
    from_to([0.0, 1.0], "a number from 0 to 1")(setting, value)
}

/// Returns a check that all numbers are within `limits`, including both ends.
pub fn from_to<T: Numbers>(
    [low, high]: [f64; 2],
    expected: &'static str,
) -> impl Fn(&'static str, &T) -> Result<(), SettingError> {
    move |setting, value| all(setting, value, expected, |x| (low..=high).contains(&x))
}

/// Returns a check for `[minimum, maximum]` with both values at least `least`; they may be equal.
pub fn rising(
    least: f64,
    expected: &'static str,
) -> impl Fn(&'static str, &[f64; 2]) -> Result<(), SettingError> {
    move |setting, value| {
        let mut before = least;
        all(setting, value, expected, |x| {
            let rises = x.is_finite() && before <= x;
            before = x;
            rises
        })
    }
}
