//! Training sweeps set aside for calibration.

use tactnet_data::{Fold, ValidationSplit};

use crate::{CalibrationTarget, PipelineError};

/// Fold for fitting, and the training sweeps set aside for calibration with their rates, if any.
pub(super) type SetAside<'a> = (Fold<'a>, Option<(CalibrationTarget, ValidationSplit<'a>)>);

/// Sets sweeps aside for calibration.
pub(super) fn set_aside<'a>(
    fold: &Fold<'a>,
    target: Option<CalibrationTarget>,
) -> Result<SetAside<'a>, PipelineError> {
    match target {
        None => Ok((fold.clone(), None)),
        Some(target) => {
            let (fitted, aside) = fold.set_aside()?;
            Ok((fitted, Some((target, aside))))
        }
    }
}
