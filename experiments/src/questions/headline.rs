//! The main result of a report, and the sentence that qualifies it.

use std::cmp::Reverse;

use crate::Row;
use crate::interval_note::interval_note;

/// A main result as plain text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Headline {
    /// The number with its unit.
    pub(crate) value: String,
    /// 95 % interval; `None` with one task, or if all tasks are equal.
    pub(crate) interval: Option<String>,
    /// Reason for a missing or wide interval.
    pub(crate) interval_note: Option<String>,
    /// Meaning of the number.
    pub(crate) says: String,
    /// Qualification: chance, accuracy by levels alone, or cost.
    pub(crate) qualifier: String,
}

impl Headline {
    /// Returns the headline of a row in percent.
    pub(crate) fn of(row: &Row, says: String, qualifier: String) -> Self {
        Self {
            value: in_percent(row.statistic.mean),
            interval: row.statistic.ci95.map(interval),
            interval_note: interval_note(&row.statistic, "task"),
            says,
            qualifier,
        }
    }
}

/// Formats a share with one decimal: "84.5 %".
pub(crate) fn in_percent(share: f64) -> String {
    format!("{:.1}\u{a0}%", 100.0 * share)
}

/// Formats an interval of shares in percent: "[82.7, 86.3]".
pub(crate) fn interval([low, high]: [f64; 2]) -> String {
    format!("[{:.1}, {:.1}]", 100.0 * low, 100.0 * high)
}

/// Returns "one sweep" or "3 sweeps".
pub(crate) fn sweeps(count: usize) -> String {
    match count {
        1 => "one sweep".into(),
        count => format!("{count} sweeps"),
    }
}

/// Joins names that may contain commas: "a", "a and b", "a; b; c", "a; b; and 3 others".
pub(crate) fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [one, two] => format!("{one} and {two}"),
        [one, two, three] => format!("{one}; {two}; {three}"),
        [one, two, others @ ..] => format!("{one}; {two}; and {} others", others.len()),
    }
}

/// Returns the row with the largest mean, or the first of several.
pub(crate) fn best<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<&'a Row> {
    rows.min_by_key(|row| Reverse(rank(row.statistic.mean)))
}

/// Returns the sort key of a mean; means that only differ by rounding are equal.
pub(crate) fn rank(mean: f64) -> i64 {
    (1e9 * mean).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fake;
    use crate::{Measure, Statistic};

    #[test]
    fn long_lists_of_names_are_cut_short() {
        let many: Vec<String> = (0..5).map(|k| k.to_string()).collect();
        assert_eq!(listed(&many), "0; 1; and 3 others");
        assert_eq!(listed(&many[..3]), "0; 1; 2");
    }

    #[test]
    fn of_rows_that_tie_but_for_rounding_the_first_is_the_best() {
        let row = |method: &str, mean: f64| Row {
            statistic: Statistic::of(vec![mean], 0.0),
            ..fake::row("twin", "net", method, Measure::Accuracy)
        };
        let sum: f64 = [0.1, 0.2, 0.3].iter().sum();
        let rows = [row("a", 0.3), row("b", sum), row("c", 0.6), row("d", 0.5)];
        assert!(sum > rows[2].statistic.mean);
        let first = |rows: &[&Row]| best(rows.iter().copied()).unwrap().method.clone();
        assert_eq!(first(&[&rows[0], &rows[1], &rows[2], &rows[3]]), "b");
        assert_eq!(first(&[&rows[0], &rows[2], &rows[1], &rows[3]]), "c");
    }
}
