//! Materials that coincide with recording blocks.

use std::collections::{BTreeMap, BTreeSet};

use super::finding;
use crate::format::some_names;
use crate::{Dataset, Finding, FindingKind, Place, Severity};

/// Returns a warning if materials were recorded in a single block that holds at most half of all materials: recognising
/// the recording then looks like recognising the material. [`check`](crate::check()) includes it.
pub fn confounded(dataset: &Dataset) -> Option<Finding> {
    let materials = dataset.labels().len();
    if !dataset.has_blocks() || materials < 2 {
        return None;
    }
    let mut of_block: BTreeMap<u32, BTreeSet<usize>> = BTreeMap::new();
    let mut of_label: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); materials];
    for record in dataset.records() {
        let block = record.block?;
        of_block.entry(block).or_default().insert(record.label);
        of_label[record.label].insert(block);
    }
    let is_confounded = |label: &usize| match of_label[*label].first() {
        Some(block) if of_label[*label].len() == 1 => 2 * of_block[block].len() <= materials.max(2),
        _ => false,
    };
    let found: Vec<usize> = (0..materials).filter(is_confounded).collect();
    let first = *found.first()?;
    let counts = dataset.sweeps_per_label();
    let sweeps: usize = found.iter().map(|label| counts[*label]).sum();
    let names = some_names(found.iter().map(|label| dataset.labels().name(*label)));
    let message = format!(
        "{} of {materials} materials were recorded in one block each ({:.0} % of the sweeps; {names}): their accuracy cannot be told from \
         recognising the recording",
        found.len(),
        100.0 * sweeps as f64 / dataset.len() as f64,
    );
    let at = Place {
        material: Some(dataset.labels().name(first).into()),
        ..Place::default()
    };
    Some(finding(
        Severity::Warning,
        FindingKind::ConfoundedBlocks,
        at,
        message,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LabelSet, Samples, SweepRecord, SweepShape};

    /// Returns a data set with a sweep for each `(material, block)`.
    fn of(sweeps: &[(usize, u32)]) -> Dataset {
        let materials = 1 + sweeps.iter().map(|(material, _)| *material).max().unwrap();
        let record = |(sweep, &(label, block)): (usize, &(usize, u32))| SweepRecord {
            label,
            sweep,
            block: Some(block),
            test: None,
        };
        let shape = SweepShape {
            steps: 1,
            rows: 1,
            cols: 1,
        };
        let labels = LabelSet::new((0..materials).map(|label| format!("m{label}"))).unwrap();
        let records = sweeps.iter().enumerate().map(record).collect();
        let values = Samples::U8((0..sweeps.len() as u8).collect());
        Dataset::new("blocks", 100.0, shape, labels, records, values).unwrap()
    }

    #[test]
    fn materials_of_one_block_each_are_counted_with_their_share() {
        // Materials 0 and 1 have one block each, 2 and 3 share two blocks.
        let found = confounded(&of(&[
            (0, 0),
            (0, 0),
            (1, 1),
            (2, 2),
            (2, 3),
            (3, 2),
            (3, 3),
            (3, 3),
        ]));
        let message = found.unwrap().message;
        for part in ["2 of 4 materials", "38 % of the sweeps", "`m0`, `m1`"] {
            assert!(message.contains(part), "{part}: {message}");
        }
    }

    #[test]
    fn one_session_with_all_materials_and_several_sessions_are_sound() {
        assert!(confounded(&of(&[(0, 0), (1, 0), (2, 0)])).is_none());
        assert!(confounded(&of(&[(0, 0), (1, 0), (0, 1), (1, 1)])).is_none());
    }
}
