//! What the twin must agree with, and whether it does.

use serde::{Deserialize, Serialize};

use super::statistics::{REAL, SignalStatistics, TOLERANCE};
use crate::DataError;

/// What `experiments/twin/calibrate.py record` found.
const RECORDED: &str = include_str!("trained_targets.json");

/// One figure beside what is published or was measured on real sweeps.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Target {
    /// What is measured, with its unit.
    pub name: String,
    /// On the twin; `None` if it is not a number.
    pub value: Option<f64>,
    /// On TactMat; where that is not published, what was aimed at.
    pub target: f64,
    /// How far the two may be apart.
    pub tolerance: f64,
    /// Whether they are no farther apart.
    pub met: bool,
    /// Where the value comes from.
    pub source: TargetSource,
}

/// Where a target's value comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TargetSource {
    /// The sweeps at hand, just now.
    Measured,
    /// Classifiers that `experiments/twin/calibrate.py` trained on several seeds of the default twin.
    Recorded,
}

/// The record of the calibration's last command.
#[derive(Deserialize)]
struct Record {
    /// Of the twins that were trained on, the default one first.
    data_sha256: Vec<String>,
    targets: Vec<Trained>,
}

/// A figure of trained classifiers.
#[derive(Deserialize)]
struct Trained {
    name: String,
    value: f64,
    target: f64,
    tolerance: f64,
}

impl Target {
    fn new(name: &str, value: f64, target: f64, tolerance: f64) -> Self {
        Self {
            name: name.into(),
            value: value.is_finite().then_some(value),
            target,
            tolerance,
            met: (value - target).abs() <= tolerance,
            source: TargetSource::Measured,
        }
    }

    /// Returns the signal's figures beside those of the four published sweeps.
    pub fn of_signal(measured: &SignalStatistics) -> Vec<Self> {
        measured
            .figures()
            .into_iter()
            .zip(REAL.figures())
            .zip(TOLERANCE.figures())
            .map(|(((name, value), (_, target)), (_, tolerance))| {
                Self::new(name, value, target, tolerance)
            })
            .collect()
    }

    /// Returns the recorded figures of classifiers that were trained on the twin with this checksum; none if they were trained on another.
    ///
    /// # Errors
    /// A record that cannot be read.
    pub fn of_training(data_sha256: &str) -> Result<Vec<Self>, DataError> {
        Self::in_record(RECORDED, data_sha256)
    }

    fn in_record(record: &str, data_sha256: &str) -> Result<Vec<Self>, DataError> {
        let record: Record = serde_json::from_str(record).map_err(|error| {
            DataError::inconsistent("trained targets", "a record", error.to_string())
        })?;
        if !record.data_sha256.iter().any(|sha| sha == data_sha256) {
            return Ok(Vec::new());
        }
        let targets = record.targets.into_iter().map(|trained| Self {
            source: TargetSource::Recorded,
            ..Self::new(
                &trained.name,
                trained.value,
                trained.target,
                trained.tolerance,
            )
        });
        Ok(targets.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::statistics::measure;
    use super::super::{TwinConfig, generate};
    use super::*;

    /// Returns the names of the targets that are missed.
    fn missed(measured: &SignalStatistics) -> Vec<String> {
        let targets = Target::of_signal(measured).into_iter();
        targets
            .filter(|target| !target.met)
            .map(|target| target.name)
            .collect()
    }

    #[test]
    fn the_default_twin_meets_its_targets() {
        let twin = generate(&TwinConfig::default()).unwrap();
        assert_eq!(missed(&measure(&twin)), Vec::<String>::new());
        let trained = Target::of_training(twin.sha256()).unwrap();
        assert_eq!(trained.len(), 7, "recorded on another twin: {trained:?}");
    }

    /// Figures that were recorded on another twin are not returned for this one.
    #[test]
    fn recorded_figures_are_those_of_their_own_twin() {
        let record = r#"{"data_sha256": ["a", "b"], "targets": [
            {"name": "base", "value": 0.86, "target": 0.855, "tolerance": 0.015},
            {"name": "fused", "value": 0.97, "target": 0.943, "tolerance": 0.015}]}"#;
        for sha in ["a", "b"] {
            let recorded = Target::in_record(record, sha).unwrap();
            assert!(recorded.iter().all(|t| t.source == TargetSource::Recorded));
            let met: Vec<bool> = recorded.iter().map(|target| target.met).collect();
            assert_eq!(met, [true, false]);
        }
        assert!(Target::in_record(record, "another").unwrap().is_empty());
        assert!(Target::of_training("another").unwrap().is_empty());
    }

    #[test]
    fn a_figure_outside_the_tolerance_is_missed() {
        assert_eq!(missed(&REAL), Vec::<String>::new());
        let loud = SignalStatistics {
            mean: 10.0,
            spectral_slope: f64::NAN,
            ..REAL
        };
        assert_eq!(missed(&loud).len(), 2, "{:?}", missed(&loud));
    }
}
