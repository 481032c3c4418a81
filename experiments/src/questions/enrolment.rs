//! Enrolment of one more material into a trained classifier: accuracy on the new one, and loss on the known ones.

use serde::{Deserialize, Serialize};
use tactnet_data::{Fold, MaterialSplit, Scheme, SweepView};
use tactnet_models::{Features, LinearHead, WeightPrior, argmax, fit_new_class};
use tactnet_pipeline::Embedding;

use super::headline::{Headline, best};
use super::{Ask, Figure, check_shots, draws, one, six, within};
use crate::answer::Answer;
use crate::context::{Cancelled, StudyContext, embedded};
use crate::one_or_many::one_or_many;
use crate::phrases::{in_percent, sweeps};
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
        check_shots(&self.shots)
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
            format!("On the known materials accuracy changes from {before} to {after}.");
        Some(Headline::of(best, says, qualifier))
    }

    fn figures(&self) -> Vec<Figure> {
        vec![
            Figure::Bars(Measure::NewMaterial),
            Figure::Bars(Measure::KnownAfter),
        ]
    }
}

/// Glossary of the report.
pub(super) const TERMS: [(&str, &str); 2] = [
    (
        "Known, before, after, lost",
        "Accuracy on test sweeps of the known materials before and after one more was added, and the difference.",
    ),
    (
        "Knowledge prior; a tenth of it; knowledge mean, weak; bias penalised",
        "The prior of the new row has the mean of the known rows, with the precision of their spread, a tenth of that precision, or the strength of the network's own L2. Its bias is practically free, or penalised like the weights, with a hundredth or a thousandth of the precision.",
    ),
];

/// Known materials with their output layer, and the sweeps that judge an enrolment.
struct Known<'a> {
    head: &'a LinearHead,
    /// Embeddings of the training sweeps.
    seen: &'a Embedding,
    /// Embeddings of the test sweeps.
    test: &'a Embedding,
    /// Number of known materials.
    materials: usize,
    /// Number of test sweeps that are classified correctly before an enrolment.
    before: usize,
}

/// Returns the number of correctly classified sweeps.
fn right(head: &LinearHead, features: &Features, labels: &[usize]) -> usize {
    let scores = head.scores(features);
    let pairs = scores.iter().zip(labels);
    pairs.filter(|(row, label)| argmax(row) == **label).count()
}

impl Known<'_> {
    /// Enrols each new material alone and returns the measurements.
    fn enrol(
        &self,
        name: &str,
        prior: &WeightPrior,
        materials: usize,
        support: &Embedding,
        queries: &Embedding,
    ) -> Result<Vec<Measurement>, Cancelled> {
        let (mut found, mut asked, mut kept) = (0, 0, 0);
        for material in 0..materials {
            let of = |labels: &[usize]| -> Vec<usize> {
                (0..labels.len())
                    .filter(|row| labels[*row] == material)
                    .collect()
            };
            let own = support.hidden.select(&of(&support.labels));
            let seen = (&self.seen.hidden, &self.seen.labels);
            let class = fit_new_class(self.head, seen.0, seen.1, &own, prior)?;
            let mut more = self.head.clone();
            more.weights.push(class.weights);
            more.biases.push(class.bias);
            let rows = of(&queries.labels);
            let labels = vec![self.materials; rows.len()];
            found += right(&more, &queries.hidden.select(&rows), &labels);
            asked += rows.len();
            kept += right(&more, &self.test.hidden, &self.test.labels);
        }
        let (before, tests) = (self.before, self.test.len());
        let tested = materials * tests;
        let lost = (materials * before) as f64 / tested as f64 - kept as f64 / tested as f64;
        Ok([
            (Measure::NewMaterial, found as f64 / asked as f64, asked),
            (Measure::KnownBefore, before as f64 / tests as f64, tests),
            (Measure::KnownAfter, kept as f64 / tested as f64, tested),
            (Measure::KnownLost, lost, tested),
        ]
        .map(|(measure, value, decisions)| Measurement::new(measure, name, value, decisions))
        .into())
    }
}

fn enrolment(task: &Enrolment, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
    let stream = context.part.stream();
    let split = MaterialSplit::draw(context.dataset, task.new_materials, context.seed, stream)?;
    let fold = Fold::new(&split.known, Scheme::default(), context.seed, 0, 0)?;
    let seed = context.seed_for("network of the known materials", stream);
    let classifier = context.trained("network of the known materials", &fold.train, seed)?;
    context.say("embedding")?;
    let seen = embedded(&classifier, &fold.train)?;
    let test = embedded(&classifier, &fold.test)?;
    let everything = SweepView::all(&split.new);
    let whole = embedded(&classifier, &everything)?;
    let own = context.seed_for("folds of new materials", stream);
    let new = Fold::new(&split.new, Scheme::default(), own, 0, 0)?;
    let head = classifier.network()?.output_layer();
    let known = Known {
        head: &head,
        seen: &seen,
        test: &test,
        materials: split.known.labels().len(),
        before: right(&head, &test.hidden, &test.labels),
    };
    let knowledge = WeightPrior::of_knowledge(&head);
    let with_bias = knowledge.with_penalised_bias();
    let decay = WeightPrior {
        strength: WeightPrior::weight_decay(0, context.recipe().training.l2, seen.len()).strength,
        ..knowledge.clone()
    };
    let priors = [
        ("knowledge prior, a tenth", knowledge.weaker(10.0)),
        ("knowledge mean, weak", decay),
        ("bias penalised, a hundredth", with_bias.weaker(100.0)),
        ("bias penalised, a thousandth", with_bias.weaker(1000.0)),
    ];
    let priors = std::iter::once(("knowledge prior", knowledge)).chain(priors);
    let priors: Vec<(&str, WeightPrior)> = priors.collect();
    let materials = split.new.labels().len();
    let mut measurements = Vec::new();
    for &shots in &task.shots {
        let Ok(few) = new.shots(shots) else { continue };
        context.say(&format!("enrolment with {shots} shots"))?;
        let support = whole.part(&everything, &few.train);
        let queries = whole.part(&everything, &few.test);
        for (name, prior) in &priors {
            let found = known.enrol(name, prior, materials, &support, &queries)?;
            measurements.extend(found.into_iter().map(|one| one.shots(shots)));
        }
    }
    let names: Vec<&str> = split.new.labels().names().collect();
    Ok(Answer {
        measurements,
        split: format!("new materials, one at a time: {}", names.join(", ")),
        split_content: format!("{:?} {}", split.new_labels, new.manifest().sha256),
        ..Answer::default()
    })
}
