//! Materials that coincide with recording blocks.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use super::finding;
use crate::format::some_names;
use crate::{Dataset, Finding, FindingKind, Place, Severity};

/// Materials that coincide with recording blocks: recognising the recording then looks like recognising the material.
/// Its text is a sentence.
///
/// ```
/// use tactnet_data::{Confounding, Dataset, LabelSet, Samples, SweepRecord, SweepShape};
///
/// // `cork` was recorded in a separate session; the others share two sessions.
/// let sessions = [(0, 1), (0, 1), (1, 2), (2, 2), (1, 3), (2, 3)];
/// let record = |(label, block)| SweepRecord { label, sweep: 0, block: Some(block), test: None };
/// let shape = SweepShape { steps: 1, rows: 1, cols: 1 };
/// let labels = LabelSet::new(["cork", "denim", "felt"])?;
/// let records = sessions.map(record).to_vec();
/// let dataset = Dataset::new("floors", 100.0, shape, labels, records, Samples::U8(vec![0, 1, 2, 3, 4, 5]))?;
/// let found = Confounding::of(&dataset).expect("cork coincides with session 1");
/// assert_eq!((found.confounded, found.unconfounded), (vec![0], vec![1, 2]));
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Confounding {
    /// Labels of the materials whose sweeps are all in one block that holds at most half of the materials; at least one.
    pub confounded: Vec<usize>,
    /// Labels of the other materials whose blocks all hold further materials, so that recognising the recording does not suffice.
    pub unconfounded: Vec<usize>,
    /// Number of all materials.
    pub materials: usize,
}

impl Confounding {
    /// Returns the materials of a data set that coincide with blocks; `None` if there are none, or no blocks.
    pub fn of(dataset: &Dataset) -> Option<Self> {
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
            Some(block) if of_label[*label].len() == 1 => {
                2 * of_block[block].len() <= materials.max(2)
            }
            _ => false,
        };
        let is_shared = |label: &usize| {
            of_label[*label]
                .iter()
                .all(|block| of_block[block].len() > 1)
        };
        let (confounded, others): (Vec<usize>, Vec<usize>) =
            (0..materials).partition(is_confounded);
        (!confounded.is_empty()).then(|| Self {
            confounded,
            unconfounded: others.into_iter().filter(is_shared).collect(),
            materials,
        })
    }

    /// Returns the sentence with the names of the confounded materials and their share of the sweeps.
    pub fn message(&self, dataset: &Dataset) -> String {
        let counts = dataset.sweeps_per_label();
        let sweeps: usize = self.confounded.iter().map(|label| counts[*label]).sum();
        let names = self
            .confounded
            .iter()
            .map(|label| dataset.labels().name(*label));
        format!(
            "{self} ({:.0} % of the sweeps: {})",
            100.0 * sweeps as f64 / dataset.len() as f64,
            some_names(names),
        )
    }
}

impl fmt::Display for Confounding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} materials were recorded in one session each: this accuracy cannot be told from recognising the session",
            self.confounded.len(),
            self.materials
        )
    }
}

/// Returns a warning about the materials of [`Confounding::of`].
pub(super) fn confounded(dataset: &Dataset) -> Option<Finding> {
    let found = Confounding::of(dataset)?;
    let at = Place {
        material: found
            .confounded
            .first()
            .map(|label| dataset.labels().name(*label).into()),
        ..Place::default()
    };
    Some(finding(
        Severity::Warning,
        FindingKind::ConfoundedBlocks,
        at,
        found.message(dataset),
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
        for part in ["2 of 4 materials", "38 % of the sweeps: `m0`, `m1`"] {
            assert!(message.contains(part), "{part}: {message}");
        }
    }

    #[test]
    fn one_session_with_all_materials_and_several_sessions_are_sound() {
        assert!(confounded(&of(&[(0, 0), (1, 0), (2, 0)])).is_none());
        assert!(confounded(&of(&[(0, 0), (1, 0), (0, 1), (1, 1)])).is_none());
    }
    /// A robot with ten floors of which eight were recorded in one session each.
    #[test]
    fn eight_of_ten_floors_of_one_session_each_are_said_in_one_sentence() {
        let mut sweeps: Vec<(usize, u32)> = (0..8)
            .flat_map(|floor| [(floor, floor as u32); 5])
            .collect();
        for session in 8..12 {
            sweeps.extend([(8, session), (9, session)]);
        }
        let message = confounded(&of(&sweeps)).unwrap().message;
        let sentence = "8 of 10 materials were recorded in one session each: this accuracy cannot be told from \
                        recognising the session (83 % of the sweeps: ";
        assert!(message.starts_with(sentence), "{message}");
        assert_eq!(Confounding::of(&of(&sweeps)).unwrap().unconfounded, [8, 9]);
        // A floor that has separate sessions can still be recognised by them.
        sweeps.push((9, 12));
        assert_eq!(Confounding::of(&of(&sweeps)).unwrap().unconfounded, [8]);
    }
}
