//! A confusion matrix as a heat map that shows its cells on pointing and with the arrow keys.

use maud::{Markup, PreEscaped, html};
use tactnet_plot::{HeatMap, figure, shade, text_width};

use super::class_bars::{self, Layout};
use super::table::{Heading, plain};
use super::text::{NAME_LIMIT, percent, px, shortened};
use crate::Grouping;

/// The cells of a matrix, `[true][predicted]`.
pub(super) enum Cells {
    /// Numbers of sweeps.
    Counts(Vec<Vec<usize>>),
    /// Shares of the row, 0 to 1.
    Shares(Vec<Vec<f64>>),
}

/// A confusion matrix in the order in which it is drawn.
pub(super) struct Confusion<'a> {
    title: String,
    names: Vec<&'a str>,
    cells: Cells,
    /// First index of every group but the first, and the end; empty without groups.
    borders: Vec<usize>,
}

impl<'a> Confusion<'a> {
    /// Returns a matrix with the materials in the order of `names`.
    pub fn new(title: String, names: Vec<&'a str>, cells: Cells) -> Self {
        Self {
            title,
            names,
            cells,
            borders: Vec::new(),
        }
    }

    /// Moves the materials of each group together; groups and the materials within keep their order.
    pub fn grouped(mut self, grouping: &Grouping) -> Self {
        if grouping.group_of.len() != self.names.len() {
            return self;
        }
        let mut order: Vec<usize> = (0..self.names.len()).collect();
        order.sort_by_key(|&material| grouping.group_of[material]);
        self.borders = (1..order.len())
            .filter(|&k| grouping.group_of[order[k]] != grouping.group_of[order[k - 1]])
            .collect();
        self.borders.push(order.len());
        self.names = order.iter().map(|&k| self.names[k]).collect();
        self.cells = match self.cells {
            Cells::Counts(cells) => Cells::Counts(reordered(&cells, &order)),
            Cells::Shares(cells) => Cells::Shares(reordered(&cells, &order)),
        };
        self
    }

    /// Returns the share of a true material's sweeps; 0 if it has none.
    pub fn share(&self, truth: usize, predicted: usize) -> f64 {
        match &self.cells {
            Cells::Shares(cells) => cells[truth][predicted],
            Cells::Counts(cells) => {
                let total: usize = cells[truth].iter().sum();
                cells[truth][predicted] as f64 / total.max(1) as f64
            }
        }
    }

    /// Returns the accuracy of each material.
    pub fn class_accuracies(&self) -> Vec<f64> {
        (0..self.names.len()).map(|k| self.share(k, k)).collect()
    }

    /// Returns a table of the most frequent confusions, with at most `limit` rows.
    pub fn most_frequent(&self, limit: usize) -> Markup {
        let Cells::Counts(cells) = &self.cells else {
            return html! {};
        };
        let mut pairs: Vec<(usize, usize)> = (0..cells.len())
            .flat_map(|truth| (0..cells.len()).map(move |predicted| (truth, predicted)))
            .filter(|&(truth, predicted)| truth != predicted && cells[truth][predicted] > 0)
            .collect();
        pairs.sort_by(|a, b| self.share(b.0, b.1).total_cmp(&self.share(a.0, a.1)));
        if pairs.is_empty() {
            return html! { p { "No sweep was misclassified." } };
        }
        let headings = [
            Heading::text("True"),
            Heading::text("Predicted"),
            Heading::number("Sweeps", ""),
            Heading::number("%", ""),
        ];
        let rows = html! {
            @for &(truth, predicted) in pairs.iter().take(limit) {
                tr {
                    td { (self.names[truth]) }
                    td { (self.names[predicted]) }
                    td.number { (cells[truth][predicted]) " of " (cells[truth].iter().sum::<usize>()) }
                    td.number { (percent(self.share(truth, predicted))) }
                }
            }
        };
        plain(
            &html! { caption { "Most frequent confusions" } },
            &headings,
            &rows,
        )
    }

    /// Returns the matrix with names and a bar of accuracy for each material.
    pub fn detailed(&self) -> Markup {
        let size = self.names.len();
        let cell = (560.0 / size.max(1) as f64).clamp(14.0, 30.0).floor();
        let labels: Vec<String> = self
            .names
            .iter()
            .map(|name| shortened(name, NAME_LIMIT))
            .collect();
        // Room for names in wide fonts, and for the axis titles in the corner that no name reaches.
        let margin = (8.0 + 1.2 * text_width(&labels)).max(90.0);
        let side = cell * size as f64;
        let left = margin + side + 16.0;
        let bars = Layout {
            left,
            top: margin,
            width: 90.0,
            line: cell,
        };
        let edge = px(margin - 6.0);
        let content = html! {
            @for (k, label) in labels.iter().enumerate() {
                @let place = px(margin + cell * (k as f64 + 0.5) + 4.0);
                text.end x=(edge) y=(place) { (label) }
                text transform={ "translate(" (place) " " (edge) ") rotate(-90)" } { (label) }
            }
            text.label.end x=(edge) y=(px(margin - 26.0)) { "predicted \u{2192}" }
            text.label.end x=(edge) y=(px(margin - 10.0)) { "true \u{2193}" }
            (self.heat(margin, cell))
            (class_bars::column(&self.class_accuracies(), "accuracy, %", &bars, 0))
        };
        let svg = figure(left + 130.0, margin + side + 6.0, &self.title, &content.0);
        self.interactive(svg, margin, cell)
    }

    /// Returns a small matrix with numbers instead of names.
    pub fn compact(&self) -> Markup {
        let size = self.names.len();
        let cell = (320.0 / size.max(1) as f64).clamp(4.0, 20.0).floor();
        let margin = 24.0;
        let content = html! {
            @for k in (0..size).step_by(5) {
                @let middle = margin + cell * (k as f64 + 0.5);
                text.end x=(px(margin - 5.0)) y=(px(middle + 4.0)) { (k) }
                text.middle x=(px(middle)) y=(px(margin - 6.0)) { (k) }
            }
            (self.heat(margin, cell))
        };
        let side = margin + cell * size as f64 + 4.0;
        self.interactive(figure(side, side, &self.title, &content.0), margin, cell)
    }

    /// Draws the cells and the frames of the groups.
    ///
    /// - `margin`: left and top, in user units
    fn heat(&self, margin: f64, cell: f64) -> Markup {
        let size = self.names.len();
        let shares: Vec<Vec<f64>> = (0..size)
            .map(|truth| (0..size).map(|k| self.share(truth, k)).collect())
            .collect();
        let map = HeatMap {
            left: margin,
            top: margin,
            cell,
        };
        let starts = std::iter::once(0).chain(self.borders.iter().copied());
        html! {
            (PreEscaped(map.draw(&shares, |truth, predicted| self.describe(truth, predicted))))
            @for (start, &end) in starts.zip(&self.borders) {
                @let from = px(margin + cell * start as f64);
                @let width = cell * (end - start) as f64;
                rect.border x=(from) y=(from) width=(width) height=(width) {}
            }
        }
    }

    /// Returns the text of a cell; `report.js` shows the same text.
    fn describe(&self, truth: usize, predicted: usize) -> String {
        let (a, b) = (self.names[truth], self.names[predicted]);
        let share = percent(self.share(truth, predicted));
        match &self.cells {
            Cells::Shares(_) => format!("true {a}, predicted {b}: {share} %"),
            Cells::Counts(cells) => format!(
                "true {a}, predicted {b}: {} of {} ({share} %)",
                cells[truth][predicted],
                cells[truth].iter().sum::<usize>()
            ),
        }
    }

    /// Returns a frame with the data that `report.js` needs.
    fn interactive(&self, svg: String, margin: f64, cell: f64) -> Markup {
        let data = match &self.cells {
            Cells::Counts(cells) => serde_json::json!({ "names": self.names, "counts": cells }),
            Cells::Shares(cells) => serde_json::json!({ "names": self.names, "shares": cells }),
        };
        let label = format!("{}. Arrow keys move from cell to cell.", self.title);
        html! {
            div.scroll.matrix tabindex="0" role="group" aria-label=(label) data-left=(px(margin)) data-top=(px(margin))
                data-cell=(cell) data-matrix=(data) { (PreEscaped(svg)) }
        }
    }
}

/// Returns the key of the shades.
pub(super) fn shades() -> Markup {
    html! {
        ul.legend aria-label="Shares of a true material's sweeps" {
            @for share in [0.01, 0.05, 0.2, 0.5, 1.0] {
                li {
                    svg.key aria-hidden="true" width="18" height="14" {
                        rect.ground width="18" height="14" {}
                        g.heat { rect width="18" height="14" fill-opacity=(format!("{:.2}", shade(share))) {} }
                    }
                    " " (format!("{:.0} %", 100.0 * share))
                }
            }
        }
    }
}

/// Returns a square matrix whose `k`-th row and column are those with index `order[k]`.
pub(super) fn reordered<T: Copy>(cells: &[Vec<T>], order: &[usize]) -> Vec<Vec<T>> {
    order
        .iter()
        .map(|&truth| {
            order
                .iter()
                .map(|&predicted| cells[truth][predicted])
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grouping(group_of: Vec<usize>) -> Grouping {
        Grouping {
            group_of,
            accuracy: 1.0,
            accuracy_of_three: None,
            stability: None,
            consecutive: false,
        }
    }

    #[test]
    fn groups_bring_their_materials_together_and_keep_every_count() {
        let cells = vec![vec![8, 0, 2], vec![1, 9, 0], vec![3, 0, 7]];
        let confusion = Confusion::new("m".into(), vec!["a", "b", "c"], Cells::Counts(cells))
            .grouped(&grouping(vec![0, 1, 0]));
        assert_eq!(confusion.names, ["a", "c", "b"]);
        assert_eq!(confusion.borders, [2, 3]);
        assert_eq!(
            confusion.describe(1, 0),
            "true c, predicted a: 3 of 10 (30.0 %)"
        );
        assert_eq!(
            confusion.describe(2, 2),
            "true b, predicted b: 9 of 10 (90.0 %)"
        );
        assert_eq!(
            confusion.detailed().0.matches("class=\"border\"").count(),
            2
        );
    }

    #[test]
    fn axis_titles_stand_in_the_corner_that_no_name_reaches() {
        let name = "W".repeat(60);
        for names in [vec![name.as_str(), "b"], vec!["a", "b"]] {
            let cells = Cells::Counts(vec![vec![4, 0], vec![0, 3]]);
            let svg = Confusion::new("m".into(), names, cells)
                .detailed()
                .into_string();
            let number = |text: &str, before: &str| -> f64 {
                let (_, after) = text.split_once(before).unwrap();
                after.split_once('"').unwrap().0.parse().unwrap()
            };
            let (left, top) = (number(&svg, "data-left=\""), number(&svg, "data-top=\""));
            for title in ["predicted \u{2192}", "true \u{2193}"] {
                let (before, _) = svg.split_once(&format!(">{title}<")).unwrap();
                let element = &before[before.rfind("<text").unwrap()..];
                let (x, y) = (number(element, "x=\""), number(element, "y=\""));
                assert!(element.contains("end"), "{element}");
                assert!(x < left && y < top, "{element}");
                assert!(x - 1.2 * text_width(&[title]) > 0.0, "{element}");
            }
        }
    }

    #[test]
    fn cells_without_sweeps_are_not_drawn() {
        let cells = vec![vec![4, 0], vec![0, 0]];
        let confusion = Confusion::new("m".into(), vec!["a", "b"], Cells::Counts(cells));
        assert_eq!(confusion.compact().0.matches("<title>true").count(), 1);
        assert_eq!(confusion.class_accuracies(), [1.0, 0.0]);
    }
}
