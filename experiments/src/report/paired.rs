//! Paired comparisons of contenders on the same folds.

use maud::{Markup, html};

use super::data_set::DataSet;
use super::table::{Heading, body, count, number, sortable};
use super::text::{decimal, p_value};
use crate::{Comparison, Summary};

/// Minimum number of comparisons that are shown unfolded.
const SHOWN: usize = 12;

/// Returns the tables; `None` if no two rows share folds.
pub(super) fn section(summary: &Summary, sets: &[DataSet]) -> Option<Markup> {
    if summary.comparisons.is_empty() {
        return None;
    }
    // The most certain differences come first.
    let mut comparisons: Vec<_> = summary.comparisons.iter().collect();
    comparisons.sort_by(|one, other| {
        let p = |of: &Comparison| of.p_holm.unwrap_or(f64::INFINITY);
        let by_p = p(one).total_cmp(&p(other));
        by_p.then(other.difference.abs().total_cmp(&one.difference.abs()))
    });
    let certain = comparisons
        .iter()
        .take_while(|comparison| comparison.p_holm.is_some_and(|p| p < 0.05))
        .count();
    let shown = certain.max(SHOWN).min(comparisons.len());
    let shown = if comparisons.len() - shown > SHOWN / 2 {
        shown
    } else {
        comparisons.len()
    };
    let (first, rest) = comparisons.split_at(shown);
    Some(html! {
        p {
            "Difference of single-sweep accuracy, in percentage points, on the folds that both have. p is from the corrected "
            "resampled t-test (Nadeau and Bengio, 2003), two-sided, and after Holm's correction for the comparisons on one data set."
            @if let [set] = sets { " All rows: " (set.heading()) "." }
        }
        (table(summary, sets, first))
        @if !rest.is_empty() {
            details {
                summary { (rest.len()) " more, none of them distinguishable at 5 %" }
                (table(summary, sets, rest))
            }
        }
    })
}

fn table(summary: &Summary, sets: &[DataSet], comparisons: &[&Comparison]) -> Markup {
    // Heading of the data set, and name in it.
    let place = |key: &str| -> (String, String) {
        let contender = summary.row(key).map(|row| &row.contender);
        let mut places = sets.iter().filter_map(|set| {
            let row = set.rows.iter().find(|row| Some(&row.key) == contender)?;
            Some((set.heading(), set.name(row)))
        });
        places.next().unwrap_or_else(|| (String::new(), key.into()))
    };
    // Two compared rows are of the same data set.
    let several = sets.len() > 1;
    let mut headings = vec![
        Heading::text("First"),
        Heading::text("Second"),
        Heading::number("First \u{2212} second", "points"),
        Heading::number("p", ""),
        Heading::number("p, Holm", ""),
        Heading::number("Folds", ""),
    ];
    if several {
        headings.insert(0, Heading::text("Data"));
    }
    let rows = html! {
        @for comparison in comparisons {
            @let (data, first) = place(&comparison.first);
            @let points = 100.0 * comparison.difference;
            tr {
                @if several { td { (data) } }
                td { (first) }
                td { (place(&comparison.second).1) }
                (number(Some(points), &decimal(points, 1)))
                (number(comparison.p, &p_value(comparison.p)))
                (number(comparison.p_holm, &p_value(comparison.p_holm)))
                (count(Some(comparison.n)))
            }
        }
    };
    let caption = "Differences of accuracy on the same folds";
    sortable(
        "Paired comparisons",
        "",
        caption,
        &headings,
        &body(None, 0, &rows),
    )
}

#[cfg(test)]
mod tests {
    use super::super::data_set::data_sets;
    use super::super::fake;
    use super::*;

    /// Returns the table's HTML and its differences for pairs with these p-values.
    fn rows_of(p: &[f64]) -> (String, Vec<f64>) {
        let mut summary = fake::summary();
        let pair = summary.comparisons[0].clone();
        summary.comparisons = p
            .iter()
            .map(|&p| Comparison {
                p_holm: Some(p),
                difference: p,
                ..pair.clone()
            })
            .collect();
        let rows = summary.scored();
        let html = section(&summary, &data_sets(&rows)).unwrap().into_string();
        let points = html
            .split("<tr><td>")
            .skip(1)
            .filter_map(|row| row.split("data-value=\"").nth(1)?.split('"').next())
            .map(|points| points.parse::<f64>().unwrap().round())
            .collect();
        (html, points)
    }

    #[test]
    fn the_surest_difference_is_first_and_a_long_rest_is_folded() {
        let (html, points) = rows_of(&[0.5, 0.01, 0.9, 0.04]);
        assert_eq!(points, [1.0, 4.0, 50.0, 90.0]);
        assert!(!html.contains("<details>"));
        let many: Vec<f64> = (1..=40).rev().map(|i| f64::from(i) / 100.0).collect();
        let (html, points) = rows_of(&many);
        assert_eq!(points.len(), 40);
        assert!(points.is_sorted());
        let (shown, folded) = html.split_once("<details>").unwrap();
        assert_eq!(shown.matches("<tr><td>").count(), SHOWN);
        assert!(folded.starts_with("<summary>28 more"));
    }
}
