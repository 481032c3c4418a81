//! Two rows on the same folds, and what a data set gives away.

use serde::{Deserialize, Serialize};

/// Mean difference of two rows' single-sweep accuracy over the folds that both have.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Key of the first row.
    pub first: String,
    /// Key of the second row.
    pub second: String,
    /// First minus second, 0 to 1.
    pub difference: f64,
    /// Folds that both have.
    pub folds: usize,
    /// Corrected resampled t-test (Nadeau & Bengio, 2003); absent with one fold.
    pub p: Option<f64>,
}

/// What a data set gives away: the best model beside the probes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Audit {
    /// Name of the data set, with what happens to levels.
    pub data: String,
    /// Accuracy of guessing.
    pub chance: f64,
    /// Best contender on random folds, and its accuracy.
    pub best: Option<(String, f64)>,
    /// The same model with a recording block left out, where that was run.
    pub block_out: Option<f64>,
    /// Nearest neighbour on taxel means.
    pub means: Option<f64>,
    /// With permuted labels.
    pub permuted: Option<f64>,
    /// Standard deviation of guessing, given the number of test sweeps.
    pub chance_sigma: f64,
    /// Plain sentences on what the gaps mean.
    pub verdict: String,
}
