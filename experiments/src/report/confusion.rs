//! A confusion matrix as a heat map whose cells can be pointed at or walked through with the arrow keys.

use tactnet_plot::{HeatMap, escape, figure, shade, text_width};

use super::class_bars;
use super::text::{percent, shortened};
use crate::Grouping;

/// Longest material name that is written out in a figure.
pub(super) const NAME_LIMIT: usize = 34;

/// The cells of a matrix, `[true][predicted]`.
pub(super) enum Cells {
    /// Sweeps.
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
    /// Materials in the order of `names`.
    pub fn new(title: String, names: Vec<&'a str>, cells: Cells) -> Self {
        Self {
            title,
            names,
            cells,
            borders: Vec::new(),
        }
    }

    /// Materials of one group beside each other; groups and the materials within keep their order.
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

    /// Share of a true material's sweeps; 0 where it has none.
    pub fn share(&self, truth: usize, predicted: usize) -> f64 {
        match &self.cells {
            Cells::Shares(cells) => cells[truth][predicted],
            Cells::Counts(cells) => {
                let total: usize = cells[truth].iter().sum();
                cells[truth][predicted] as f64 / total.max(1) as f64
            }
        }
    }

    /// Accuracy of every material.
    pub fn class_accuracies(&self) -> Vec<f64> {
        (0..self.names.len()).map(|k| self.share(k, k)).collect()
    }

    /// The most frequent confusions as a table, with at most `limit` lines.
    pub fn most_frequent(&self, limit: usize) -> String {
        let Cells::Counts(cells) = &self.cells else {
            return String::new();
        };
        let mut pairs: Vec<(usize, usize)> = (0..cells.len())
            .flat_map(|truth| (0..cells.len()).map(move |predicted| (truth, predicted)))
            .filter(|&(truth, predicted)| truth != predicted && cells[truth][predicted] > 0)
            .collect();
        pairs.sort_by(|a, b| self.share(b.0, b.1).total_cmp(&self.share(a.0, a.1)));
        if pairs.is_empty() {
            return "<p>No sweep was mistaken.</p>\n".to_string();
        }
        let lines: String = pairs
            .iter()
            .take(limit)
            .map(|&(truth, predicted)| {
                format!(
                    "<tr><td>{}</td><td>{}</td><td class=\"number\">{} of {}</td><td class=\"number\">{}</td></tr>\n",
                    escape(self.names[truth]),
                    escape(self.names[predicted]),
                    cells[truth][predicted],
                    cells[truth].iter().sum::<usize>(),
                    percent(self.share(truth, predicted))
                )
            })
            .collect();
        format!(
            "<table>\n<caption>Most frequent confusions</caption>\n<thead><tr><th scope=\"col\">True</th><th scope=\"col\">\
             Predicted</th><th scope=\"col\" class=\"number\">Sweeps</th><th scope=\"col\" class=\"number\">%</th></tr></thead>\n\
             <tbody>\n{lines}</tbody>\n</table>\n"
        )
    }

    /// With names and a bar of accuracy for each material.
    pub fn detailed(&self) -> String {
        let size = self.names.len();
        let cell = (560.0 / size.max(1) as f64).clamp(14.0, 30.0).floor();
        let labels: Vec<String> = self
            .names
            .iter()
            .map(|name| shortened(name, NAME_LIMIT))
            .collect();
        // Room for names in wide fonts, and for the axis titles in the corner, where no name reaches.
        let margin = (8.0 + 1.2 * text_width(&labels)).max(90.0);
        let side = cell * size as f64;
        let mut content = String::new();
        for (k, label) in labels.iter().enumerate() {
            let middle = margin + cell * (k as f64 + 0.5);
            content.push_str(&format!(
                "<text class=\"end\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\
                 <text transform=\"translate({:.1} {:.1}) rotate(-90)\">{}</text>\n",
                margin - 6.0,
                middle + 4.0,
                escape(label),
                middle + 4.0,
                margin - 6.0,
                escape(label)
            ));
        }
        content.push_str(&format!(
            "<text class=\"label end\" x=\"{0:.1}\" y=\"{1:.1}\">predicted \u{2192}</text>\
             <text class=\"label end\" x=\"{0:.1}\" y=\"{2:.1}\">true \u{2193}</text>\n",
            margin - 6.0,
            margin - 26.0,
            margin - 10.0
        ));
        content.push_str(&self.heat(margin, margin, cell));
        let bars = margin + side + 16.0;
        content.push_str(&class_bars::column(
            &self.class_accuracies(),
            "accuracy, %",
            (bars, margin),
            (90.0, cell),
            0,
        ));
        self.interactive(
            &figure(bars + 130.0, margin + side + 6.0, &self.title, &content),
            (margin, margin, cell),
        )
    }

    /// Small, with numbers instead of names.
    pub fn compact(&self) -> String {
        let size = self.names.len();
        let cell = (320.0 / size.max(1) as f64).clamp(4.0, 20.0).floor();
        let margin = 24.0;
        let mut content = String::new();
        for k in (0..size).step_by(5) {
            let middle = margin + cell * (k as f64 + 0.5);
            content.push_str(&format!(
                "<text class=\"end\" x=\"{:.1}\" y=\"{:.1}\">{k}</text>\
                 <text class=\"middle\" x=\"{middle:.1}\" y=\"{:.1}\">{k}</text>\n",
                margin - 5.0,
                middle + 4.0,
                margin - 6.0
            ));
        }
        content.push_str(&self.heat(margin, margin, cell));
        let side = margin + cell * size as f64 + 4.0;
        self.interactive(
            &figure(side, side, &self.title, &content),
            (margin, margin, cell),
        )
    }

    fn heat(&self, left: f64, top: f64, cell: f64) -> String {
        let size = self.names.len();
        let shares: Vec<Vec<f64>> = (0..size)
            .map(|truth| (0..size).map(|k| self.share(truth, k)).collect())
            .collect();
        let map = HeatMap { left, top, cell };
        let mut svg = map.draw(&shares, |truth, predicted| self.describe(truth, predicted));
        let mut start = 0;
        for &end in &self.borders {
            let (from, width) = (cell * start as f64, cell * (end - start) as f64);
            svg.push_str(&format!(
                "<rect class=\"border\" x=\"{:.1}\" y=\"{:.1}\" width=\"{width}\" height=\"{width}\"/>\n",
                left + from,
                top + from
            ));
            start = end;
        }
        svg
    }

    /// Returns the text of a cell that is pointed at; `report.js` says the same.
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

    fn interactive(&self, svg: &str, (left, top, cell): (f64, f64, f64)) -> String {
        let data = match &self.cells {
            Cells::Counts(cells) => serde_json::json!({ "names": self.names, "counts": cells }),
            Cells::Shares(cells) => serde_json::json!({ "names": self.names, "shares": cells }),
        };
        format!(
            "<div class=\"scroll matrix\" tabindex=\"0\" role=\"group\" aria-label=\"{}. Arrow keys move from cell to cell.\" \
             data-left=\"{left:.1}\" data-top=\"{top:.1}\" data-cell=\"{cell}\" data-matrix=\"{}\">\n{svg}</div>\n",
            escape(&self.title),
            escape(&data.to_string())
        )
    }
}

/// The shades beside what they mean.
pub(super) fn shades() -> String {
    let entries: String = [0.01, 0.05, 0.2, 0.5, 1.0]
        .iter()
        .map(|&share| {
            format!(
                "<li><svg class=\"key\" aria-hidden=\"true\" width=\"18\" height=\"14\"><rect class=\"ground\" width=\"18\" \
                 height=\"14\"/><g class=\"heat\"><rect width=\"18\" height=\"14\" fill-opacity=\"{:.2}\"/></g></svg> {:.0} %</li>",
                shade(share),
                100.0 * share
            )
        })
        .collect();
    format!(
        "<ul class=\"legend\" aria-label=\"Shares of a true material's sweeps\">{entries}</ul>\n"
    )
}

/// Rows and columns of a square matrix in another order: entry `k` of `order` becomes the `k`-th.
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
        assert_eq!(confusion.detailed().matches("class=\"border\"").count(), 2);
    }

    #[test]
    fn axis_titles_stand_in_the_corner_that_no_name_reaches() {
        let name = "W".repeat(60);
        for names in [vec![name.as_str(), "b"], vec!["a", "b"]] {
            let cells = Cells::Counts(vec![vec![4, 0], vec![0, 3]]);
            let svg = Confusion::new("m".into(), names, cells).detailed();
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
        assert_eq!(confusion.compact().matches("<title>true").count(), 1);
        assert_eq!(confusion.class_accuracies(), [1.0, 0.0]);
    }
}
