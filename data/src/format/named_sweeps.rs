//! Sweeps in any order, usually with the names of their materials, as files of other programs contain them.

use std::collections::BTreeSet;

use super::lengths::OddLength;
use crate::{
    ConditionValues, DataError, Dataset, Finding, LabelSet, Samples, SweepRecord, SweepShape,
    normal_name,
};

/// Labels that a file must have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Labels {
    /// The material of every sweep.
    Needed,
    /// None, because the sweeps will be classified.
    Optional,
}

/// Name of the material of sweeps without labels.
pub(crate) const UNLABELLED: &str = "unlabelled";

/// Sweeps of equal shape with their metadata.
pub(crate) struct NamedSweeps {
    pub(crate) name: String,
    /// Sample rate, in Hz; `None` if the file does not name it.
    pub(crate) rate_hz: Option<f64>,
    pub(crate) shape: SweepShape,
    /// True if the file names the arrangement of the taxels in rows and columns.
    pub(crate) patch_known: bool,
    /// Names of the sweeps, numbers or files: `[sweeps]`.
    pub(crate) sweeps: Vec<String>,
    /// Materials, `[sweeps]`; `None` if the file does not name them.
    pub(crate) materials: Option<Vec<String>>,
    /// Block numbers, `[sweeps]`, if the file has them.
    pub(crate) blocks: Option<Vec<u32>>,
    /// Test flags, `[sweeps]`, if the file has them.
    pub(crate) test: Option<Vec<bool>>,
    /// Quantities that the file names for every sweep.
    pub(crate) conditions: Vec<ConditionValues>,
    /// Values, `[sweeps][steps][rows][cols]`.
    pub(crate) samples: Samples,
    /// Number of frames of each sweep, `[sweeps]`; `None` if all have as many as the shape.
    pub(crate) lengths: Option<Vec<usize>>,
    /// Findings that only the reader can make.
    pub(crate) findings: Vec<Finding>,
    /// Sweeps that were cut because they are longer, or omitted because they are shorter.
    pub(crate) odd_lengths: Vec<OddLength>,
}

impl NamedSweeps {
    /// Returns a data set with the materials sorted by name, or by value if they are whole numbers.
    ///
    /// # Errors
    /// A sweep without a material; errors of [`Dataset::new`].
    pub(super) fn into_dataset(self) -> Result<Dataset, DataError> {
        let materials = self
            .materials
            .unwrap_or_else(|| vec![UNLABELLED.into(); self.sweeps.len()]);
        let materials: Vec<String> = materials.iter().map(|name| normal_name(name)).collect();
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
        )?
        .with_known_lengths(self.lengths)?;
        let dataset = if self.patch_known {
            dataset
        } else {
            dataset.with_assumed_patch()
        };
        let dataset = dataset.with_reading_findings(self.findings);
        dataset.with_conditions(&self.conditions)
    }
}

/// Returns the names in backquotes, at most [`NAMED`].
pub(crate) fn some_names<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let quoted: Vec<String> = names.into_iter().map(|name| format!("`{name}`")).collect();
    some_of(quoted)
}

/// Joins the parts of a list, at most [`NAMED`].
pub(super) fn some_of(mut parts: Vec<String>) -> String {
    let hidden = parts.len().saturating_sub(NAMED);
    parts.truncate(NAMED);
    let shown = parts.join(", ");
    match hidden {
        0 => shown,
        hidden => format!("{shown} and {hidden} more"),
    }
}

/// Maximum number of names in a message.
pub(super) const NAMED: usize = 8;

/// Returns the distinct names, sorted; whole numbers by their value.
pub(super) fn sorted_names(names: &[String]) -> Vec<String> {
    let unique: BTreeSet<&String> = names.iter().collect();
    let mut names: Vec<String> = unique.into_iter().cloned().collect();
    let numbers: Option<Vec<i64>> = names.iter().map(|name| name.parse().ok()).collect();
    if numbers.is_some() {
        names.sort_by_key(|name| name.parse::<i64>().unwrap_or_default());
    }
    names
}

/// Returns the number of the block of each sweep: whole numbers as they are, words by their order.
pub(super) fn block_numbers(blocks: &[String]) -> Vec<u32> {
    let numbers: Option<Vec<u32>> = blocks.iter().map(|block| block.parse().ok()).collect();
    numbers.unwrap_or_else(|| {
        let names = sorted_names(blocks);
        let number = |block| names.iter().position(|name| name == block);
        blocks
            .iter()
            .filter_map(number)
            .map(|at| at as u32)
            .collect()
    })
}

/// Returns one record per sweep; the sweeps of a label are numbered in order.
pub(crate) fn records(
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
