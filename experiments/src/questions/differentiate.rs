//! Same or different material? A frozen classifier, and decisions based on the distance between its outputs (thesis,
//! sections 4.4.3 and 4.4.4; Tulbure & Bäuml, Humanoids 2018).

mod hard_pairs;
mod pair_scorer;

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use tactnet_data::{Fold, Scheme, Seed};
use tactnet_models::Mlp;
use tactnet_pipeline::{Embedding, MlpTraining, SweepPair, fit_difference};

use super::headline::{Headline, best};
use super::{
    Ask, Compared, Figure, Published, check_counts, check_folds, five, folds, given_or, one,
};
use crate::answer::Answer;
use crate::context::{Cancelled, StudyContext, embedded};
use crate::one_or_many::one_or_many;
use crate::pairs::{draw, random_pairs, rows_of_label};
use crate::phrases::{in_percent, sweeps};
use crate::{Measure, Measurement, Part, Row};
use hard_pairs::hard_pairs;
use pair_scorer::{Apart, PairScorer, scaled, threshold};

/// Number of training pairs, as published.
const TRAINING_PAIRS: usize = 36_000;
/// Number of test trials, as published.
const TEST_PAIRS: usize = 2_700;
/// Width of the two hidden layers of the pair network, as published.
const HIDDEN: usize = 256;
/// Probability of keeping a unit of the second hidden layer in training, as published.
const KEEP: f64 = 0.7;
/// Training settings of the pair network.
const TRAINING: MlpTraining = MlpTraining {
    epochs: 15,
    batch: 128,
    learning_rate: 1e-3,
    l2: 0.0,
    keep: Some((1, KEEP)),
};
/// Default numbers of sweeps of each side; the majority of the pairs decides.
const SWEEPS: [usize; 2] = [1, 3];

/// Fields of the question whether two sweeps are of the same material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Differentiate {
    /// Number of folds of each repeat that are evaluated.
    #[serde(default = "five")]
    pub folds: usize,
    /// Number of repeats of the cross-validation.
    #[serde(default = "one", alias = "runs")]
    pub repeats: usize,
    /// Number of folds to take from the two repeats of five, instead of `folds` and `repeats`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub splits: Option<usize>,
    /// Numbers of sweeps of each side of one decision; 1 and 3 by default.
    #[serde(
        default,
        alias = "shots",
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "one_or_many"
    )]
    pub sweeps: Vec<usize>,
}

impl Ask for Differentiate {
    fn validate(&self) -> Result<(), String> {
        check_folds(self.folds, self.repeats, self.splits)?;
        check_counts("sweeps", &self.sweeps)
    }

    fn parts(&self) -> Vec<Part> {
        folds(self.folds, self.repeats, self.splits)
    }

    fn answer(&self, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
        differentiate(given_or(&self.sweeps, &SWEEPS), context)
    }

    fn test_share(&self) -> f64 {
        0.25
    }

    fn compared(&self, measure: Measure) -> Option<Compared> {
        (measure == Measure::Accuracy).then_some(Compared::With("siamese"))
    }

    /// Table 4.3 and figure 4.10 of the thesis.
    fn published(&self, row: &Row) -> Published {
        let both = |robot, humans| Published {
            robot: Some(robot),
            humans: Some(humans),
        };
        match (row.method.as_str(), row.setting.as_str(), row.sweeps) {
            ("siamese", "all pairs", Some(1)) => Published::robot(0.918),
            ("siamese", "all pairs", Some(3)) => Published::robot(0.954),
            ("siamese", "hard pairs", Some(1)) => both(0.769, 0.697),
            ("siamese", "hard pairs", Some(3)) => both(0.828, 0.785),
            _ => Published::default(),
        }
    }

    fn headline(&self, rows: &[&Row]) -> Option<Headline> {
        let fewest = rows.iter().filter_map(|row| row.sweeps).min()?;
        let of = |setting: &'static str| {
            let rows = rows.iter().copied();
            rows.filter(move |row| row.setting == setting && row.sweeps == Some(fewest))
        };
        let best = best(of("all pairs"))?;
        let guessing = in_percent(0.5);
        let qualifier = match of("hard pairs").find(|row| row.method == best.method) {
            Some(hard) => format!(
                "Of the hardest pairs it classifies {} correctly; guessing, {guessing}.",
                in_percent(hard.statistic.mean)
            ),
            None => format!("Guessing classifies {guessing} correctly."),
        };
        let says = format!(
            "of pairs classified correctly as the same or different material, from {} of each ({})",
            sweeps(fewest),
            best.method
        );
        Some(Headline::of(best, says, qualifier))
    }

    fn figures(&self) -> Vec<Figure> {
        vec![Figure::Bars(Measure::Accuracy)]
    }
}

/// Glossary of the report.
pub(super) const TERMS: [(&str, &str); 3] = [
    (
        "Siamese",
        "Two frozen networks, the Euclidean distance between their outputs, and a small network from it to the answer: as published. Every output: the small network takes the difference of every output instead.",
    ),
    (
        "Most probable, Bayes, threshold",
        "Comparison of the most probable materials; Bayes' rule on the two posteriors, with half of the pairs of one material; logistic regression on the distance of embeddings.",
    ),
    (
        "Hard pairs",
        "Seven pairs of TactMat's materials that human subjects compared (thesis, section 4.5.3); pairs of the same material come from the same eleven materials.",
    ),
];

fn differentiate(sweeps: &[usize], context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
    let (repeat, number) = context.part.repeat_and_fold();
    let scheme = Scheme::default();
    let fold = Fold::new(context.dataset, scheme, context.seed, repeat, number)?;
    let seed = context.seed_for("differentiation", context.part.stream());
    let classifier = context.trained("classifier", &fold.train, seed)?;
    context.say("embedding")?;
    let train = embedded(&classifier, &fold.train)?;
    let test = embedded(&classifier, &fold.test)?;
    let scorers = fitted_scorers(&train, seed, context)?;
    context.say("test pairs")?;
    let names: Vec<&str> = context.dataset.labels().names().collect();
    let hard = hard_pairs(&names);
    let mut measurements = Vec::new();
    let fewest = rows_of_label(&test.labels).iter().map(Vec::len).min();
    // A pair of the same material needs twice as many of its sweeps.
    for &sweeps in sweeps.iter().filter(|sweeps| Some(2 * **sweeps) <= fewest) {
        let mut rng = seed.rng(("test pairs", sweeps));
        let all = trials(&test.labels, None, sweeps, &mut rng);
        let mut settings = vec![("all pairs", all)];
        if let Some(hard) = &hard {
            let hard = trials(&test.labels, Some(hard), sweeps, &mut rng);
            settings.push(("hard pairs", hard));
        }
        for (setting, trials) in settings {
            let pairs: Vec<SweepPair> = trials.concat();
            for (name, scorer) in &scorers {
                let p = scorer.probabilities(&test, &pairs);
                let decisions = p.chunks(sweeps).zip(&trials);
                let right = decisions.filter(|(p, trial)| differ(p) == trial[0].different);
                let accuracy = right.count() as f64 / trials.len() as f64;
                let found = Measurement::new(Measure::Accuracy, name, accuracy, trials.len());
                measurements.push(found.setting(setting).sweeps(sweeps));
            }
        }
    }
    Ok(Answer {
        measurements,
        split: format!("repeat {repeat}, fold {number}"),
        split_content: fold.manifest().sha256,
        ..Answer::default()
    })
}

/// Fits all methods to random pairs of training sweeps.
fn fitted_scorers(
    train: &Embedding,
    seed: Seed,
    context: &StudyContext<'_>,
) -> Result<Vec<(&'static str, PairScorer)>, Cancelled> {
    let mut rng = seed.rng("training pairs");
    let pairs = random_pairs(&train.labels, TRAINING_PAIRS, &mut rng);
    context.say("threshold")?;
    let mut scorers = vec![
        ("most probable", PairScorer::MostProbable),
        ("Bayes", PairScorer::Bayes),
        ("threshold", threshold(train, &pairs)?),
    ];
    for (name, apart) in [
        ("siamese", Apart::Outputs),
        ("siamese, every output", Apart::EveryOutput),
    ] {
        context.say(name)?;
        let distances = apart.of(train, &pairs);
        let scale = distances.values().iter().sum::<f32>() / distances.values().len() as f32;
        let widths = [distances.width(), HIDDEN, HIDDEN, 2];
        let mut rng = seed.rng(("pair network", distances.width()));
        let layers = Mlp::init(&widths, context.device, &mut rng).layers();
        let distances = scaled(distances, scale);
        let mlp = fit_difference(&layers, &distances, &pairs, TRAINING, seed, context.device)?;
        let mlp = Box::new(mlp);
        scorers.push((name, PairScorer::Network { apart, mlp, scale }));
    }
    Ok(scorers)
}

/// Returns the majority decision of a trial's pairs.
///
/// - `p`: `[sweeps]`, probability that the sweeps of a pair are of different materials
fn differ(p: &[f64]) -> bool {
    let votes = p.iter().filter(|p| **p > 0.5).count();
    2 * votes > p.len()
}

/// Draws test trials of `sweeps` pairs each, alternately of the same and of different materials. No sweep occurs twice
/// in a trial.
///
/// Different materials are any two, or a pair of `hard`; then trials of the same material use the materials of those
/// pairs.
fn trials(
    labels: &[usize],
    hard: Option<&Vec<[usize; 2]>>,
    sweeps: usize,
    rng: &mut impl Rng,
) -> Vec<Vec<SweepPair>> {
    let of_label = rows_of_label(labels);
    let own: Vec<usize> = match hard {
        None => (0..of_label.len()).collect(),
        Some(hard) => {
            let mut own: Vec<usize> = hard.concat();
            own.sort_unstable();
            own.dedup();
            own
        }
    };
    (0..TEST_PAIRS)
        .map(|index| {
            let materials = match (index % 2 == 0, hard) {
                (true, _) => [own[rng.random_range(0..own.len())]; 2],
                (false, Some(hard)) => hard[rng.random_range(0..hard.len())],
                (false, None) => {
                    let first = rng.random_range(0..own.len());
                    [first, (first + rng.random_range(1..own.len())) % own.len()]
                }
            };
            let [a, b] = draw(&of_label, materials, sweeps, rng);
            a.into_iter()
                .zip(b)
                .map(|(first, second)| SweepPair {
                    first,
                    second,
                    different: materials[0] != materials[1],
                })
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_majority_of_the_pairs_decides() {
        assert!(!differ(&[0.9, 0.2, 0.4]));
        assert!(differ(&[0.9, 0.6, 0.1]));
        assert!(!differ(&[0.5]));
    }

    #[test]
    fn hard_questions_ask_about_the_hard_pairs_and_their_materials() {
        let labels: Vec<usize> = (0..80).map(|i| i % 8).collect();
        let hard = vec![[0, 1], [2, 3], [5, 2]];
        let asked = trials(&labels, Some(&hard), 3, &mut Seed(1).rng("questions"));
        assert_eq!(asked.len(), TEST_PAIRS);
        let mut found = std::collections::BTreeSet::new();
        for question in &asked {
            let mut sweeps: Vec<usize> =
                question.iter().flat_map(|p| [p.first, p.second]).collect();
            sweeps.sort_unstable();
            sweeps.dedup();
            assert_eq!((question.len(), sweeps.len()), (3, 6), "no sweep twice");
            let materials = [question[0].first, question[0].second].map(|row| labels[row]);
            for pair in question {
                assert_eq!([pair.first, pair.second].map(|row| labels[row]), materials);
                assert_eq!(pair.different, materials[0] != materials[1]);
            }
            if materials[0] == materials[1] {
                assert!([0, 1, 2, 3, 5].contains(&materials[0]), "{materials:?}");
            } else {
                found.insert(materials);
            }
        }
        assert!(found.into_iter().eq([[0, 1], [2, 3], [5, 2]]));
        let different = asked
            .iter()
            .filter(|question| question[0].different)
            .count();
        assert_eq!(2 * different, TEST_PAIRS);
    }
}
