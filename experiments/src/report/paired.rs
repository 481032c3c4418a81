//! Pairs of rows on the same folds.

use tactnet_plot::escape;

use super::data_set::DataSet;
use super::results::Heading::{Number, Text};
use super::results::{number, sortable};
use super::text::{decimal, p_value, scroll};
use crate::{Comparison, Summary};

/// So many comparisons are shown at once if fewer are sure; the rest is folded.
const SHOWN: usize = 12;

/// Returns the table; `None` if no two rows share folds.
pub(super) fn section(summary: &Summary, sets: &[DataSet]) -> Option<String> {
    if summary.comparisons.is_empty() {
        return None;
    }
    // The heading of its data set, and its name there.
    let place = |key: &str| -> Option<(String, String)> {
        let contender = &summary.row(key)?.contender;
        sets.iter().find_map(|set| {
            let row = set.rows.iter().find(|row| row.key == contender)?;
            Some((set.heading(), set.name(row)))
        })
    };
    // Two rows that are compared are of one data set.
    let several = sets.len() > 1;
    let name = |key: &str| place(key).map_or_else(|| key.to_string(), |(_, name)| name);
    // What differs most surely stands first.
    let mut comparisons: Vec<_> = summary.comparisons.iter().collect();
    comparisons.sort_by(|one, other| {
        let p = |of: &Comparison| of.p_holm.unwrap_or(f64::INFINITY);
        let by_p = p(one).total_cmp(&p(other));
        by_p.then(other.difference.abs().total_cmp(&one.difference.abs()))
    });
    let line = |comparison: &&Comparison| {
        let points = 100.0 * comparison.difference;
        let data = if several {
            let heading = place(&comparison.first).map(|(data, _)| data);
            format!("<td>{}</td>", escape(&heading.unwrap_or_default()))
        } else {
            String::new()
        };
        format!(
            "<tr>{data}<td>{}</td><td>{}</td>{}{}{}{}</tr>\n",
            escape(&name(&comparison.first)),
            escape(&name(&comparison.second)),
            number(Some(points), &decimal(points, 1)),
            number(comparison.p, &comparison.p.map(p_value).unwrap_or_default()),
            number(
                comparison.p_holm,
                &comparison.p_holm.map(p_value).unwrap_or_default()
            ),
            number(Some(comparison.n as f64), &comparison.n.to_string())
        )
    };
    let mut headings = vec![
        Text("First"),
        Text("Second"),
        Number("First \u{2212} second<br><small>points</small>"),
        Number("p"),
        Number("p, Holm"),
        Number("Folds"),
    ];
    if several {
        headings.insert(0, Text("Data"));
    }
    let table = |of: &[&Comparison]| {
        let lines: String = of.iter().map(line).collect();
        let table = format!(
            "<table class=\"sortable\">\n<caption class=\"hidden\">Differences of accuracy on the same folds</caption>\n\
             <thead><tr>{}</tr></thead>\n<tbody>\n{lines}</tbody>\n</table>\n",
            sortable(&headings)
        );
        scroll("Paired comparisons", &table)
    };
    let sure = comparisons
        .iter()
        .take_while(|comparison| comparison.p_holm.is_some_and(|p| p < 0.05))
        .count();
    let shown = sure.max(SHOWN).min(comparisons.len());
    let (first, rest) = comparisons.split_at(shown);
    let mut tables = table(first);
    if rest.len() > SHOWN / 2 {
        tables.push_str(&format!(
            "<details><summary>{} more, none of them distinguishable at 5 %</summary>\n{}</details>\n",
            rest.len(),
            table(rest)
        ));
    } else {
        tables = table(&comparisons);
    }
    let of = match sets {
        [set] => format!(" All rows: {}.", escape(&set.heading())),
        _ => String::new(),
    };
    Some(format!(
        "<p>Difference of single-sweep accuracy, in percentage points, on the folds that both have. p is from the corrected \
         resampled t-test (Nadeau and Bengio, 2003), two-sided; beside it after Holm's correction for the comparisons on one data set.{of}</p>\n{tables}"
    ))
}

#[cfg(test)]
mod tests {
    use super::super::data_set::data_sets;
    use super::super::fake;
    use super::*;
    use crate::questions::scored;

    /// The table's rows where the pairs have these values of p.
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
        let rows = scored(&summary);
        let html = section(&summary, &data_sets(&rows)).unwrap();
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
