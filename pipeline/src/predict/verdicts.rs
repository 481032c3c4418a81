//! Rates of a calibrated classifier on sweeps of known and unknown materials, compared with their targets.

use serde::Serialize;
use tactnet_data::SweepView;

use crate::{CalibrationTarget, Classifier, Estimate, PipelineError, UnknownDetector};

/// Measured rates of a calibrated classifier, with their targets.
#[derive(Debug, Clone, Serialize)]
pub struct Verdicts {
    /// Target rates of the thresholds.
    pub target: CalibrationTarget,
    /// Share of sweeps of known materials that are called unknown.
    pub false_alarms: Option<Estimate>,
    /// Share of sweeps of known materials whose material is in the prediction set.
    pub coverage: Option<Estimate>,
    /// Mean size of a prediction set over sweeps of known materials.
    pub set_size: Option<f64>,
    /// Materials of the data set that the classifier does not know.
    pub unknown_materials: Vec<String>,
    /// Share of sweeps of unknown materials that are called unknown.
    pub detected: Option<Estimate>,
    /// Warning if the rates may differ much from their targets.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub caution: Option<String>,
}

impl Verdicts {
    /// Measures the rates.
    ///
    /// - `known`, `unknown`: sweeps of known and of unknown materials; see [`Classifier::by_known_material`]
    ///
    /// # Errors
    /// Sweeps of another shape or rate.
    pub fn of(
        detector: &UnknownDetector,
        classifier: &Classifier,
        known: &SweepView<'_>,
        unknown: &SweepView<'_>,
    ) -> Result<Self, PipelineError> {
        let calibration = &detector.calibration;
        let inside = detector.assess(classifier, known)?;
        let outside = detector.assess(classifier, unknown)?;
        let share = |of: usize, all: usize| {
            (all > 0).then(|| Estimate::wilson(of as f64 / all as f64, all))
        };
        let own: Vec<&str> = classifier.config().labels.names().collect();
        let labels = known.dataset().labels();
        let covered = inside.iter().enumerate().filter(|(position, verdict)| {
            let name = labels.name(known.label(*position));
            verdict.set.iter().any(|label| own[*label] == name)
        });
        let covered = covered.count();
        let alarms = inside.iter().filter(|verdict| verdict.unknown).count();
        let detected = outside.iter().filter(|verdict| verdict.unknown).count();
        let sizes: usize = inside.iter().map(|verdict| verdict.set.len()).sum();
        let mut unknown_materials: Vec<String> = (0..unknown.len())
            .map(|position| labels.name(unknown.label(position)).to_string())
            .collect();
        unknown_materials.sort();
        unknown_materials.dedup();
        Ok(Self {
            target: calibration.target,
            false_alarms: share(alarms, inside.len()),
            coverage: share(covered, inside.len()),
            set_size: (!inside.is_empty()).then(|| sizes as f64 / inside.len() as f64),
            unknown_materials,
            detected: share(detected, outside.len()),
            caution: calibration.caution(),
        })
    }
}
