//! Predictions with one row per sweep, and the tsml text format of aeon and tsml-eval.

use std::fmt::Write;

use tactnet_data::LabelSet;
use tactnet_models::argmax;

use crate::PredictionMethod;

/// Score of one sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepScore {
    /// Index of the sweep in its data set.
    pub index: usize,
    /// True label.
    pub label: usize,
    /// Natural logarithms of the predicted probabilities, `[materials]`.
    pub log_probability: Vec<f64>,
}

impl SweepScore {
    /// Returns the most probable label; the lowest among equals.
    pub fn predicted(&self) -> usize {
        argmax(&self.log_probability)
    }
}

/// Scores of a test set.
#[derive(Debug, Clone, PartialEq)]
pub struct Predictions {
    /// Materials in label order.
    pub labels: LabelSet,
    /// Prediction method.
    pub method: PredictionMethod,
    /// One entry per sweep.
    pub sweeps: Vec<SweepScore>,
}

/// Origin of predictions, for the tsml header.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictionSource<'a> {
    /// Name of the data set.
    pub dataset: &'a str,
    /// Name of the classifier.
    pub classifier: &'a str,
    /// Number of the fold or resample.
    pub resample: usize,
    /// One line that describes how to reproduce them; commas and line ends become spaces.
    pub parameters: &'a str,
}

impl Predictions {
    /// Returns the share of sweeps whose most probable label is the true one.
    pub fn accuracy(&self) -> f64 {
        let correct = self
            .sweeps
            .iter()
            .filter(|s| s.predicted() == s.label)
            .count();
        correct as f64 / self.sweeps.len().max(1) as f64
    }

    /// Returns the confusion matrix, `[true][predicted]`.
    pub fn confusion(&self) -> Vec<Vec<usize>> {
        let materials = self.labels.len();
        let mut counts = vec![vec![0; materials]; materials];
        for sweep in &self.sweeps {
            counts[sweep.label][sweep.predicted()] += 1;
        }
        counts
    }

    /// Returns the predictions in tsml format: three header lines, then `true,predicted,,p0,p1,…` for each sweep. Times are -1, so that equal
    /// predictions give equal files.
    ///
    /// Format: aeon, `aeon.benchmarking.results_loaders`; tsml-eval, "Predictions and results file format".
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
            "{},-1,-1,-1,-1,{},,-1,-1",
            self.accuracy(),
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

    /// Parses the text of [`Predictions::to_tsml`].
    ///
    /// - `indices`: indices of the sweeps in their data set, in the order of the rows (the split's `test` list)
    ///
    /// # Errors
    /// One line that names the mistake: another number of rows than `indices`, labels out of range, invalid numbers.
    pub fn from_tsml(
        text: &str,
        labels: LabelSet,
        method: PredictionMethod,
        indices: &[usize],
    ) -> Result<Self, String> {
        let rows: Vec<&str> = text
            .lines()
            .skip(3)
            .filter(|line| !line.is_empty())
            .collect();
        if rows.len() != indices.len() {
            return Err(format!(
                "expected {} predictions, found {}",
                indices.len(),
                rows.len()
            ));
        }
        let sweeps = rows
            .iter()
            .zip(indices)
            .enumerate()
            .map(|(number, (row, &index))| {
                let wrong = || {
                    format!(
                        "line {}: not a prediction of {} materials",
                        number + 4,
                        labels.len()
                    )
                };
                let mut fields = row.split(',');
                let label = fields.next().and_then(|field| field.parse::<usize>().ok());
                let label = label
                    .filter(|label| *label < labels.len())
                    .ok_or_else(wrong)?;
                let log_probability: Vec<f64> = fields
                    .skip(2)
                    .map(|field| field.parse::<f64>().map(f64::ln))
                    .collect::<Result<_, _>>()
                    .map_err(|_| wrong())?;
                if log_probability.len() != labels.len() {
                    return Err(wrong());
                }
                Ok(SweepScore {
                    index,
                    label,
                    log_probability,
                })
            })
            .collect::<Result<Vec<_>, String>>()?;
        Ok(Self {
            labels,
            method,
            sweeps,
        })
    }
}
