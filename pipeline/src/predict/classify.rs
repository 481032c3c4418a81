//! Predicted materials of unlabelled sweeps.

use std::fmt::Write as _;

use serde::Serialize;
use tactnet_data::format::SweepsToClassify;
use tactnet_data::{LabelSet, SweepView, spreadsheet_cell};
use tactnet_models::{Belief, argmax};

use crate::{
    Classifier, Likeness, LikenessReport, PipelineError, PredictionMethod, UnknownDetector,
};

/// Predictions for some sweeps.
#[derive(Debug, Clone, Serialize)]
pub struct ClassifiedSweeps {
    /// Version of this layout.
    pub schema_version: u32,
    /// Name of the data set.
    pub data: String,
    /// Prediction method.
    pub method: PredictionMethod,
    /// Names of the materials, in the order of the probabilities.
    pub materials: LabelSet,
    /// One entry per sweep, in the order of the file.
    pub sweeps: Vec<ClassifiedSweep>,
    /// Prediction for all sweeps as those of one object.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub object: Option<ClassifiedObject>,
    /// Comparison with the training sweeps; absent for runs with few training sweeps or of earlier versions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub likeness: Option<LikenessReport>,
    /// Masked taxels.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub dead_taxels: Vec<usize>,
    /// Warning about the range of the values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub caution: Option<String>,
}

/// Prediction for one sweep.
#[derive(Debug, Clone, Serialize)]
pub struct ClassifiedSweep {
    /// Number or name of the sweep, or name of its file.
    pub sweep: String,
    /// Most probable material.
    pub material: String,
    /// Posterior probabilities from equal priors, `[materials]`.
    pub probabilities: Vec<f64>,
    /// True if the material is probably unknown; absent without a calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unknown: Option<bool>,
    /// Plausible materials at the calibrated coverage; absent without a calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prediction_set: Option<Vec<String>>,
    /// Material that the file names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub named: Option<String>,
    /// True if no taxel changes. No contact produces such a sweep, so its prediction is meaningless.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub still: bool,
}

/// Prediction for several sweeps of one object.
#[derive(Debug, Clone, Serialize)]
pub struct ClassifiedObject {
    /// Number of sweeps.
    pub sweeps: usize,
    /// Most probable material.
    pub material: String,
    /// Posterior probabilities of all sweeps together, by Bayes's rule from equal priors, `[materials]`.
    pub probabilities: Vec<f64>,
    /// True if the material is probably unknown; absent without a calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unknown: Option<bool>,
}

impl ClassifiedSweeps {
    /// Classifies every sweep.
    ///
    /// - `detector`: thresholds, if the classifier is calibrated
    /// - `likeness`: description of the training sweeps
    /// - `one_object`: true if all sweeps are of the same object
    ///
    /// # Errors
    /// Sweeps of another shape or rate; Monte Carlo dropout of a model without dropout.
    pub fn of(
        sweeps: &SweepsToClassify,
        classifier: &Classifier,
        detector: Option<&UnknownDetector>,
        likeness: Option<&Likeness>,
        method: PredictionMethod,
        one_object: bool,
    ) -> Result<Self, PipelineError> {
        let config = classifier.config();
        let view = SweepView::all(&sweeps.dataset);
        let rows = classifier.log_probabilities(&view, method)?;
        let verdicts = detector
            .map(|detector| detector.assess(classifier, &view))
            .transpose()?;
        let name = |label: usize| config.labels.name(label).to_string();
        let still = sweeps.still();
        let entry = |(position, row): (usize, &Vec<f64>)| {
            let verdict = verdicts.as_ref().map(|verdicts| &verdicts[position]);
            ClassifiedSweep {
                sweep: sweeps.names[position].clone(),
                material: name(argmax(row)),
                probabilities: row.iter().map(|log_p| log_p.exp()).collect(),
                unknown: verdict.map(|verdict| verdict.unknown),
                prediction_set: verdict
                    .map(|verdict| verdict.set.iter().map(|label| name(*label)).collect()),
                named: sweeps
                    .labelled
                    .then(|| sweeps.dataset.labels().name(view.label(position)).into()),
                still: still[position],
            }
        };
        let object = one_object.then(|| {
            let mut belief = Belief::flat(config.labels.len());
            rows.iter().for_each(|row| belief.fuse(row));
            let strangeness = verdicts.iter().flatten().map(|verdict| verdict.strangeness);
            let mean = strangeness.sum::<f64>() / rows.len() as f64;
            ClassifiedObject {
                sweeps: rows.len(),
                material: name(belief.label()),
                probabilities: belief.probabilities(),
                unknown: detector.and_then(|of| of.calibration.object_is_unknown(mean, rows.len())),
            }
        });
        Ok(Self {
            schema_version: 1,
            data: sweeps.dataset.name().into(),
            method,
            materials: config.labels.clone(),
            sweeps: rows.iter().enumerate().map(entry).collect(),
            object,
            likeness: likeness.map(|likeness| likeness.assess(&view, config.seed)),
            dead_taxels: classifier.dead().0.keys().copied().collect(),
            caution: config.values.and_then(|known| known.caution(&view)),
        })
    }

    /// Returns the material that the file names for all sweeps; `None` if it names none or several.
    pub(crate) fn only_name(&self) -> Option<&str> {
        let mut named = self.sweeps.iter().map(|sweep| sweep.named.as_deref());
        let first = named.next()??;
        named.all(|name| name == Some(first)).then_some(first)
    }

    /// Returns a CSV table with a line for each sweep and a column for the probability of each material. A name that begins
    /// like a formula of a spreadsheet is preceded by an apostrophe.
    pub fn to_csv(&self) -> String {
        let mut csv = String::from("sweep,material,unknown,prediction_set,named");
        for material in self.materials.names() {
            csv.push(',');
            csv.push_str(&spreadsheet_cell(&format!("p({material})")));
        }
        csv.push('\n');
        for sweep in &self.sweeps {
            let unknown = sweep.unknown.map_or("", |unknown| match unknown {
                true => "1",
                false => "0",
            });
            let set = sweep.prediction_set.as_ref().map(|set| set.join(" | "));
            let fields = [
                sweep.sweep.as_str(),
                sweep.material.as_str(),
                unknown,
                &set.unwrap_or_default(),
                sweep.named.as_deref().unwrap_or_default(),
            ];
            csv.push_str(&fields.map(spreadsheet_cell).join(","));
            for probability in &sweep.probabilities {
                // Six decimal places, or three significant digits for values that these would round to zero.
                let _ = match probability {
                    tiny if *tiny > 0.0 && *tiny < 1e-4 => write!(csv, ",{tiny:.2e}"),
                    probability => write!(csv, ",{probability:.6}"),
                };
            }
            csv.push('\n');
        }
        csv
    }
}
