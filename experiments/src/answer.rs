//! The answer to a question about one part of a data set.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::measure::Measurement;

/// The answer to a question about one part of a data set.
#[derive(Default)]
pub(crate) struct Answer {
    pub(crate) measurements: Vec<Measurement>,
    pub(crate) split: String,
    /// The text whose hash is `split_sha256`.
    pub(crate) split_content: String,
    pub(crate) chosen: BTreeMap<String, f64>,
    pub(crate) maps: Vec<FeatureMap>,
}

/// A two-dimensional embedding of sweeps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeatureMap {
    /// Choice of materials: `easy` or `hard`.
    pub choice: String,
    /// Embedded space: `input` or `embedding`.
    pub space: String,
    /// Names of the materials in label order.
    pub materials: Vec<String>,
    /// `[sweeps]`, label of each sweep.
    pub labels: Vec<usize>,
    /// `[sweeps]`, points by t-SNE (van der Maaten & Hinton, 2008).
    pub points: Vec<[f32; 2]>,
}
