//! One row per predicted sweep, and the tsml text layout that aeon and tsml-eval read.

use std::fmt::Write;

use tactnet_data::LabelSet;
use tactnet_models::argmax;

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
        argmax(&self.log_probability)
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

    /// The tsml layout: three header lines, then `true,predicted,,p0,p1,…` for each sweep. Times are left out (-1), so that equal
    /// predictions are equal files.
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

    /// Reads what [`Predictions::to_tsml`] has written.
    ///
    /// - `indices`: of the sweeps in their data set, in the order of the rows (the split's `test` list)
    ///
    /// # Errors
    /// What is wrong, in one line: other rows than `indices`, labels out of range, text that is no number.
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
