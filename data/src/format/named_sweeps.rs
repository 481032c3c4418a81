//! Sweeps in any order, most of the time with the names of their materials: what files of other programs hold.

use std::collections::BTreeSet;

use super::lengths::OddLength;
use crate::{DataError, Dataset, LabelSet, Samples, SweepRecord, SweepShape};

/// What a file must say of its sweeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Labels {
    /// The material of each.
    Needed,
    /// Nothing: they are to be classified.
    Optional,
}

/// Stands for the material of sweeps of which a file says none.
pub(crate) const UNLABELLED: &str = "unlabelled";

/// Sweeps of equal shape, each with its material.
pub(super) struct NamedSweeps {
    pub(super) name: String,
    /// Frames per second; `None` where the file does not say.
    pub(super) rate_hz: Option<f64>,
    pub(super) shape: SweepShape,
    /// True if the file says how taxels are arranged in rows and columns.
    pub(super) patch_known: bool,
    /// `[sweeps]`: numbers or files, as people call them
    pub(super) sweeps: Vec<String>,
    /// `[sweeps]`; `None` where the file does not say
    pub(super) materials: Option<Vec<String>>,
    /// `[sweeps]`, where the file has them
    pub(super) blocks: Option<Vec<u32>>,
    /// `[sweeps]`, where the file has them
    pub(super) test: Option<Vec<bool>>,
    /// `[sweeps][steps][rows][cols]`
    pub(super) samples: Samples,
    /// What is not read, a sentence for each thing.
    pub(super) left_out: Vec<String>,
    /// Sweeps that are longer, and were cut, or shorter, and were left out.
    pub(super) odd_lengths: Vec<OddLength>,
}

impl NamedSweeps {
    /// Labels the materials in the order of their names, whole numbers by their value.
    ///
    /// # Errors
    /// A sweep without a name of its material; as [`Dataset::new`].
    pub(super) fn into_dataset(self) -> Result<Dataset, DataError> {
        let materials = self
            .materials
            .unwrap_or_else(|| vec![UNLABELLED.into(); self.sweeps.len()]);
        if let Some(nameless) = materials.iter().position(|name| name.trim().is_empty()) {
            return Err(DataError::inconsistent(
                format!("material of sweep `{}`", self.sweeps[nameless]),
                "a name",
                "none",
            ));
        }
        let names = sorted_names(&materials);
        let place = |name: &String| names.iter().position(|other| other == name);
        let of_sweep: Vec<usize> = materials.iter().filter_map(place).collect();
        let labels = LabelSet::new(names)?;
        let records = records(&of_sweep, labels.len(), self.blocks, self.test);
        let dataset = Dataset::at_rate(
            self.name,
            self.rate_hz,
            self.shape,
            labels,
            records,
            self.samples,
        )?;
        let dataset = if self.patch_known {
            dataset
        } else {
            dataset.with_assumed_patch()
        };
        Ok(dataset.leaving_out(self.left_out))
    }
}

/// Names in backquotes, of many the first.
pub(super) fn some_names<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let quoted: Vec<String> = names.into_iter().map(|name| format!("`{name}`")).collect();
    some_of(quoted)
}

/// Parts of a list, of many the first.
pub(super) fn some_of(mut parts: Vec<String>) -> String {
    let hidden = parts.len().saturating_sub(NAMED);
    parts.truncate(NAMED);
    let shown = parts.join(", ");
    match hidden {
        0 => shown,
        hidden => format!("{shown} and {hidden} more"),
    }
}

/// Names given of a list.
pub(super) const NAMED: usize = 8;

/// Returns every name once, in order; whole numbers by their value.
pub(super) fn sorted_names(names: &[String]) -> Vec<String> {
    let unique: BTreeSet<&String> = names.iter().collect();
    let mut names: Vec<String> = unique.into_iter().cloned().collect();
    let numbers: Option<Vec<i64>> = names.iter().map(|name| name.parse().ok()).collect();
    if numbers.is_some() {
        names.sort_by_key(|name| name.parse::<i64>().unwrap_or_default());
    }
    names
}

/// One record per sweep; the sweeps of a label are numbered in their order.
pub(super) fn records(
    labels: &[usize],
    materials: usize,
    blocks: Option<Vec<u32>>,
    test: Option<Vec<bool>>,
) -> Vec<SweepRecord> {
    let mut seen = vec![0; materials];
    labels
        .iter()
        .enumerate()
        .map(|(index, &label)| {
            seen[label] += 1;
            SweepRecord {
                label,
                sweep: seen[label] - 1,
                block: blocks.as_ref().map(|blocks| blocks[index]),
                test: test.as_ref().map(|test| test[index]),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_names_the_first_are_given() {
        assert_eq!(some_names(["a", "b"]), "`a`, `b`");
        let long = some_names(["x"; NAMED + 3]);
        assert!(long.ends_with("`x` and 3 more"), "{long}");
    }

    #[test]
    fn numbers_are_in_the_order_of_their_value_and_words_of_their_letters() {
        let sorted = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
            sorted_names(&names).join(" ")
        };
        assert_eq!(sorted(&["10", "2", "10", "-1"]), "-1 2 10");
        assert_eq!(sorted(&["wood", "10", "2"]), "10 2 wood");
    }
}
