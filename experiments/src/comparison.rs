//! Paired comparisons of two contenders on the same tasks.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::measure::method_name;
use crate::questions::Compared;
use crate::{Part, Row, Statistic, holm, resampled_t_test};

/// Paired comparison of two rows on their common tasks, with a corrected resampled t-test (Nadeau & Bengio, 2003).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Key of the first row.
    pub first: String,
    /// Key of the second row.
    pub second: String,
    /// Mean difference, first minus second, in the measure's unit.
    pub difference: f64,
    /// 95 % interval of the difference; absent with a single task.
    pub ci95: Option<[f64; 2]>,
    /// Two-sided p-value for a difference of zero; absent with a single task.
    pub p: Option<f64>,
    /// p-value after Holm's correction for all comparisons of the same measure, data set, levels and split in this
    /// report.
    #[serde(default)]
    pub p_holm: Option<f64>,
    /// Number of common tasks.
    pub n: usize,
}

/// Returns the label of `row` in a comparison with `other`: the network if the networks differ, else the method.
pub fn name_in_comparison<'a>(row: &'a Row, other: &Row) -> &'a str {
    if row.model == other.model {
        method_name(&row.method)
    } else {
        &row.model
    }
}

/// A row together with the tasks behind its values, in the same order.
pub(crate) struct RowOfTasks {
    pub(crate) row: Row,
    /// Part of the data and SHA-256 of the split, for each task.
    pub(crate) tasks: Vec<(Part, String)>,
    /// Number of test sweeps divided by number of training sweeps.
    pub(crate) test_share: f64,
    /// True for a probe, which is not a contender.
    pub(crate) probe: bool,
}

/// Compares each row with the rows that `of` selects for its measure.
pub(crate) fn comparisons(
    rows: &[RowOfTasks],
    of: impl Fn(crate::Measure) -> Option<Compared>,
) -> Vec<Comparison> {
    let mut found: Vec<(Family, Comparison)> = Vec::new();
    for (position, first) in rows.iter().enumerate() {
        let Some(compared) = of(first.row.measure) else {
            continue;
        };
        let others = match compared {
            Compared::With(_) => rows,
            _ => &rows[position + 1..],
        };
        let others = others.iter().filter(|second| {
            is_compared(compared, first, second) && alike(&first.row, &second.row)
        });
        found.extend(
            others.filter_map(|second| Some((family(&first.row), compare(first, second)?))),
        );
    }
    let families: BTreeSet<Family> = found.iter().map(|(family, _)| family.clone()).collect();
    for family in families {
        let mut members: Vec<&mut Comparison> = found
            .iter_mut()
            .filter(|(of, _)| *of == family)
            .map(|(_, comparison)| comparison)
            .collect();
        let raw: Vec<f64> = members
            .iter()
            .filter_map(|comparison| comparison.p)
            .collect();
        let mut adjusted = holm(&raw).into_iter();
        for comparison in members
            .iter_mut()
            .filter(|comparison| comparison.p.is_some())
        {
            comparison.p_holm = adjusted.next();
        }
    }
    found
        .into_iter()
        .map(|(_, comparison)| comparison)
        .collect()
}

/// Returns true if `first` is compared with `second`.
fn is_compared(compared: Compared, first: &RowOfTasks, second: &RowOfTasks) -> bool {
    let (a, b) = (&first.row, &second.row);
    match compared {
        Compared::With(reference) => {
            a.method != reference && b.method == reference && a.model == b.model
        }
        Compared::Networks { sweeps } => {
            a.sweeps == Some(sweeps) && a.method == b.method && a.model != b.model
        }
        Compared::WithEachOther { sweeps } => {
            a.sweeps == Some(sweeps) && !first.probe && !second.probe
        }
    }
}

/// Key of the comparisons that are corrected together: measure, data set, levels, split.
type Family = (String, String, String, String);

fn family(row: &Row) -> Family {
    (
        row.measure.name().into(),
        row.data.clone(),
        row.levels.name().into(),
        row.setting.clone(),
    )
}

/// Returns true if two rows differ only in network and method.
fn alike(a: &Row, b: &Row) -> bool {
    let place = |row: &Row| (row.measure, row.levels, row.steps, row.shots, row.sweeps);
    place(a) == place(b) && (&a.data, &a.setting) == (&b.data, &b.setting)
}

fn compare(first: &RowOfTasks, second: &RowOfTasks) -> Option<Comparison> {
    let values = |of: &RowOfTasks| of.row.statistic.values.clone();
    let theirs = values(second);
    let differences: Vec<f64> = first
        .tasks
        .iter()
        .zip(values(first))
        .filter_map(|(task, own)| {
            let position = second.tasks.iter().position(|other| other == task)?;
            Some(own - theirs[position])
        })
        .collect();
    if differences.is_empty() {
        return None;
    }
    let p = resampled_t_test(&differences, first.test_share);
    let n = differences.len();
    let statistic = Statistic::of(differences, first.test_share);
    Some(Comparison {
        first: first.row.key.clone(),
        second: second.row.key.clone(),
        difference: statistic.mean,
        ci95: statistic.ci95,
        p,
        p_holm: None,
        n,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Measure;
    use crate::row::tests as rows;

    fn row(method: &str, of: &[(usize, f64)]) -> RowOfTasks {
        let values: Vec<f64> = of.iter().map(|(_, value)| *value).collect();
        RowOfTasks {
            row: Row {
                key: method.into(),
                statistic: Statistic::of(values, 0.25),
                ..rows::row("twin", "net", method, Measure::Accuracy)
            },
            tasks: of
                .iter()
                .map(|(fold, _)| (Part::Draw(*fold), format!("split {fold}")))
                .collect(),
            test_share: 0.25,
            probe: false,
        }
    }

    /// Values are paired by fold in any order; folds that only one row has are dropped.
    #[test]
    fn differences_are_first_minus_second_on_the_same_folds() {
        let first = row("net", &[(0, 0.9), (1, 0.5), (2, 0.8), (3, 0.1)]);
        let second = row("lda", &[(2, 0.7), (0, 0.8), (1, 0.3)]);
        let found = compare(&first, &second).unwrap();
        assert_eq!(
            (found.first.as_str(), found.second.as_str()),
            ("net", "lda")
        );
        assert_eq!(found.n, 3);
        // 0.1, 0.2 and 0.1.
        assert!((found.difference - 0.4 / 3.0).abs() < 1e-12, "{found:?}");
        let ends = found.ci95.unwrap();
        let differences = Statistic::of(vec![0.1, 0.2, 0.1], 0.25);
        for (found, expected) in ends.iter().zip(differences.ci95.unwrap()) {
            assert!((found - expected).abs() < 1e-12);
        }
    }
}
