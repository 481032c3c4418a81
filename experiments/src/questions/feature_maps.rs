//! Two-dimensional maps of the input and feature spaces for six new materials, once easy and once hard to tell apart
//! (thesis, section 4.6.4 and figure 4.13).

use bhtsne::tSNE;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use tactnet_data::{Fold, MaterialSplit, Scheme, SweepView};
use tactnet_models::Features;

use super::headline::Headline;
use super::{Ask, Figure, draws, one, six, within};
use crate::answer::{Answer, FeatureMap};
use crate::context::{Cancelled, StudyContext, embedded};
use crate::phrases::in_percent;
use crate::published_confusion::{TACTMAT_MATERIALS, robot};
use crate::{Measure, Measurement, Part, Row};

/// Number of neighbours for the purity.
const NEIGHBOURS: usize = 5;
/// Perplexity of t-SNE: approximate number of neighbours to preserve.
const PERPLEXITY: f32 = 30.0;
/// Standard deviation of t-SNE's initial points.
const START: f32 = 1e-4;

/// Fields of the question about feature maps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeatureMaps {
    /// Number of choices: 1 for easy materials, 2 for easy and hard ones.
    #[serde(default = "one")]
    pub splits: usize,
    /// Number of new materials.
    #[serde(default = "six")]
    pub new_materials: usize,
}

/// Choice of the new materials.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Choice {
    /// The least similar materials.
    Easy,
    /// The most similar materials.
    Hard,
}

impl Choice {
    fn of(part: Part) -> Self {
        match part.stream() {
            0 => Self::Easy,
            _ => Self::Hard,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Easy => "easy",
            Self::Hard => "hard",
        }
    }
}

impl Ask for FeatureMaps {
    fn validate(&self) -> Result<(), String> {
        if !(1..=2).contains(&self.splits) {
            return Err(format!(
                "`splits`: expected 1 (the easy choice of materials) or 2 (also the hard one), found {}",
                self.splits
            ));
        }
        within("new_materials", self.new_materials, 2, usize::MAX)
    }

    fn parts(&self) -> Vec<Part> {
        draws(self.splits)
    }

    fn new_materials(&self) -> Option<usize> {
        Some(self.new_materials)
    }

    fn answer(&self, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
        feature_maps(self, context)
    }

    fn headline(&self, rows: &[&Row]) -> Option<Headline> {
        let of = |setting: &'static str, space: &'static str| {
            rows.iter()
                .copied()
                .find(|row| row.setting == setting && row.method == space)
        };
        let settings = ["hard materials, whole space", "easy materials, whole space"];
        let (setting, learnt) = settings
            .into_iter()
            .find_map(|setting| Some((setting, of(setting, "embedding")?)))?;
        let choice = setting.split(',').next().unwrap_or_default();
        let says = format!(
            "of the nearest neighbours in the network's features are of the same material ({} new {choice})",
            self.new_materials
        );
        let qualifier = match of(setting, "input") {
            Some(input) => format!(
                "In the raw digits it is {}, by chance about {}.",
                in_percent(input.statistic.mean),
                in_percent(1.0 / self.new_materials as f64)
            ),
            None => format!(
                "By chance it is about {}.",
                in_percent(1.0 / self.new_materials as f64)
            ),
        };
        Some(Headline::of(learnt, says, qualifier))
    }

    fn figures(&self) -> Vec<Figure> {
        vec![Figure::Bars(Measure::Purity)]
    }
}

/// Glossary of the report.
pub(super) const TERMS: [(&str, &str); 1] = [(
    "Purity",
    "Share of the five nearest sweeps that are of the same material, in the complete space or in its t-SNE plane.",
)];

fn feature_maps(task: &FeatureMaps, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
    let choice = Choice::of(context.part);
    let alike = likeness(context)?;
    let new = choose(&alike, task.new_materials, choice);
    let choice = choice.name();
    let split = MaterialSplit::of(context.dataset, &new)?;
    let fold = Fold::new(&split.known, Scheme::default(), context.seed, 0, 0)?;
    let seed = context.seed_for("feature maps", context.part.stream());
    let classifier = context.trained("network of the known materials", &fold.train, seed)?;
    let everything = SweepView::all(&split.new);
    let embedding = embedded(&classifier, &everything)?;
    let mut digits = vec![0.0; everything.len() * everything.shape().values()];
    let positions: Vec<usize> = (0..everything.len()).collect();
    everything.copy_batch(&positions, &mut digits);
    context
        .recipe()
        .input
        .levels
        .apply(&mut digits, everything.shape());
    let input = Features::new(everything.shape().values(), digits);
    let materials: Vec<String> = split.new.labels().names().map(String::from).collect();
    let (mut measurements, mut maps) = (Vec::new(), Vec::new());
    for (space, features) in [("input", &input), ("embedding", &embedding.hidden)] {
        context.say(&format!("t-SNE of the {space} space, {choice} materials"))?;
        let plane = plane(features, &mut seed.rng(("t-SNE", maps.len())));
        let flat = Features::new(2, plane.concat());
        for (what, features) in [("whole space", features), ("plane", &flat)] {
            let purity = purity(features, &embedding.labels);
            measurements.push(
                Measurement::new(Measure::Purity, space, purity, embedding.len())
                    .setting(format!("{choice} materials, {what}")),
            );
        }
        maps.push(FeatureMap {
            choice: choice.into(),
            space: space.into(),
            materials: materials.clone(),
            labels: embedding.labels.clone(),
            points: plane,
        });
    }
    Ok(Answer {
        measurements,
        split: format!("{choice} materials: {}", materials.join(", ")),
        split_content: format!("{:?} {}", split.new_labels, fold.manifest().sha256),
        maps,
        ..Answer::default()
    })
}

/// Returns how often materials are confused with each other, `[material][material]`. The matrix is the published one
/// for TactMat's materials, and otherwise that of a separately trained network on held-out sweeps.
fn likeness(context: &StudyContext<'_>) -> Result<Vec<Vec<f64>>, Cancelled> {
    let names: Vec<&str> = context.dataset.labels().names().collect();
    let ids: Option<Vec<usize>> = names
        .iter()
        .map(|name| TACTMAT_MATERIALS.iter().position(|known| known == name))
        .collect();
    let confusion = match ids {
        Some(ids) if ids.len() > 12 => {
            let robot = robot();
            ids.iter()
                .map(|a| ids.iter().map(|b| robot[*a][*b]).collect())
                .collect()
        }
        _ => {
            let fold = Fold::new(context.dataset, Scheme::default(), context.seed, 0, 0)?;
            let seed = context.seed_for("likeness", 0);
            let classifier = context.trained(
                "network that says which materials are alike",
                &fold.train,
                seed,
            )?;
            let test = embedded(&classifier, &fold.test)?;
            let mut sums: Vec<Vec<f64>> = vec![vec![0.0; names.len()]; names.len()];
            for (log_p, label) in test.log_probabilities().iter().zip(&test.labels) {
                sums[*label]
                    .iter_mut()
                    .zip(log_p)
                    .for_each(|(sum, l)| *sum += l.exp());
            }
            sums
        }
    };
    let size = confusion.len();
    Ok((0..size)
        .map(|a| {
            (0..size)
                .map(|b| confusion[a][b] + confusion[b][a])
                .collect()
        })
        .collect())
}

/// Selects the `count` most or least similar materials greedily, starting with the extreme pair.
fn choose(alike: &[Vec<f64>], count: usize, choice: Choice) -> Vec<usize> {
    let sign = match choice {
        Choice::Easy => -1.0,
        Choice::Hard => 1.0,
    };
    let size = alike.len();
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < count.min(size) {
        let score = |material: usize| -> f64 {
            if chosen.is_empty() {
                let others = (0..size).filter(|other| *other != material);
                // Selects the first material of the extreme pair.
                return others
                    .map(|other| sign * alike[material][other])
                    .fold(f64::NEG_INFINITY, f64::max);
            }
            chosen
                .iter()
                .map(|other| sign * alike[material][*other])
                .sum()
        };
        let best = (0..size)
            .filter(|material| !chosen.contains(material))
            .max_by(|a, b| score(*a).total_cmp(&score(*b)).then(b.cmp(a)));
        chosen.extend(best);
    }
    chosen
}

/// Embeds each sweep in a plane.
fn plane(features: &Features, rng: &mut impl Rng) -> Vec<[f32; 2]> {
    let rows: Vec<&[f32]> = features.rows().collect();
    let start: Vec<f32> = (0..2 * rows.len())
        .map(|_| {
            let normal: f32 = StandardNormal.sample(rng);
            START * normal
        })
        .collect();
    let perplexity = PERPLEXITY.min((rows.len() as f32 - 2.0) / 3.0).max(1.0);
    // The sums of t-SNE depend on the number of threads, so it runs on one.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap_or_else(|error| panic!("a thread can be started: {error}"));
    let flat = pool.install(|| {
        tSNE::<f32, &[f32], 2>::new(&rows)
            .perplexity(perplexity)
            .initial_embedding(start)
            .exact(|a, b| squared_distance(a, b).sqrt())
            .embedding()
    });
    flat.chunks_exact(2)
        .map(|point| [point[0], point[1]])
        .collect()
}

/// Returns the share of nearest neighbours with the sweep's own material, mean over sweeps.
fn purity(features: &Features, labels: &[usize]) -> f64 {
    let rows: Vec<&[f32]> = features.rows().collect();
    let neighbours = NEIGHBOURS.min(rows.len() - 1);
    let own: usize = rows
        .par_iter()
        .enumerate()
        .map(|(sweep, row)| {
            let mut others: Vec<(f32, usize)> = (0..rows.len())
                .filter(|other| *other != sweep)
                .map(|other| (squared_distance(row, rows[other]), other))
                .collect();
            others.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            others[..neighbours]
                .iter()
                .filter(|(_, other)| labels[*other] == labels[sweep])
                .count()
        })
        .sum();
    own as f64 / (rows.len() * neighbours) as f64
}

fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactnet_data::Seed;

    /// Draws two clouds in five dimensions.
    fn clouds() -> (Features, Vec<usize>) {
        let mut rng = Seed(3).rng("clouds");
        let rows: Vec<f32> = (0..60)
            .flat_map(|i| {
                let shift = if i % 2 == 0 { 0.0 } else { 6.0 };
                let row: Vec<f32> = (0..5)
                    .map(|_| {
                        let normal: f32 = StandardNormal.sample(&mut rng);
                        shift + normal
                    })
                    .collect();
                row
            })
            .collect();
        (Features::new(5, rows), (0..60).map(|i| i % 2).collect())
    }

    #[test]
    fn clouds_stay_apart_in_the_plane_and_are_pure() {
        let (features, labels) = clouds();
        let flat = plane(&features, &mut Seed(1).rng("start"));
        assert_eq!(
            flat,
            plane(&features, &mut Seed(1).rng("start")),
            "the same again"
        );
        let flat = Features::new(2, flat.concat());
        assert!(purity(&features, &labels) > 0.99);
        assert!(purity(&flat, &labels) > 0.95);
        let mixed: Vec<usize> = (0..60).map(|i| i / 30).collect();
        assert!(purity(&flat, &mixed) < 0.7);
    }

    #[test]
    fn hard_materials_are_alike_and_easy_ones_are_not() {
        let mut alike = vec![vec![0.1; 6]; 6];
        for (a, b) in [(1, 4), (4, 5), (1, 5)] {
            alike[a][b] = 0.9;
            alike[b][a] = 0.9;
        }
        let mut hard = choose(&alike, 3, Choice::Hard);
        hard.sort_unstable();
        assert_eq!(hard, [1, 4, 5]);
        let easy = choose(&alike, 3, Choice::Easy);
        assert_eq!(
            easy.iter().filter(|m| [1, 4, 5].contains(m)).count(),
            1,
            "{easy:?}"
        );
    }
}
