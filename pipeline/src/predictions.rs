//! One row per predicted sweep, and the tsml text layout that aeon and tsml-eval read.

use std::fmt::Write;

use tactnet_data::LabelSet;
use tactnet_models::first_largest;

use crate::PredictionMethod;

/// The score of one sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepScore {
    /// Index of the sweep in its data set.
    pub index: usize,
    /// The true label.
    pub label: usize,
    /// `[materials]`, natural log of the predicted probabilities.
    pub log_probability: Vec<f64>,
}

impl SweepScore {
    /// The most probable label; the lowest among equals.
    pub fn predicted(&self) -> usize {
        first_largest(&self.log_probability)
    }
}

/// The scores of a test set.
#[derive(Debug, Clone, PartialEq)]
pub struct Predictions {
    /// Materials in label order.
    pub labels: LabelSet,
    /// How the probabilities were computed.
    pub method: PredictionMethod,
    /// One entry per sweep.
    pub sweeps: Vec<SweepScore>,
}

/// What the tsml header says about where predictions come from.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictionSource<'a> {
    /// Name of the data set.
    pub dataset: &'a str,
    /// Name of the classifier.
    pub classifier: &'a str,
    /// Number of the fold or resample.
    pub resample: usize,
    /// One line on how to reproduce them; commas and line ends become spaces.
    pub parameters: &'a str,
    /// Training time, milliseconds.
    pub train_millis: u64,
    /// Prediction time, milliseconds.
    pub test_millis: u64,
}

impl Predictions {
    /// Share of sweeps whose most probable label is the true one.
    pub fn accuracy(&self) -> f64 {
        let correct = self
            .sweeps
            .iter()
            .filter(|s| s.predicted() == s.label)
            .count();
        correct as f64 / self.sweeps.len().max(1) as f64
    }

    /// Counts `[true][predicted]`.
    pub fn confusion(&self) -> Vec<Vec<usize>> {
        let materials = self.labels.len();
        let mut counts = vec![vec![0; materials]; materials];
        for sweep in &self.sweeps {
            counts[sweep.label][sweep.predicted()] += 1;
        }
        counts
    }

    /// The tsml layout: three header lines, then `true,predicted,,p0,p1,…` for each sweep.
    ///
    /// Layout: aeon, `aeon.benchmarking.results_loaders`; tsml-eval, "Predictions and results file format".
    pub fn to_tsml(&self, source: &PredictionSource<'_>) -> String {
        let one_field = |text: &str| text.replace([',', '\n', '\r'], " ");
        let mut text = format!(
            "{},{},TEST,{},MILLISECONDS,sweep indices ascend in the split manifest's test list\n{}\n",
            one_field(source.dataset),
            one_field(source.classifier),
            source.resample,
            one_field(source.parameters),
        );
        let _ = writeln!(
            text,
            "{},{},{},-1,-1,{},,-1,-1",
            self.accuracy(),
            source.train_millis,
            source.test_millis,
            self.labels.len()
        );
        for sweep in &self.sweeps {
            let _ = write!(text, "{},{},", sweep.label, sweep.predicted());
            for log_probability in &sweep.log_probability {
                let _ = write!(text, ",{:e}", log_probability.exp());
            }
            text.push('\n');
        }
        text
    }
}
