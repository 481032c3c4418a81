//! Detection of unknown materials: novelty scores, evaluated with held-out materials.
//!
//! ```text
//! materials ─┬─ known ─┬─ training sweeps ─┬─ 4 of 5: train the network, covariance
//!            │         │                   └─ 1 of 5: thresholds, conformal quantiles
//!            │         └─ test sweeps: false alarms, coverage
//!            └─ new ──── all sweeps: detected or not
//! ```

mod roc;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_data::{Fold, MaterialSplit, Scheme, Seed, SweepView, shuffle};
use tactnet_pipeline::{
    NoveltyScorer, TrainEmbeddings, least_probability, prediction_set, upper_quantile,
};

use super::headline::{Headline, best};
use super::{Ask, Compared, Figure, check_counts, draws, given_or, one, six, within};
use crate::answer::Answer;
use crate::context::{Cancelled, StudyContext, embedded};
use crate::one_or_many::one_or_many;
use crate::pairs::rows_of_label;
use crate::phrases::{in_percent, sweeps};
use crate::{Measure, Measurement, Part, Row};
use roc::auroc;

/// Default numbers of sweeps whose scores are averaged.
const SWEEPS: [usize; 2] = [1, 3];
/// Target share of known sweeps that are classified as unknown.
const FALSE_ALARMS: f64 = 0.05;
/// Target shares of sweeps whose label is in the prediction set.
const COVERAGES: [f64; 2] = [0.9, 0.95];

/// Fields of the question about unknown materials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unknown {
    /// Number of draws of the new materials.
    #[serde(default = "one")]
    pub splits: usize,
    /// Numbers of sweeps for one decision; 1 and 3 by default.
    #[serde(
        default,
        alias = "shots",
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "one_or_many"
    )]
    pub sweeps: Vec<usize>,
    /// Number of new materials.
    #[serde(default = "six")]
    pub new_materials: usize,
}

impl Ask for Unknown {
    fn validate(&self) -> Result<(), String> {
        within("splits", self.splits, 1, usize::MAX)?;
        within("new_materials", self.new_materials, 2, usize::MAX)?;
        check_counts("sweeps", &self.sweeps)
    }

    fn parts(&self) -> Vec<Part> {
        draws(self.splits)
    }

    fn new_materials(&self) -> Option<usize> {
        Some(self.new_materials)
    }

    fn answer(&self, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
        unknown(self, context)
    }

    fn compared(&self, measure: Measure) -> Option<Compared> {
        (measure == Measure::Auroc).then_some(Compared::With("largest probability"))
    }

    fn headline(&self, rows: &[&Row]) -> Option<Headline> {
        let of = |measure: Measure| {
            rows.iter()
                .copied()
                .filter(move |row| row.measure == measure)
        };
        let fewest = of(Measure::Auroc).filter_map(|row| row.sweeps).min()?;
        let best = best(of(Measure::Auroc).filter(|row| row.sweeps == Some(fewest)))?;
        let beside = |measure: Measure| {
            of(measure)
                .find(|row| row.method == best.method && row.sweeps == best.sweeps)
                .map(|row| in_percent(row.statistic.mean))
        };
        let qualifier = match (beside(Measure::Detected), beside(Measure::FalseAlarms)) {
            (Some(detected), Some(false_alarms)) => format!(
                "With its threshold set for {} false alarms it detects {detected} of the unknown sweeps and rejects {false_alarms} of the \
                 known ones.",
                in_percent(FALSE_ALARMS)
            ),
            _ => format!("Guessing reaches {}.", in_percent(0.5)),
        };
        let says = format!(
            "AUROC of {} over {}: probability that an unknown material scores higher than a known one",
            best.method,
            sweeps(fewest)
        );
        Some(Headline::of(best, says, qualifier))
    }

    fn figures(&self) -> Vec<Figure> {
        vec![Figure::Bars(Measure::Auroc)]
    }
}

/// Glossary of the report.
pub(super) const TERMS: [(&str, &str); 4] = [
    (
        "AUROC",
        "Probability that a sweep of an unknown material has a higher score than one of a known material.",
    ),
    (
        "False alarms, detected",
        "Share of known and of unknown sweeps above the threshold for 5 % false alarms, which is set on held-out sweeps of known materials.",
    ),
    (
        "Conformal set",
        "All labels whose probability is above a calibrated bound; it contains the true label with the target probability.",
    ),
    (
        "Energy, largest probability, mutual information, whitened distance",
        "Four novelty scores: minus the log of the summed exponentials of the outputs; minus the log of the largest probability; disagreement of dropout masks; distance to the nearest class mean, whitened with the known sweeps' covariance.",
    ),
];

fn unknown(task: &Unknown, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
    let split = MaterialSplit::draw(
        context.dataset,
        task.new_materials,
        context.seed,
        context.part.stream(),
    )?;
    let fold = Fold::new(
        &split.known,
        Scheme::default(),
        context.seed,
        0,
        context.part.stream() % 5,
    )?;
    let (train, calibration) = fold.inner(0)?;
    let seed = context.seed_for("network of the known materials", context.part.stream());
    let classifier = context.trained("network of the known materials", &train, seed)?;
    context.say("scores")?;
    let seen = embedded(&classifier, &train)?;
    let strangeness = NoveltyScorer::fit(&classifier, &TrainEmbeddings::of(&seen))?;
    let scored = |view: &SweepView<'_>| -> Result<Scored, Cancelled> {
        let embedding = embedded(&classifier, view)?;
        Ok(Scored {
            scores: strangeness.all(&embedding)?,
            log_p: embedding.log_probabilities(),
            labels: embedding.labels,
        })
    };
    let calibration = scored(&calibration)?;
    let test = scored(&fold.test)?;
    let new = scored(&SweepView::all(&split.new))?;
    let mut measurements = Vec::new();
    for (name, calibration_scores) in &calibration.scores {
        for &sweeps in given_or(&task.sweeps, &SWEEPS) {
            let of = |scored: &Scored, scores: &[f64]| averages(scored, scores, sweeps, seed);
            let (inside, outside) = (of(&test, &test.scores[name]), of(&new, &new.scores[name]));
            if inside.is_empty() || outside.is_empty() {
                continue;
            }
            let set_by = of(&calibration, calibration_scores);
            let found = detection(name, &set_by, &inside, &outside);
            measurements.extend(found.into_iter().map(|one| one.sweeps(sweeps)));
        }
    }
    measurements.extend(prediction_sets(&calibration, &test));
    let names: Vec<&str> = split.new.labels().names().collect();
    Ok(Answer {
        measurements,
        split: format!("new materials: {}", names.join(", ")),
        split_content: format!("{:?} {}", split.new_labels, fold.manifest().sha256),
        ..Answer::default()
    })
}

/// Sweeps with their labels, log probabilities and novelty scores.
struct Scored {
    labels: Vec<usize>,
    log_p: Vec<Vec<f64>>,
    /// One value for each sweep, by name of the score; larger means more novel.
    scores: BTreeMap<&'static str, Vec<f64>>,
}

/// Returns the mean scores of disjoint groups of `sweeps` sweeps of the same material.
fn averages(scored: &Scored, scores: &[f64], sweeps: usize, seed: Seed) -> Vec<f64> {
    if sweeps == 1 {
        return scores.to_vec();
    }
    let mut means = Vec::new();
    for (label, mut rows) in rows_of_label(&scored.labels).into_iter().enumerate() {
        shuffle(
            &mut rows,
            &mut seed.rng(("groups of sweeps", label, sweeps)),
        );
        means.extend(
            rows.chunks_exact(sweeps)
                .map(|group| group.iter().map(|row| scores[*row]).sum::<f64>() / sweeps as f64),
        );
    }
    means
}

/// Measures how well a score separates new from known materials: AUROC, and the rates at the threshold for
/// [`FALSE_ALARMS`].
///
/// - `set_by`: scores of the known sweeps that set the threshold; a threshold needs enough of them
/// - `inside`, `outside`: scores of other sweeps of known and of new materials
fn detection(name: &str, set_by: &[f64], inside: &[f64], outside: &[f64]) -> Vec<Measurement> {
    let threshold = upper_quantile(set_by, FALSE_ALARMS);
    let above = |scores: &[f64]| {
        scores.iter().filter(|score| **score > threshold).count() as f64 / scores.len() as f64
    };
    let both = inside.len() + outside.len();
    let mut found = vec![Measurement::new(
        Measure::Auroc,
        name,
        auroc(inside, outside),
        both,
    )];
    if threshold.is_finite() {
        for (measure, scores) in [(Measure::FalseAlarms, inside), (Measure::Detected, outside)] {
            found.push(Measurement::new(measure, name, above(scores), scores.len()));
        }
    }
    found
}

/// Measures coverage and mean size of split conformal prediction sets. A set holds every label whose probability is at
/// least the calibrated one (Sadinle et al., 2019), and is never empty.
fn prediction_sets(calibration: &Scored, test: &Scored) -> Vec<Measurement> {
    let mut measurements = Vec::new();
    for coverage in COVERAGES {
        let least = least_probability(&calibration.log_p, &calibration.labels, coverage);
        let (mut covered, mut labels) = (0, 0);
        for (log_p, label) in test.log_p.iter().zip(&test.labels) {
            let set = prediction_set(log_p, least);
            covered += usize::from(set.contains(label));
            labels += set.len();
        }
        let n = test.labels.len();
        let setting = format!("target {:.0} %", 100.0 * coverage);
        for (measure, sum) in [(Measure::Coverage, covered), (Measure::SetSize, labels)] {
            measurements.push(
                Measurement::new(measure, "conformal set", sum as f64 / n as f64, n)
                    .setting(setting.as_str()),
            );
        }
    }
    measurements
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn new_materials_are_detected_at_the_false_alarms_that_other_sweeps_set() {
        let set_by: Vec<f64> = (1..=99).map(f64::from).collect();
        let (inside, outside) = ([1.0, 50.0, 94.0, 96.0], [90.0, 97.0, 99.0]);
        let found = detection("energy", &set_by, &inside, &outside);
        let value = |measure: Measure| found.iter().find(|m| m.measure == measure).unwrap().value;
        // Of twelve pairs, 90 is below 94 and 96.
        assert!((value(Measure::Auroc) - 10.0 / 12.0).abs() < 1e-12);
        // The threshold is 95.
        assert_eq!(value(Measure::FalseAlarms), 0.25);
        assert_eq!(value(Measure::Detected), 2.0 / 3.0);
        assert_eq!(
            detection("energy", &set_by[..9], &inside, &outside).len(),
            1
        );
    }

    /// If the calibration sweeps are more confident than the test sweeps, the coverage falls below its target.
    #[test]
    fn the_bound_of_prediction_sets_comes_from_the_calibration_sweeps() {
        let scored = |p: f64| Scored {
            labels: vec![0; 19],
            log_p: (0..19)
                .map(|k| {
                    let p: f64 = p + 0.001 * f64::from(k);
                    vec![p.ln(), (1.0 - p).ln()]
                })
                .collect(),
            scores: BTreeMap::new(),
        };
        let coverage = |calibration: f64, test: f64| {
            let found = prediction_sets(&scored(calibration), &scored(test));
            assert_eq!(found[0].measure, Measure::Coverage);
            found[0].value
        };
        assert_eq!(coverage(0.3, 0.4), 1.0);
        assert_eq!(coverage(0.4, 0.3), 0.0);
    }
}
