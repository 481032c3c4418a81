//! Measured confusions compared with those published for the same materials.

use maud::{Markup, PreEscaped, html};

use super::class_bars;
use super::confusion::{Cells, Confusion, reordered, shades};
use super::data_set::DataSet;
use super::text::{decimal, percent, scroll};
use crate::published_confusion::{self, TACTMAT_MATERIALS, off_diagonal_correlation};
use crate::scored::Scored;

const SOURCE: &str = "Tulbure and B\u{e4}uml, Humanoids 2018; B\u{e4}uml's thesis, chapter 4; measured from the figures' pixels, \u{b1}0.004";

/// Returns the comparison; `None` unless a data set has exactly TactMat's materials.
pub(super) fn section(sets: &[DataSet]) -> Option<Markup> {
    let comparable = |set: &DataSet| {
        let best = set
            .best()
            .filter(|best| best.origin.is_comparable_to_published())?;
        let order = tactmat_order(&best.materials)?;
        (best.confusion.len() == order.len()).then(|| comparison(set, best, &order))
    };
    let parts: Vec<Markup> = sets.iter().filter_map(comparable).collect();
    (!parts.is_empty()).then(|| html! { @for part in parts { (part) } })
}

/// Returns the label of each material of TactMat, in the order of its id; `None` for other materials.
fn tactmat_order(materials: &[String]) -> Option<Vec<usize>> {
    if materials.len() != TACTMAT_MATERIALS.len() {
        return None;
    }
    TACTMAT_MATERIALS
        .iter()
        .map(|name| materials.iter().position(|material| material == name))
        .collect()
}

fn comparison(set: &DataSet, best: &Scored<'_>, order: &[usize]) -> Markup {
    let name = format!("{}: {}", set.heading(), set.name(best));
    let counts = reordered(&best.confusion, order);
    let (robot, human) = (published_confusion::robot(), published_confusion::human());
    let text = correlations(best, &counts, &robot, &human);
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
    .map(|(heading, source, cells)| {
        let title = format!("{heading}, {source}");
        (
            heading,
            source,
            Confusion::new(title, TACTMAT_MATERIALS.to_vec(), cells),
        )
    });
    let columns: Vec<(&str, Vec<f64>)> = panels
        .iter()
        .map(|(heading, _, confusion)| (*heading, confusion.class_accuracies()))
        .collect();
    let title = format!("Accuracy of each material: {name}, published robot, published humans");
    let bars = class_bars::table(&title, &TACTMAT_MATERIALS, &columns);
    html! {
        h3 { (name) }
        (text)
        figure {
            div.panels {
                @for (heading, source, confusion) in &panels {
                    div { p.panel { strong { (heading) } br; (source) } (confusion.compact()) }
                }
            }
            (shades())
            figcaption {
                "Confusions of single sweeps, materials by TactMat's id (names below, and on pointing). Rows: true material; "
                "columns: predicted. Source of the two published matrices: " (SOURCE) "."
            }
        }
        figure {
            (scroll("Accuracy of each material", &PreEscaped(bars)))
            figcaption { "Accuracy of each material, single sweeps, %. Published columns: " (SOURCE) "." }
        }
    }
}

/// Returns how the measured confusions correlate with the published ones.
fn correlations(
    best: &Scored<'_>,
    counts: &[Vec<usize>],
    robot: &[Vec<f64>],
    human: &[Vec<f64>],
) -> Markup {
    let correlation = |published: &[Vec<f64>]| {
        off_diagonal_correlation(counts, published)
            .map_or_else(|| "not defined".to_string(), |r| decimal(r, 3))
    };
    html! {
        p {
            "Off the diagonal, our confusions correlate with the robot's published ones at "
            strong { "r = " (correlation(robot)) }
            " and with those of humans at r = " (correlation(human)) " (Pearson, over row shares)."
            @if best.origin.is_synthetic() {
                " The generator of these synthetic sweeps was built from the published matrix, so here r only shows how much "
                "of it is preserved."
            }
        }
        p {
            "Published accuracies of 15 humans: 33.9\u{a0}% with one sweep, 38.4\u{a0}% with three, 46.6\u{a0}% when allowed to "
            "compare by touch. Ours with one sweep: " (percent(best.one_sweep.mean)) "\u{a0}%."
        }
    }
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
