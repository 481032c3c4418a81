//! Target values of the twin's figures.

use serde::{Deserialize, Serialize};

use super::statistics::{REAL, SignalStatistics, TOLERANCE};
use crate::DataError;

/// Record of `experiments/twin/calibrate.py record`.
const RECORDED: &str = include_str!("trained_targets.json");

/// Figure of the twin and its target, which is published or was measured on real sweeps.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Target {
    /// Name of the figure, with its unit.
    pub name: String,
    /// Value on the twin; `None` if it is NaN.
    pub value: Option<f64>,
    /// Value on TactMat, or the calibration's goal if none is published.
    pub target: f64,
    /// Maximum difference between value and target.
    pub tolerance: f64,
    /// True if the difference is within the tolerance.
    pub met: bool,
    /// Source of the value.
    pub source: TargetSource,
}

/// Source of a figure's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TargetSource {
    /// Measured on the given sweeps.
    Measured,
    /// Recorded by `experiments/twin/calibrate.py`, which trained classifiers on several seeds of the default twin.
    Recorded,
}

/// The record of the calibration's last command.
#[derive(Deserialize)]
struct Record {
    /// Checksums of the twins that were trained on, the default one first.
    data_sha256: Vec<String>,
    targets: Vec<Trained>,
}

/// Figure of trained classifiers.
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

    /// Returns the figures of the signal with those of the four published sweeps as targets.
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

    /// Returns the recorded figures of classifiers that were trained on the twin with this checksum; empty for another
    /// data set.
    ///
    /// # Errors
    /// A record that cannot be parsed.
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

    /// Returns the names of the missed targets.
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
