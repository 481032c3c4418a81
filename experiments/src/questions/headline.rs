//! The main result of a report, and the sentence that qualifies it.

use std::cmp::Reverse;

use crate::interval_note::interval_note;
use crate::phrases::{in_percent, interval, rank};
use crate::row::Row;

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

/// Returns the row with the largest mean, or the first of several.
pub(crate) fn best<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<&'a Row> {
    rows.min_by_key(|row| Reverse(rank(row.statistic.mean)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::tests as rows;
    use crate::{Measure, Statistic};

    #[test]
    fn of_rows_that_tie_but_for_rounding_the_first_is_the_best() {
        let row = |method: &str, mean: f64| Row {
            statistic: Statistic::of(vec![mean], 0.0),
            ..rows::row("twin", "net", method, Measure::Accuracy)
        };
        let sum: f64 = [0.1, 0.2, 0.3].iter().sum();
        let rows = [row("a", 0.3), row("b", sum), row("c", 0.6), row("d", 0.5)];
        assert!(sum > rows[2].statistic.mean);
        let first = |rows: &[&Row]| best(rows.iter().copied()).unwrap().method.clone();
        assert_eq!(first(&[&rows[0], &rows[1], &rows[2], &rows[3]]), "b");
        assert_eq!(first(&[&rows[0], &rows[2], &rows[1], &rows[3]]), "c");
    }
}
