//! Measured quantities, their units, and single measurements.

use std::fmt;

use serde::{Deserialize, Serialize};
use tactnet_pipeline::PredictionMethod;

/// A quantity that a task measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Measure {
    /// Share of correct decisions.
    #[serde(rename = "accuracy")]
    Accuracy,
    /// Mean of the materials' shares of correct decisions.
    #[serde(rename = "balanced accuracy")]
    BalancedAccuracy,
    /// Share of correct decisions by majority vote over several sweeps.
    #[serde(rename = "accuracy, vote")]
    VoteAccuracy,
    /// Mean negative log-likelihood of the true material.
    #[serde(rename = "negative log-likelihood")]
    NegativeLogLikelihood,
    /// Mean gap between confidence and accuracy over 15 bins.
    #[serde(rename = "expected calibration error")]
    ExpectedCalibrationError,
    /// Squared distance between scores and truth, summed over materials, 0 to 2.
    #[serde(rename = "brier")]
    Brier,
    /// Time spent in training steps or in fitting.
    #[serde(rename = "train seconds")]
    TrainSeconds,
    /// Millions of multiply-adds of one prediction without dropout.
    #[serde(rename = "multiply-adds")]
    MultiplyAdds,
    /// Area under the ROC curve.
    #[serde(rename = "auroc")]
    Auroc,
    /// Share of sweeps of known materials that are classified as unknown.
    #[serde(rename = "false alarms")]
    FalseAlarms,
    /// Share of sweeps of unknown materials that are classified as unknown.
    #[serde(rename = "detected")]
    Detected,
    /// Share of sweeps whose material is in the prediction set.
    #[serde(rename = "coverage")]
    Coverage,
    /// Mean number of materials in a prediction set.
    #[serde(rename = "set size")]
    SetSize,
    /// Mean number of sweeps for each decision.
    #[serde(rename = "mean sweeps")]
    MeanSweeps,
    /// Share of a sweep's nearest neighbours with the same material.
    #[serde(rename = "purity")]
    Purity,
    /// Accuracy on an enrolled material.
    #[serde(rename = "new material")]
    NewMaterial,
    /// Accuracy on the known materials before an enrolment.
    #[serde(rename = "known, before")]
    KnownBefore,
    /// Accuracy on the known materials after an enrolment.
    #[serde(rename = "known, after")]
    KnownAfter,
    /// Loss of accuracy on the known materials, before minus after.
    #[serde(rename = "known, lost")]
    KnownLost,
}

/// The unit of a measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// A share, 0 to 1; shown in percent, with intervals clamped to 0 and 1.
    Share,
    /// A difference of shares; shown in percent.
    ShareDifference,
    /// Natural logarithms.
    Nats,
    /// Seconds.
    Seconds,
    /// A squared distance without a unit.
    Squared,
    /// A number of materials.
    Materials,
    /// A number of sweeps.
    Sweeps,
    /// Millions of arithmetic operations.
    Operations,
}

impl Unit {
    /// Returns true if numbers are shown in percent.
    pub fn in_percent(self) -> bool {
        matches!(self, Self::Share | Self::ShareDifference)
    }
}

impl Measure {
    /// Returns the name in result files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Accuracy => "accuracy",
            Self::BalancedAccuracy => "balanced accuracy",
            Self::VoteAccuracy => "accuracy, vote",
            Self::NegativeLogLikelihood => "negative log-likelihood",
            Self::ExpectedCalibrationError => "expected calibration error",
            Self::Brier => "brier",
            Self::TrainSeconds => "train seconds",
            Self::MultiplyAdds => "multiply-adds",
            Self::Auroc => "auroc",
            Self::FalseAlarms => "false alarms",
            Self::Detected => "detected",
            Self::Coverage => "coverage",
            Self::SetSize => "set size",
            Self::MeanSweeps => "mean sweeps",
            Self::Purity => "purity",
            Self::NewMaterial => "new material",
            Self::KnownBefore => "known, before",
            Self::KnownAfter => "known, after",
            Self::KnownLost => "known, lost",
        }
    }

    /// Returns the unit.
    pub fn unit(self) -> Unit {
        match self {
            Self::Accuracy
            | Self::BalancedAccuracy
            | Self::VoteAccuracy
            | Self::Auroc
            | Self::FalseAlarms
            | Self::Detected
            | Self::Coverage
            | Self::Purity
            | Self::NewMaterial
            | Self::KnownBefore
            | Self::KnownAfter => Unit::Share,
            Self::ExpectedCalibrationError | Self::KnownLost => Unit::ShareDifference,
            Self::NegativeLogLikelihood => Unit::Nats,
            Self::TrainSeconds => Unit::Seconds,
            Self::MultiplyAdds => Unit::Operations,
            Self::Brier => Unit::Squared,
            Self::SetSize => Unit::Materials,
            Self::MeanSweeps => Unit::Sweeps,
        }
    }
}

impl fmt::Display for Measure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// One number that a task measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measurement {
    /// Measured quantity.
    pub measure: Measure,
    /// Name of the method.
    pub method: String,
    /// Condition of the measurement, such as `hard pairs`; empty if there is only one.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub setting: String,
    /// Support sweeps of each new material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shots: Option<usize>,
    /// Sweeps for each decision.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sweeps: Option<usize>,
    /// Measured value, in the measure's unit.
    pub value: f64,
    /// Number of decisions.
    pub decisions: usize,
}

impl Measurement {
    /// Returns a measurement without shots, sweeps or setting.
    pub(crate) fn new(measure: Measure, method: &str, value: f64, decisions: usize) -> Self {
        Self {
            measure,
            method: method.into(),
            setting: String::new(),
            shots: None,
            sweeps: None,
            value,
            decisions,
        }
    }

    pub(crate) fn setting(self, setting: impl Into<String>) -> Self {
        Self {
            setting: setting.into(),
            ..self
        }
    }

    pub(crate) fn shots(self, shots: usize) -> Self {
        Self {
            shots: Some(shots),
            ..self
        }
    }

    pub(crate) fn sweeps(self, sweeps: usize) -> Self {
        Self {
            sweeps: Some(sweeps),
            ..self
        }
    }
}

/// Returns the display name of a method, such as the title of `plain`.
pub fn method_name(method: &str) -> &str {
    let dropout = PredictionMethod::McDropout { mc_samples: 1 };
    let ways = [PredictionMethod::Plain, dropout];
    let way = ways.into_iter().find(|way| way.name() == method);
    match way {
        Some(way) => way.title(),
        None => method,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_and_people_read_the_same_names() {
        for measure in [
            Measure::Accuracy,
            Measure::NegativeLogLikelihood,
            Measure::ExpectedCalibrationError,
            Measure::Brier,
            Measure::TrainSeconds,
            Measure::MultiplyAdds,
            Measure::Auroc,
            Measure::FalseAlarms,
            Measure::Detected,
            Measure::Coverage,
            Measure::SetSize,
            Measure::MeanSweeps,
            Measure::Purity,
            Measure::NewMaterial,
            Measure::KnownBefore,
            Measure::KnownAfter,
            Measure::KnownLost,
        ] {
            assert_eq!(
                serde_json::to_value(measure).unwrap(),
                measure.name(),
                "{measure:?}"
            );
        }
    }
}
