//! Validation of settings.

use crate::ModelError;

/// Returns an error that names `setting` unless `holds`.
pub(crate) fn require(
    holds: bool,
    setting: &'static str,
    expected: &str,
    found: String,
) -> Result<(), ModelError> {
    if holds {
        Ok(())
    } else {
        Err(ModelError::Setting {
            setting,
            expected: expected.into(),
            found,
        })
    }
}

/// Returns the product; `None` on overflow.
pub(crate) fn product(factors: &[usize]) -> Option<u64> {
    factors
        .iter()
        .try_fold(1u64, |all, factor| all.checked_mul(*factor as u64))
}
