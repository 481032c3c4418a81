//! Mean ranks of models over data sets with Nemenyi's critical distance (Demsar, 2006).

use std::collections::{BTreeMap, BTreeSet};

use tactnet_plot::{escape, figure};

use super::data_set::split_name;
use super::text::{decimal, shortened};
use crate::questions::Scored;

/// Critical values of the studentised range over sqrt 2 at alpha 0.05 for 2 to 10 models (Demsar, 2006, table 5).
const Q: [f64; 9] = [
    1.960, 2.343, 2.569, 2.728, 2.850, 2.949, 3.031, 3.102, 3.164,
];

/// Fewest models and fewest data sets for which ranks say anything.
const FEWEST: usize = 3;

/// Returns the ranks; `None` without the same three or more models (at most ten) on three or more data sets, treated and split alike.
pub(super) fn section(contenders: &[Scored<'_>]) -> Option<String> {
    let mut found = String::new();
    for (variant, accuracies) in variants(contenders) {
        if let Some(ranking) = Ranking::of(&accuracies) {
            found.push_str(&ranking.drawn(&format!(
                "levels {}, {}",
                variant.0,
                split_name(variant.1)
            )));
        }
    }
    (!found.is_empty()).then_some(found)
}

/// Accuracy by data set and contender.
type Accuracies<'a> = BTreeMap<&'a str, BTreeMap<String, f64>>;

/// Contenders that were asked alike, by levels and split: data sets that share sweeps are not independent blocks. Of sweeps
/// that were also cut short, only the longest count.
fn variants<'a>(contenders: &'a [Scored<'a>]) -> BTreeMap<(&'a str, &'a str), Accuracies<'a>> {
    let mut variants: BTreeMap<(&str, &str), Accuracies> = BTreeMap::new();
    let cut_short = |row: &Scored<'_>| {
        contenders.iter().any(|other| {
            (other.data, other.levels, other.split) == (row.data, row.levels, row.split)
                && other.steps > row.steps
        })
    };
    for row in contenders
        .iter()
        .filter(|row| !row.probe && !cut_short(row))
    {
        variants
            .entry((row.levels.name(), row.split))
            .or_default()
            .entry(row.data)
            .or_default()
            .insert(row.name(), row.one_sweep.mean);
    }
    variants
}

/// Mean ranks, 1 the most accurate.
struct Ranking {
    /// Best first.
    ranks: Vec<(String, f64)>,
    data_sets: usize,
    critical_distance: f64,
}

impl Ranking {
    /// Of the models that ran on every data set with enough models.
    fn of(accuracies: &Accuracies) -> Option<Self> {
        let blocks: Vec<&BTreeMap<String, f64>> = accuracies
            .values()
            .filter(|models| models.len() >= FEWEST)
            .collect();
        let mut shared: BTreeSet<&String> = blocks.first()?.keys().collect();
        for block in &blocks {
            shared.retain(|model| block.contains_key(*model));
        }
        if blocks.len() < FEWEST || shared.len() < FEWEST {
            return None;
        }
        let q = *Q.get(shared.len() - 2)?;
        let (models, count) = (shared.len() as f64, blocks.len() as f64);
        let mut ranks: Vec<(String, f64)> = shared
            .iter()
            .map(|model| {
                let sum: f64 = blocks.iter().map(|block| rank(block, model, &shared)).sum();
                (model.to_string(), sum / count)
            })
            .collect();
        ranks.sort_by(|a, b| a.1.total_cmp(&b.1));
        Some(Self {
            ranks,
            data_sets: blocks.len(),
            critical_distance: q * (models * (models + 1.0) / (6.0 * count)).sqrt(),
        })
    }

    /// First and last place of the largest runs of models that are closer than the critical distance.
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

    fn drawn(&self, variant: &str) -> String {
        let models = self.ranks.len();
        let (left, right, axis) = (200.0, 520.0, 70.0);
        let place = |rank: f64| left + (right - left) * (rank - 1.0) / (models as f64 - 1.0);
        let cliques = self.cliques();
        let below = axis + 14.0 + 9.0 * cliques.len() as f64;
        let mut svg = format!(
            "<line class=\"axis\" x1=\"{left:.0}\" x2=\"{right:.0}\" y1=\"{axis}\" y2=\"{axis}\"/>\n"
        );
        for rank in 1..=models {
            let x = place(rank as f64);
            svg.push_str(&format!(
                "<line class=\"axis\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{}\" y2=\"{axis}\"/>\
                 <text class=\"middle\" x=\"{x:.1}\" y=\"{}\">{rank}</text>\n",
                axis - 6.0,
                axis - 12.0
            ));
        }
        let reach = (place(1.0 + self.critical_distance) - left).min(720.0 - left - 70.0);
        svg.push_str(&format!(
            "<path class=\"axis\" d=\"M{left:.0} 18v8m0-4h{reach:.1}m0-4v8\"/><text x=\"{:.1}\" y=\"26\">CD {}</text>\n",
            left + reach + 8.0,
            decimal(self.critical_distance, 2)
        ));
        for (k, (model, rank)) in self.ranks.iter().enumerate() {
            let better = k < models.div_ceil(2);
            let depth = if better { k } else { models - 1 - k };
            let y = below + 20.0 + 22.0 * depth as f64;
            let (x, edge, class) = if better {
                (place(*rank), left - 10.0, "end")
            } else {
                (place(*rank), right + 10.0, "start")
            };
            let text = if better { edge - 5.0 } else { edge + 5.0 };
            svg.push_str(&format!(
                "<path class=\"leader\" d=\"M{x:.1} {axis}V{y:.1}H{edge:.1}\"/><circle class=\"mean\" cx=\"{x:.1}\" cy=\"{axis}\" r=\"4\"/>\
                 <text class=\"{class}\" x=\"{text:.1}\" y=\"{:.1}\">{} ({})</text>\n",
                y + 4.0,
                escape(&shortened(model, 26)),
                decimal(*rank, 2)
            ));
        }
        for (k, (first, last)) in cliques.iter().enumerate() {
            let y = axis + 11.0 + 9.0 * k as f64;
            svg.push_str(&format!(
                "<line class=\"clique\" x1=\"{:.1}\" x2=\"{:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>\n",
                place(self.ranks[*first].1) - 4.0,
                place(self.ranks[*last].1) + 4.0
            ));
        }
        let title = format!(
            "Mean ranks of {models} models over {} data sets, {variant}",
            self.data_sets
        );
        let height = below + 34.0 + 22.0 * (models.div_ceil(2) - 1) as f64;
        format!(
            "<figure>\n<div class=\"scroll\" tabindex=\"0\" role=\"group\" aria-label=\"Mean ranks\">\n{}</div>\n\
             <figcaption>Mean rank by single-sweep accuracy over {} data sets ({}), 1 is best. Models that a thick bar joins differ by \
             less than the critical distance CD (Nemenyi test, alpha 0.05; Dem\u{161}ar, 2006). The test takes data sets as independent: \
             two files with the same sweeps are not.</figcaption>\n</figure>\n",
            figure(720.0, height, &title, &svg),
            self.data_sets,
            escape(variant)
        )
    }
}

/// Rank of `model` among the shared models; ties share the mean of their ranks.
fn rank(block: &BTreeMap<String, f64>, model: &str, shared: &BTreeSet<&String>) -> f64 {
    let own = block[model];
    let others = || {
        shared
            .iter()
            .filter(|name| name.as_str() != model)
            .map(|name| block[*name])
    };
    let better = others().filter(|&accuracy| accuracy > own).count() as f64;
    let equal = others().filter(|&accuracy| accuracy == own).count() as f64;
    1.0 + better + equal / 2.0
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
