//! Enrolment of one more material into a trained classifier: accuracy on the new one, and loss on the known ones.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_data::{Fold, MaterialSplit, Scheme, SweepView};
use tactnet_models::{Features, LinearHead, WeightPrior, argmax, fit_new_class};

use super::headline::{Headline, best, in_percent, sweeps};
use super::{Ask, Compared, Figure, check_counts, draws, one, six, within};
use crate::context::{Cancelled, StudyContext, embedded};
use crate::one_or_many::one_or_many;
use crate::result::Answer;
use crate::{Measure, Measurement, Part, Row};

/// Fields of the question about enrolment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Enrolment {
    /// Number of draws of the new materials.
    #[serde(default = "one")]
    pub splits: usize,
    /// Numbers of support sweeps of the new material.
    #[serde(deserialize_with = "one_or_many")]
    pub shots: Vec<usize>,
    /// Number of new materials, enrolled one at a time.
    #[serde(default = "six")]
    pub new_materials: usize,
}

impl Ask for Enrolment {
    fn validate(&self) -> Result<(), String> {
        within("splits", self.splits, 1, usize::MAX)?;
        within("new_materials", self.new_materials, 2, usize::MAX)?;
        if self.shots.is_empty() {
            return Err("`shots`: expected one or more numbers above 0, found none".into());
        }
        check_counts("shots", &self.shots)
    }

    fn parts(&self) -> Vec<Part> {
        draws(self.splits)
    }

    fn new_materials(&self) -> Option<usize> {
        Some(self.new_materials)
    }

    fn answer(&self, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
        enrolment(self, context)
    }

    fn test_share(&self) -> f64 {
        0.0
    }

    fn compared(&self, _measure: Measure) -> Option<Compared> {
        None
    }

    fn headline(&self, rows: &[&Row]) -> Option<Headline> {
        let most = rows.iter().filter_map(|row| row.shots).max()?;
        let of = |measure: Measure| {
            let rows = rows.iter().copied();
            rows.filter(move |row| row.measure == measure && row.shots == Some(most))
        };
        let best = best(of(Measure::NewMaterial))?;
        let known = |measure: Measure| {
            of(measure)
                .find(|row| row.method == best.method)
                .map(|row| in_percent(row.statistic.mean))
        };
        let (before, after) = (known(Measure::KnownBefore)?, known(Measure::KnownAfter)?);
        let says = format!(
            "of sweeps of a new material recognised after {} of it ({})",
            sweeps(most),
            best.method
        );
        let qualifier =
            format!("On the known materials accuracy goes from {before} to {after} by it.");
        Some(Headline::of(best, says, qualifier))
    }

    fn figures(&self) -> Vec<Figure> {
        vec![
            Figure::Bars(Measure::NewMaterial),
            Figure::Bars(Measure::KnownAfter),
        ]
    }

    fn terms(&self) -> &'static [(&'static str, &'static str)] {
        &TERMS
    }
}

/// Glossary of the report.
const TERMS: [(&str, &str); 2] = [
    (
        "Known, before, after, lost",
        "Accuracy on test sweeps of the known materials before and after one more was added, and the difference.",
    ),
    (
        "Knowledge prior; a tenth of it; knowledge mean, weak; bias penalised",
        "The new row is drawn towards the mean of the known rows, with the precision of their spread; with a tenth of that precision; with the strength of the network's own L2. Its bias is as good as free, or is penalised as the weights are, with a hundredth or a thousandth of the precision.",
    ),
];

fn enrolment(task: &Enrolment, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
    let split = MaterialSplit::draw(
        context.dataset,
        task.new_materials,
        context.seed,
        context.part.stream(),
    )?;
    let fold = Fold::new(&split.known, Scheme::default(), context.seed, 0, 0)?;
    let seed = context.seed_for("network of the known materials", context.part.stream());
    let classifier = context.trained("network of the known materials", &fold.train, seed)?;
    context.say("embedding")?;
    let seen = embedded(&classifier, &fold.train)?;
    let test = embedded(&classifier, &fold.test)?;
    let everything = SweepView::all(&split.new);
    let whole = embedded(&classifier, &everything)?;
    let own = context.seed_for("folds of new materials", context.part.stream());
    let new = Fold::new(&split.new, Scheme::default(), own, 0, 0)?;
    let head = classifier.network()?.output_layer();
    let right = |head: &LinearHead, features: &Features, labels: &[usize]| {
        let scores = head.scores(features);
        let right = scores
            .iter()
            .zip(labels)
            .filter(|(row, label)| argmax(row) == **label);
        right.count()
    };
    let before = right(&head, &test.hidden, &test.labels);
    let known = split.known.labels().len();
    let knowledge = WeightPrior::of_knowledge(&head);
    let tenth = knowledge.weaker(10.0);
    let with_bias = knowledge.with_penalised_bias();
    let (hundredth, thousandth) = (with_bias.weaker(100.0), with_bias.weaker(1000.0));
    let decay = WeightPrior {
        strength: WeightPrior::weight_decay(0, context.recipe.training.l2, seen.len()).strength,
        ..knowledge.clone()
    };
    let priors = [
        ("knowledge prior", &knowledge),
        ("knowledge prior, a tenth", &tenth),
        ("knowledge mean, weak", &decay),
        ("bias penalised, a hundredth", &hundredth),
        ("bias penalised, a thousandth", &thousandth),
    ];
    let mut measurements = Vec::new();
    for &shots in &task.shots {
        let Ok(few) = new.shots(shots) else { continue };
        context.say(&format!("enrolment with {shots} shots"))?;
        let support = whole.part(&everything, &few.train);
        let queries = whole.part(&everything, &few.test);
        for (name, prior) in priors {
            let (mut found, mut asked, mut kept) = (0, 0, 0);
            for material in 0..split.new.labels().len() {
                let of = |labels: &[usize]| -> Vec<usize> {
                    (0..labels.len())
                        .filter(|row| labels[*row] == material)
                        .collect()
                };
                let own = support.hidden.select(&of(&support.labels));
                let class = fit_new_class(&head, &seen.hidden, &seen.labels, &own, prior)?;
                let mut more = head.clone();
                more.weights.push(class.weights);
                more.biases.push(class.bias);
                let rows = of(&queries.labels);
                found += right(
                    &more,
                    &queries.hidden.select(&rows),
                    &vec![known; rows.len()],
                );
                asked += rows.len();
                kept += right(&more, &test.hidden, &test.labels);
            }
            let materials = split.new.labels().len();
            let tested = materials * test.len();
            for (measure, value, decisions) in [
                (Measure::NewMaterial, found as f64 / asked as f64, asked),
                (
                    Measure::KnownBefore,
                    before as f64 / test.len() as f64,
                    test.len(),
                ),
                (Measure::KnownAfter, kept as f64 / tested as f64, tested),
                (
                    Measure::KnownLost,
                    (materials * before) as f64 / tested as f64 - kept as f64 / tested as f64,
                    tested,
                ),
            ] {
                measurements.push(Measurement::new(measure, name, value, decisions).shots(shots));
            }
        }
    }
    let names: Vec<&str> = split.new.labels().names().collect();
    Ok(Answer {
        measurements,
        split: format!("new materials, one at a time: {}", names.join(", ")),
        split_content: format!("{:?} {}", split.new_labels, new.manifest().sha256),
        chosen: BTreeMap::new(),
        maps: Vec::new(),
    })
}
