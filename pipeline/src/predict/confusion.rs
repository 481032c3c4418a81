//! Confusion matrix as data.

use serde::Serialize;

use crate::Predictions;

/// Confusion matrix.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Confusion {
    /// Names of the materials, in the order of rows and columns.
    pub materials: Vec<String>,
    /// Numbers of sweeps, `[true][predicted]`.
    pub counts: Vec<Vec<usize>>,
}

impl From<&Predictions> for Confusion {
    fn from(predictions: &Predictions) -> Self {
        Self {
            materials: predictions.labels.names().map(String::from).collect(),
            counts: predictions.confusion(),
        }
    }
}
