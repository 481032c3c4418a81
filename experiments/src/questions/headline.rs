//! The result that a report begins with, and the one sentence that qualifies it.

use crate::Row;

/// A result with what it is to be judged by, as plain text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Headline {
    /// The number with its unit.
    pub(crate) value: String,
    /// Its 95 % interval; `None` with one task, or where all tasks are alike.
    pub(crate) interval: Option<String>,
    /// Tasks that it is the mean of.
    pub(crate) tasks: usize,
    /// What it is a share or number of.
    pub(crate) says: String,
    /// One sentence: chance, what levels alone reach, what it costs.
    pub(crate) qualifier: String,
}

impl Headline {
    /// Returns the headline of a row that is shown in percent.
    pub(crate) fn of(row: &Row, says: String, qualifier: String) -> Self {
        Self {
            value: in_percent(row.statistic.mean),
            interval: row.statistic.ci95.map(interval),
            tasks: row.statistic.values.len(),
            says,
            qualifier,
        }
    }
}

/// Returns a share with one decimal: "84.5 %".
pub(crate) fn in_percent(share: f64) -> String {
    format!("{:.1}\u{a0}%", 100.0 * share)
}

/// Returns the ends of an interval of shares, percent: "[82.7, 86.3]".
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

/// Returns the row with the largest mean.
pub(crate) fn best<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<&'a Row> {
    rows.max_by(|a, b| a.statistic.mean.total_cmp(&b.statistic.mean))
}
