//! Mean ranks of models over data sets with Nemenyi's critical distance (Demsar, 2006).

use std::collections::{BTreeMap, BTreeSet};

use maud::{Markup, PreEscaped, html};
use tactnet_plot::figure;

use super::data_set::split_name;
use super::text::{decimal, px, scroll, shortened};
use crate::benchmark::{Benchmark, Condition, ConditionScores};
use crate::ranks::ranks;
use crate::scored::Scored;

/// Critical values of the studentised range over sqrt 2 at alpha 0.05 for 2 to 10 models (Demsar, 2006, table 5).
const Q: [f64; 9] = [
    1.960, 2.343, 2.569, 2.728, 2.850, 2.949, 3.031, 3.102, 3.164,
];

/// Minimum number of models and of data sets for ranks.
const FEWEST: usize = 3;

/// Left end of the axis, in user units.
const LEFT: f64 = 200.0;
/// Right end of the axis, in user units.
const RIGHT: f64 = 520.0;
/// Height of the axis, in user units.
const AXIS: f64 = 70.0;

/// Returns the ranks; `None` unless the same three to ten models ran on three or more data sets with equal levels and
/// split.
pub(super) fn section(contenders: &[Scored<'_>]) -> Option<Markup> {
    let figures: Vec<Markup> = variants(contenders)
        .iter()
        .filter_map(|((levels, split), accuracies)| {
            let variant = format!("levels {levels}, {}", split_name(split));
            Some(Ranking::of(accuracies)?.figure(&variant))
        })
        .collect();
    (!figures.is_empty()).then(|| html! { @for figure in figures { (figure) } })
}

/// Returns the ranks of a comparison over several data sets, on the headline and on random folds; `None` with fewer than three or more than
/// ten models, or fewer than three data sets.
pub(super) fn of_benchmark(benchmark: &Benchmark) -> Option<Markup> {
    let figure = |condition: Condition, variant: &str| {
        let ranking = Ranking::of_scores(benchmark.under(condition)?)?;
        Some(ranking.figure(variant))
    };
    let groups = "held-out groups where a set has them, else random folds";
    let figures = match benchmark.under(Condition::HeldOutGroups) {
        None => [figure(Condition::Headline, "random folds"), None],
        Some(_) => [
            figure(Condition::Headline, groups),
            figure(Condition::RandomFolds, "random folds"),
        ],
    };
    let figures: Vec<Markup> = figures.into_iter().flatten().collect();
    (!figures.is_empty()).then(|| html! { @for figure in figures { (figure) } })
}

/// Accuracy by data set and contender.
type Accuracies<'a> = BTreeMap<&'a str, BTreeMap<String, f64>>;

/// Groups contenders by levels and split, because data sets that share sweeps are not independent. Only the longest
/// sweeps count.
fn variants<'a>(contenders: &'a [Scored<'a>]) -> BTreeMap<(&'a str, &'a str), Accuracies<'a>> {
    let mut variants: BTreeMap<(&str, &str), Accuracies> = BTreeMap::new();
    let cut_short = |row: &Scored<'_>| {
        contenders.iter().any(|other| {
            (&other.data, other.levels, &other.split) == (&row.data, row.levels, &row.split)
                && other.steps > row.steps
        })
    };
    for row in contenders
        .iter()
        .filter(|row| !row.probe && !cut_short(row))
    {
        variants
            .entry((row.levels.name(), &row.split))
            .or_default()
            .entry(&row.data)
            .or_default()
            .insert(row.name(), row.one_sweep.mean);
    }
    variants
}

/// Mean ranks; 1 is the most accurate.
struct Ranking {
    /// Model and mean rank, best first.
    ranks: Vec<(String, f64)>,
    data_sets: usize,
    critical_distance: f64,
}

impl Ranking {
    /// Ranks the models that ran on every data set with enough models.
    fn of(accuracies: &Accuracies) -> Option<Self> {
        let blocks: Vec<&BTreeMap<String, f64>> = accuracies
            .values()
            .filter(|models| models.len() >= FEWEST)
            .collect();
        let mut shared: BTreeSet<&String> = blocks.first()?.keys().collect();
        for block in &blocks {
            shared.retain(|model| block.contains_key(*model));
        }
        let of_block = |block: &&BTreeMap<String, f64>| {
            let accuracies: Vec<Option<f64>> = shared.iter().map(|of| Some(block[*of])).collect();
            ranks(&accuracies)
        };
        let of_blocks: Vec<Vec<f64>> = blocks.iter().map(of_block).collect();
        let mean = |k: usize| of_blocks.iter().map(|of| of[k]).sum::<f64>() / blocks.len() as f64;
        let models = shared.iter().enumerate();
        let ranks = models.map(|(k, model)| (model.to_string(), mean(k)));
        Self::of_means(ranks.collect(), blocks.len())
    }

    /// Returns the ranking of a comparison over several data sets.
    fn of_scores(scores: &ConditionScores) -> Option<Self> {
        let complete = scores.sets.iter().filter(|set| set.is_complete()).count();
        let models = scores.models.iter();
        let ranks = models.map(|of| Some((of.model.clone(), of.mean_rank?)));
        Self::of_means(ranks.collect::<Option<_>>()?, complete)
    }

    /// Returns the ranking by mean ranks; `None` with too few data sets, or too few or too many models.
    fn of_means(mut ranks: Vec<(String, f64)>, data_sets: usize) -> Option<Self> {
        if data_sets < FEWEST || ranks.len() < FEWEST {
            return None;
        }
        let q = *Q.get(ranks.len() - 2)?;
        let (models, count) = (ranks.len() as f64, data_sets as f64);
        ranks.sort_by(|a, b| a.1.total_cmp(&b.1));
        Some(Self {
            ranks,
            data_sets,
            critical_distance: q * (models * (models + 1.0) / (6.0 * count)).sqrt(),
        })
    }

    /// Returns first and last place of the largest runs of models within the critical distance.
    fn cliques(&self) -> Vec<(usize, usize)> {
        let mut cliques: Vec<(usize, usize)> = Vec::new();
        for first in 0..self.ranks.len() {
            let last = (first..self.ranks.len())
                .rev()
                .find(|&last| self.ranks[last].1 - self.ranks[first].1 < self.critical_distance)
                .unwrap_or(first);
            if last > first && cliques.last().is_none_or(|&(_, end)| last > end) {
                cliques.push((first, last));
            }
        }
        cliques
    }

    /// Draws the critical-difference diagram.
    fn figure(&self, variant: &str) -> Markup {
        let models = self.ranks.len();
        let below = AXIS + 14.0 + 9.0 * self.cliques().len() as f64;
        let reach = (self.place(1.0 + self.critical_distance) - LEFT).min(720.0 - LEFT - 70.0);
        let content = html! {
            line.axis x1=(LEFT) x2=(RIGHT) y1=(AXIS) y2=(AXIS) {}
            @for rank in 1..=models {
                @let x = px(self.place(rank as f64));
                line.axis x1=(x) x2=(x) y1=(AXIS - 6.0) y2=(AXIS) {}
                text.middle x=(x) y=(AXIS - 12.0) { (rank) }
            }
            path.axis d={ "M" (LEFT) " 18v8m0-4h" (px(reach)) "m0-4v8" } {}
            text x=(px(LEFT + reach + 8.0)) y="26" { "CD " (decimal(self.critical_distance, 2)) }
            @for k in 0..models { (self.leader(k, below)) }
            @for (k, (first, last)) in self.cliques().into_iter().enumerate() {
                @let y = px(AXIS + 11.0 + 9.0 * k as f64);
                line.clique x1=(px(self.place(self.ranks[first].1) - 4.0)) x2=(px(self.place(self.ranks[last].1) + 4.0)) y1=(y) y2=(y) {}
            }
        };
        let sets = self.data_sets;
        let title = format!("Mean ranks of {models} models over {sets} data sets, {variant}");
        let height = below + 34.0 + 22.0 * (models.div_ceil(2) - 1) as f64;
        html! {
            figure {
                (scroll("Mean ranks", &PreEscaped(figure(720.0, height, &title, &content.0))))
                figcaption {
                    "Mean rank by single-sweep accuracy over " (sets) " data sets (" (variant) "), 1 is best. Models that a thick bar "
                    "joins differ by less than the critical distance CD (Nemenyi test, alpha 0.05; Dem\u{161}ar, 2006). The test "
                    "assumes independent data sets: two files with the same sweeps are not."
                }
            }
        }
    }

    /// Returns the horizontal position of a rank, in user units.
    fn place(&self, rank: f64) -> f64 {
        LEFT + (RIGHT - LEFT) * (rank - 1.0) / (self.ranks.len() as f64 - 1.0)
    }

    /// Draws the mark and the name of the `k`-th model; the better half is on the left.
    fn leader(&self, k: usize, below: f64) -> Markup {
        let (models, (model, rank)) = (self.ranks.len(), &self.ranks[k]);
        let better = k < models.div_ceil(2);
        let depth = if better { k } else { models - 1 - k };
        let y = below + 20.0 + 22.0 * depth as f64;
        let (edge, text, class) = if better {
            (LEFT - 10.0, LEFT - 15.0, "end")
        } else {
            (RIGHT + 10.0, RIGHT + 15.0, "start")
        };
        let x = px(self.place(*rank));
        html! {
            path.leader d={ "M" (x) " " (AXIS) "V" (px(y)) "H" (px(edge)) } {}
            circle.mean cx=(x) cy=(AXIS) r="4" {}
            text class=(class) x=(px(text)) y=(px(y + 4.0)) { (shortened(model, 26)) " (" (decimal(*rank, 2)) ")" }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn accuracies(columns: &[[f64; 3]]) -> Accuracies<'static> {
        ["a", "b", "c", "d"]
            .into_iter()
            .zip(columns)
            .map(|(data, column)| {
                let models = ["x", "y", "z"]
                    .map(String::from)
                    .into_iter()
                    .zip(*column)
                    .collect();
                (data, models)
            })
            .collect()
    }

    #[test]
    fn ranks_average_ties_and_the_distance_is_nemenyis() {
        let table = accuracies(&[
            [0.9, 0.8, 0.7],
            [0.9, 0.9, 0.7],
            [0.6, 0.8, 0.7],
            [0.9, 0.8, 0.7],
        ]);
        let ranking = Ranking::of(&table).unwrap();
        let expected = [("x", 1.625), ("y", 1.625), ("z", 2.75)];
        for ((model, rank), (name, value)) in ranking.ranks.iter().zip(expected) {
            assert_eq!((model.as_str(), *rank), (name, value));
        }
        // 2.343 sqrt(3 * 4 / (6 * 4))
        assert!((ranking.critical_distance - 1.656_75).abs() < 1e-4);
        assert_eq!(ranking.cliques(), [(0, 2)]);
    }

    #[test]
    fn two_data_sets_are_not_ranked() {
        assert!(Ranking::of(&accuracies(&[[0.9, 0.8, 0.7], [0.9, 0.8, 0.7]])).is_none());
        assert!(Ranking::of(&BTreeMap::new()).is_none());
    }
}
