//! `adapted.json`: origin of an adapted classifier.

use serde::{Deserialize, Serialize};
use tactnet_data::SweepView;
use tactnet_models::Weights;

use super::{AdaptRisk, Adapted, NewSweeps, Presence, Shift};
use crate::predict::overlap::sweep_sha256;
use crate::{LeftOutMember, PipelineError, weights_sha256};

/// Origin of an adaptation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adaptation {
    /// Sweeps whose labels were not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unlabelled: Option<AdaptedSweeps>,
    /// Sweeps to which the output layer was fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub labelled: Option<AdaptedSweeps>,
    /// SHA-256 of the weights before the adaptation.
    pub weights_sha256: String,
    /// Numbers by which the adaptation is judged.
    pub presence: Presence,
    /// Shift of the taxels' values (networks) or of the features (baselines).
    pub shift: Shift,
    /// Warnings.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub risks: Vec<AdaptRisk>,
    /// Members of a committee that could not be adapted and were left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOutMember>,
    /// Commit of the program.
    pub git: String,
}

/// Sweeps that a classifier was adapted to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdaptedSweeps {
    /// Name of their data set.
    pub data: String,
    /// SHA-256 of that data set.
    pub data_sha256: String,
    /// SHA-256 of each sweep's values, which identifies it in other files.
    pub sweeps_sha256: Vec<String>,
}

impl AdaptedSweeps {
    fn of(sweeps: &SweepView<'_>) -> Self {
        let positions = 0..sweeps.len();
        Self {
            data: sweeps.dataset().name().into(),
            data_sha256: sweeps.dataset().sha256().into(),
            sweeps_sha256: positions.map(|at| sweep_sha256(sweeps, at)).collect(),
        }
    }
}

impl Adaptation {
    /// Returns the record of an adaptation to `new`.
    ///
    /// - `weights`: weights of the classifier before
    /// - `git`: commit of the program
    ///
    /// # Errors
    /// Weights that cannot be serialised; those of networks and baselines always can.
    pub fn new(
        adapted: &Adapted,
        new: NewSweeps<'_>,
        weights: &Weights,
        git: &str,
    ) -> Result<Self, PipelineError> {
        Ok(Self {
            unlabelled: new.unlabelled.map(AdaptedSweeps::of),
            labelled: new.labelled.map(AdaptedSweeps::of),
            weights_sha256: weights_sha256(weights)?,
            presence: adapted.presence.clone(),
            shift: adapted.shift,
            risks: adapted.risks.clone(),
            left_out: adapted.left_out.clone(),
            git: git.into(),
        })
    }
}
