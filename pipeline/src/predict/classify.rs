//! Predicted materials of unlabelled sweeps.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Write as _};

use serde::Serialize;
use tactnet_data::format::SweepsToClassify;
use tactnet_data::{LabelSet, SweepView};
use tactnet_models::{Belief, argmax};

use crate::{
    Calibration, Classifier, NoveltyScorer, PipelineError, PredictionMethod, TrainEmbeddings,
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
    /// - `calibration`: thresholds, with the embeddings of the training sweeps
    /// - `one_object`: true if all sweeps are of the same object
    ///
    /// # Errors
    /// Sweeps of another shape or rate; Monte Carlo dropout of a model without dropout.
    pub fn of(
        sweeps: &SweepsToClassify,
        classifier: &Classifier,
        calibration: Option<(&Calibration, &TrainEmbeddings)>,
        method: PredictionMethod,
        one_object: bool,
    ) -> Result<Self, PipelineError> {
        let config = classifier.config();
        let view = SweepView::all(&sweeps.dataset);
        let rows = classifier.log_probabilities(&view, method)?;
        let verdicts = match calibration {
            None => None,
            Some((calibration, embeddings)) => {
                let novelty = NoveltyScorer::fit(classifier, embeddings)?;
                Some(calibration.assess(&novelty, &classifier.embed(&view)?)?)
            }
        };
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
                unknown: calibration
                    .and_then(|(calibration, _)| calibration.object_is_unknown(mean, rows.len())),
            }
        });
        Ok(Self {
            schema_version: 1,
            data: sweeps.dataset.name().into(),
            method,
            materials: config.labels.clone(),
            sweeps: rows.iter().enumerate().map(entry).collect(),
            object,
            caution: config.values.and_then(|known| known.caution(&view)),
        })
    }

    /// Returns the material that the file names for all sweeps; `None` if it names none or several.
    pub(crate) fn only_name(&self) -> Option<&str> {
        let mut named = self.sweeps.iter().map(|sweep| sweep.named.as_deref());
        let first = named.next()??;
        named.all(|name| name == Some(first)).then_some(first)
    }

    /// Returns a warning that names the sweeps in which no taxel changes; `None` if there are none.
    pub fn still(&self) -> Option<String> {
        let still: BTreeSet<&str> = self
            .sweeps
            .iter()
            .filter(|sweep| sweep.still)
            .map(|sweep| sweep.sweep.as_str())
            .collect();
        (!still.is_empty()).then(|| {
            format!(
                "no taxel ever changes in sweep{} {}: what the classifier says there means nothing",
                if still.len() == 1 { "" } else { "s" },
                listed(&still)
            )
        })
    }

    /// Returns a warning if the file names several materials for sweeps that count as one object.
    pub fn not_one_object(&self) -> Option<String> {
        let named: BTreeSet<&str> = self
            .sweeps
            .iter()
            .filter_map(|sweep| sweep.named.as_deref())
            .collect();
        self.object.as_ref().filter(|_| named.len() > 1)?;
        Some(format!(
            "the file names {} materials for what `--one-object` says is one object: {}",
            named.len(),
            listed(&named)
        ))
    }

    /// Returns advice about sweeps of materials that the classifier does not know; `None` if the file names only known materials, or names none and
    /// the classifier is calibrated.
    pub fn hint(&self) -> Option<String> {
        let known: BTreeSet<&str> = self.materials.names().collect();
        let named = self
            .sweeps
            .iter()
            .filter_map(|sweep| sweep.named.as_deref());
        let unknown: BTreeSet<&str> = named.filter(|name| !known.contains(name)).collect();
        // Only a calibrated network detects unknown materials.
        let opinion = self.sweeps.iter().any(|sweep| sweep.unknown.is_some());
        if unknown.is_empty() {
            let nameless = self.sweeps.iter().all(|sweep| sweep.named.is_none());
            return (nameless && !opinion).then(|| {
                format!(
                    "each sweep is called one of the run's {} materials, whatever it is of; a network of `train --calibrate` calls some of the others \"unknown\"",
                    known.len()
                )
            });
        }
        let why = match opinion {
            true => "",
            false => ", and cannot say \"unknown\" without `train --calibrate`",
        };
        let names = listed(&unknown);
        Some(format!(
            "the run does not know {names}{why}; `tactnet enroll` adds a material to a network"
        ))
    }

    /// Returns a CSV table with a line for each sweep and a column for the probability of each material.
    pub fn to_csv(&self) -> String {
        let quoted = |text: &str| match text.contains(['"', ',', '\n', '\r']) {
            true => format!("\"{}\"", text.replace('"', "\"\"")),
            false => text.to_string(),
        };
        let mut csv = String::from("sweep,material,unknown,prediction_set,named");
        for material in self.materials.names() {
            csv.push(',');
            csv.push_str(&quoted(&format!("p({material})")));
        }
        csv.push('\n');
        for sweep in &self.sweeps {
            let unknown = sweep.unknown.map_or("", |unknown| match unknown {
                true => "1",
                false => "0",
            });
            let set = sweep.prediction_set.as_ref().map(|set| set.join(" | "));
            let fields = [
                quoted(&sweep.sweep),
                quoted(&sweep.material),
                unknown.into(),
                quoted(&set.unwrap_or_default()),
                quoted(sweep.named.as_deref().unwrap_or_default()),
            ];
            csv.push_str(&fields.join(","));
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

/// Returns the first names in backquotes, and the number of the others.
fn listed(names: &BTreeSet<&str>) -> String {
    let mut shown: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    let hidden = shown.len().saturating_sub(NAMED);
    shown.truncate(NAMED);
    if hidden > 0 {
        shown.push(format!("and {hidden} more"));
    }
    shown.join(", ")
}

/// Maximum number of names in a message.
const NAMED: usize = 5;
/// Maximum number of sweeps in the table.
const LISTED: usize = 40;

impl fmt::Display for ClassifiedSweeps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let listed = &self.sweeps[..self.sweeps.len().min(LISTED)];
        let widest = |texts: &mut dyn Iterator<Item = &str>, least: usize| {
            texts
                .map(|text| text.chars().count())
                .fold(least, usize::max)
        };
        let first = widest(&mut listed.iter().map(|sweep| sweep.sweep.as_str()), 5);
        let second = widest(&mut listed.iter().map(|sweep| sweep.material.as_str()), 8);
        let named = listed.iter().filter_map(|sweep| sweep.named.as_deref());
        let third = widest(&mut named.clone(), 5);
        let is_labelled = named.clone().next().is_some();
        write!(f, "{:first$}", "sweep")?;
        if is_labelled {
            write!(f, "  {:third$}", "named")?;
        }
        writeln!(f, "  {:second$}  probability  or else", "material")?;
        for sweep in listed {
            let (best, next) = two_largest(&sweep.probabilities);
            write!(f, "{:first$}", sweep.sweep)?;
            if is_labelled {
                write!(f, "  {:third$}", sweep.named.as_deref().unwrap_or_default())?;
            }
            write!(
                f,
                "  {:second$}  {:>9.1} %",
                sweep.material,
                100.0 * sweep.probabilities[best]
            )?;
            if let Some(next) = next {
                let probability = 100.0 * sweep.probabilities[next];
                write!(f, "  {} {probability:.1} %", self.materials.name(next))?;
            }
            if sweep.unknown == Some(true) {
                write!(f, "  most likely none of them")?;
            }
            if sweep.still {
                write!(f, "  no taxel ever changes")?;
            }
            writeln!(f)?;
        }
        if listed.len() < self.sweeps.len() {
            writeln!(f, "… and {} more", self.sweeps.len() - listed.len())?;
        }
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for sweep in &self.sweeps {
            let is_known = sweep.unknown != Some(true);
            let answer = if is_known {
                &sweep.material
            } else {
                "none of them"
            };
            *counts.entry(answer).or_default() += 1;
        }
        let mut counts: Vec<_> = counts.into_iter().collect();
        counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let counts: Vec<String> = counts
            .into_iter()
            .map(|(answer, count)| format!("{answer} {count}"))
            .collect();
        let plural = if self.sweeps.len() == 1 { "" } else { "s" };
        write!(
            f,
            "{} sweep{plural}: {}",
            self.sweeps.len(),
            counts.join(", ")
        )?;
        if self.sweeps.iter().any(|sweep| sweep.unknown.is_some()) {
            let none = self.sweeps.iter().filter(|it| it.unknown == Some(true));
            write!(
                f,
                "\nmost likely none of them: {} of {}",
                none.count(),
                self.sweeps.len()
            )?;
        }
        if is_labelled {
            let is_right = |sweep: &ClassifiedSweep| {
                sweep.unknown != Some(true) && sweep.named.as_ref() == Some(&sweep.material)
            };
            let known: BTreeSet<&str> = self.materials.names().collect();
            let is_known = |sweep: &&ClassifiedSweep| {
                let named = sweep.named.as_deref();
                named.is_some_and(|named| known.contains(named))
            };
            let (known, unknown): (Vec<&ClassifiedSweep>, Vec<_>) =
                self.sweeps.iter().partition(is_known);
            let called_none =
                |of: &[&ClassifiedSweep]| of.iter().filter(|it| it.unknown == Some(true)).count();
            let judges = self.sweeps.iter().any(|sweep| sweep.unknown.is_some());
            if !known.is_empty() {
                write!(
                    f,
                    "\nof materials that the run knows: {} of {} right",
                    known.iter().filter(|sweep| is_right(sweep)).count(),
                    known.len()
                )?;
                if judges {
                    write!(f, ", {} called none of them", called_none(&known))?;
                }
            }
            if !unknown.is_empty() {
                let judged = match judges {
                    true => format!(
                        "{} of {} called none of them",
                        called_none(&unknown),
                        unknown.len()
                    ),
                    false => unknown.len().to_string(),
                };
                write!(f, "\nof materials that it does not know: {judged}")?;
            }
        }
        if let Some(object) = &self.object {
            let probability = 100.0 * object.probabilities[argmax(&object.probabilities)];
            write!(
                f,
                "\nall {} as one object: {} with {probability:.1} %",
                object.sweeps, object.material
            )?;
            if object.unknown == Some(true) {
                write!(f, ", but most likely none of the materials that it knows")?;
            }
            let alike = self.sweeps.iter();
            let alike = alike
                .filter(|sweep| sweep.material == object.material)
                .count();
            if 2 * alike < self.sweeps.len() {
                write!(
                    f,
                    "\nwarning: alone, {alike} of {} sweeps say so: are they of one object?",
                    self.sweeps.len()
                )?;
            }
        }
        match &self.caution {
            Some(caution) => write!(f, "\nwarning: {caution}"),
            None => Ok(()),
        }
    }
}

/// Returns the labels of the largest and of the second largest value.
fn two_largest(values: &[f64]) -> (usize, Option<usize>) {
    let best = argmax(values);
    let others = (0..values.len()).filter(|label| *label != best);
    (
        best,
        others.max_by(|a, b| values[*a].total_cmp(&values[*b])),
    )
}
