//! Groups the rows of a summary by data set, since only such rows are comparable.

use std::cmp::Reverse;

use tactnet_pipeline::{MeanRemoval, SplitKind};

use crate::phrases::rank;
use crate::scored::Scored;

/// The rows on one data set with the same treatment of levels.
pub(super) struct DataSet<'a> {
    /// Name of the data set.
    pub data: &'a str,
    /// Treatment of the mean of each taxel.
    pub levels: MeanRemoval,
    /// Rows in the order of the summary.
    pub rows: Vec<&'a Scored<'a>>,
}

impl<'a> DataSet<'a> {
    /// Returns the name of the data set with the treatment of levels.
    pub fn heading(&self) -> String {
        format!("{}, levels {}", self.data, self.levels.name())
    }

    /// Returns the rows that are not probes, most accurate first.
    pub fn contenders(&self) -> Vec<&'a Scored<'a>> {
        self.most_accurate_first(false)
    }

    /// Returns the rows that are probes, most accurate first.
    pub fn probes(&self) -> Vec<&'a Scored<'a>> {
        self.most_accurate_first(true)
    }

    fn most_accurate_first(&self, probe: bool) -> Vec<&'a Scored<'a>> {
        let own = self.rows.iter().copied();
        let mut rows: Vec<&'a Scored<'a>> = own.filter(|row| row.probe == probe).collect();
        // Equal rows keep the order of the summary.
        rows.sort_by_key(|row| Reverse(rank(row.one_sweep.mean)));
        rows
    }

    /// Returns the most accurate contender, or the first of several; of those on held-out blocks if there are any.
    pub fn best(&self) -> Option<&'a Scored<'a>> {
        self.headlined().first().copied()
    }

    /// Returns the contenders whose numbers are the headline, most accurate first: those on held-out blocks if there are
    /// any, since random folds have sweeps of the same recordings in training.
    pub fn headlined(&self) -> Vec<&'a Scored<'a>> {
        let mut rows = self.contenders();
        rows.retain(|row| row.shots.is_none());
        if rows.iter().any(|row| row.split_kind.holds_out_blocks()) {
            rows.retain(|row| row.split_kind.holds_out_blocks());
        }
        rows
    }

    /// Returns the accuracy of a contender on random folds of the same data.
    pub fn on_random_folds(&self, of: &Scored<'_>) -> Option<f64> {
        let is_same = |row: &&&Scored<'_>| {
            row.model == of.model
                && row.prediction == of.prediction
                && (row.steps, row.shots) == (of.steps, of.shots)
                && row.split_kind == SplitKind::KFold
        };
        self.rows.iter().find(is_same).map(|row| row.one_sweep.mean)
    }

    /// Returns the names of contenders that are as accurate as the best one.
    pub fn tied(&self) -> Vec<String> {
        let rows = self.headlined();
        let (Some(best), others) = (rows.first(), rows.iter().skip(1)) else {
            return Vec::new();
        };
        let tied = others.filter(|row| {
            row.key != best.key && rank(row.one_sweep.mean) == rank(best.one_sweep.mean)
        });
        tied.map(|row| self.name(row)).collect()
    }

    /// Returns the shortest name that distinguishes `row` from the others here.
    pub fn name(&self, row: &Scored<'_>) -> String {
        let mut name = row.name();
        if self.rows.iter().any(|other| other.split != row.split) {
            name.push_str(", ");
            name.push_str(&split_name(&row.split));
        }
        if self.rows.iter().any(|other| other.steps != row.steps) {
            name.push_str(&format!(", {} steps", row.steps));
        }
        name
    }
}

/// Returns the display name of a split.
pub(super) fn split_name(split: &str) -> String {
    split.replace('_', "-")
}

/// Groups contenders by data set, in the order of their first row.
pub(super) fn data_sets<'a>(contenders: &'a [Scored<'a>]) -> Vec<DataSet<'a>> {
    let mut sets: Vec<DataSet> = Vec::new();
    for row in contenders {
        let known = sets
            .iter_mut()
            .find(|set| set.data == row.data && set.levels == row.levels);
        match known {
            Some(set) => set.rows.push(row),
            None => sets.push(DataSet {
                data: &row.data,
                levels: row.levels,
                rows: vec![row],
            }),
        }
    }
    sets
}

#[cfg(test)]
mod tests {
    use super::super::fake;
    use super::*;

    #[test]
    fn a_name_says_what_tells_rows_apart_and_no_more() {
        let mut summary = fake::tactmat();
        let rows = summary.scored();
        assert_eq!(data_sets(&rows)[0].name(&rows[0]), "net, MC dropout");
        summary.contenders[1].steps = 100;
        summary.contenders[1].split = "leave_one_block_out".into();
        let rows = summary.scored();
        let sets = data_sets(&rows);
        assert_eq!(
            sets[0].name(&rows[0]),
            "net, MC dropout, k-fold, 1000 steps"
        );
        assert_eq!(
            sets[0].name(&rows[1]),
            "knn, MC dropout, leave-one-block-out, 100 steps"
        );
    }

    #[test]
    fn the_best_contender_is_no_probe() {
        let mut summary = fake::tactmat();
        summary.contenders[0].probe = true;
        let rows = summary.scored();
        assert_eq!(data_sets(&rows)[0].best().unwrap().model, "knn");
    }
}
