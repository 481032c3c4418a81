//! Our confusions beside those published for the same materials.

use tactnet_plot::escape;

use super::class_bars;
use super::confusion::{Cells, Confusion, reordered, shades};
use super::data_set::DataSet;
use super::text::{decimal, percent};
use crate::published_confusion::{self, TACTMAT_MATERIALS, off_diagonal_correlation};
use crate::questions::Scored;

const SOURCE: &str = "Tulbure and B\u{e4}uml, Humanoids 2018; B\u{e4}uml's thesis, chapter 4; read off the figures' pixels, \
                      \u{b1}0.004";

/// Returns the confusions; `None` if no data set has exactly TactMat's materials.
pub(super) fn section(sets: &[DataSet]) -> Option<String> {
    let parts: String = sets
        .iter()
        .filter_map(|set| {
            let best = set.best()?;
            if !best.origin.is_comparable_to_published() {
                return None;
            }
            let order = tactmat_order(best.materials)?;
            (best.confusion.len() == order.len()).then(|| beside(set, best, &order))
        })
        .collect();
    (!parts.is_empty()).then_some(parts)
}

/// For each material of TactMat, in the order of its id, its label here; `None` unless the materials are exactly those.
fn tactmat_order(materials: &[String]) -> Option<Vec<usize>> {
    if materials.len() != TACTMAT_MATERIALS.len() {
        return None;
    }
    TACTMAT_MATERIALS
        .iter()
        .map(|name| materials.iter().position(|material| material == name))
        .collect()
}

fn beside(set: &DataSet, best: &Scored<'_>, order: &[usize]) -> String {
    let name = format!("{}: {}", set.heading(), set.name(best));
    let counts = reordered(best.confusion, order);
    let (robot, human) = (published_confusion::robot(), published_confusion::human());
    let correlation = |published: &[Vec<f64>]| {
        off_diagonal_correlation(&counts, published)
            .map_or_else(|| "not defined".to_string(), |r| decimal(r, 3))
    };
    let text = format!(
        "<p>Off the diagonal, our confusions correlate with the robot's published ones at <strong>r = {}</strong> and with \
         those of humans at r = {} (Pearson, over row shares).{}</p>\n\
         <p>Published accuracies of 15 humans: 33.9\u{a0}% with one sweep, 38.4\u{a0}% with three, 46.6\u{a0}% when allowed to compare by \
         touch. Ours with one sweep: {}\u{a0}%.</p>\n",
        correlation(&robot),
        correlation(&human),
        if best.origin.is_synthetic() {
            " The generator of these synthetic sweeps was itself built from the published matrix: here r shows only how much of \
             it survives."
        } else {
            ""
        },
        percent(best.one_sweep.mean)
    );
    let names = || TACTMAT_MATERIALS.to_vec();
    let panels = [
        ("Ours", name.as_str(), Cells::Counts(counts)),
        (
            "Published: robot",
            "TactNet-II on TactMat, one sweep",
            Cells::Shares(robot),
        ),
        (
            "Published: humans",
            "15 subjects, one sweep",
            Cells::Shares(human),
        ),
    ]
    .map(|(heading, whose, cells)| {
        let confusion = Confusion::new(format!("{heading}, {whose}"), names(), cells);
        let panel = format!(
            "<div><p class=\"panel\"><strong>{}</strong><br>{}</p>\n{}</div>\n",
            escape(heading),
            escape(whose),
            confusion.compact()
        );
        (heading, confusion.class_accuracies(), panel)
    });
    let matrices: String = panels.iter().map(|(_, _, panel)| panel.as_str()).collect();
    let columns: Vec<(&str, Vec<f64>)> = panels
        .iter()
        .map(|(heading, accuracies, _)| (*heading, accuracies.clone()))
        .collect();
    let bars = class_bars::table(
        &format!("Accuracy of each material: {name}, published robot, published humans"),
        &names(),
        &columns,
    );
    format!(
        "<h3>{}</h3>\n{text}<figure>\n<div class=\"panels\">\n{matrices}</div>\n{}<figcaption>Confusions of single sweeps, materials by \
         TactMat's id (names below, and on pointing). Rows: true material; columns: predicted. The two published matrices are not \
         ours: {SOURCE}.</figcaption>\n</figure>\n\
         <figure>\n<div class=\"scroll\" tabindex=\"0\" role=\"group\" aria-label=\"Accuracy of each material\">\n{bars}</div>\n\
         <figcaption>Accuracy of each material, single sweeps, %. Published columns: {SOURCE}.</figcaption>\n</figure>\n",
        escape(&name),
        shades()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_exactly_tactmats_materials_count_in_whatever_order() {
        let mut materials: Vec<String> = TACTMAT_MATERIALS.iter().map(|m| m.to_string()).collect();
        materials.swap(0, 35);
        let order = tactmat_order(&materials).unwrap();
        assert_eq!((order[0], order[1], order[35]), (35, 1, 0));
        materials[3] = "velvet".into();
        assert_eq!(tactmat_order(&materials), None);
        assert_eq!(tactmat_order(&materials[..20]), None);
    }
}
