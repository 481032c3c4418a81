//! Splits by material into known and new ones.

use crate::{DataError, Dataset, Seed, shuffle};

/// Data set split by material. The two sides are separate data sets, so models fitted to one have not seen the other.
///
/// ```
/// use tactnet_data::twin;
/// use tactnet_data::{MaterialSplit, Seed};
///
/// let split = MaterialSplit::draw(&twin::small(6, 2, 100)?, 2, Seed(1), 0)?;
/// assert_eq!((split.known.labels().len(), split.new.labels().len()), (4, 2));
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
#[derive(Debug, Clone)]
pub struct MaterialSplit {
    /// Sweeps of the known materials, in the original order.
    pub known: Dataset,
    /// Sweeps of the new materials, in the original order.
    pub new: Dataset,
    /// Labels of the new materials in the whole data set, ascending.
    pub new_labels: Vec<usize>,
}

impl MaterialSplit {
    /// Draws `new` materials at random.
    ///
    /// - `number`: number of the draw; each gives other materials
    ///
    /// # Errors
    /// Fewer than two materials on a side.
    pub fn draw(
        dataset: &Dataset,
        new: usize,
        seed: Seed,
        number: usize,
    ) -> Result<Self, DataError> {
        let mut labels: Vec<usize> = (0..dataset.labels().len()).collect();
        shuffle(&mut labels, &mut seed.rng(("new materials", number)));
        labels.truncate(new);
        Self::of(dataset, &labels)
    }

    /// Splits off the materials with these labels as new.
    ///
    /// # Errors
    /// Fewer than two materials on a side, or a duplicate or unknown label.
    pub fn of(dataset: &Dataset, new: &[usize]) -> Result<Self, DataError> {
        let mut new_labels = new.to_vec();
        new_labels.sort_unstable();
        let known: Vec<usize> = (0..dataset.labels().len())
            .filter(|label| !new_labels.contains(label))
            .collect();
        if new_labels.len() < 2 || known.len() < 2 {
            return Err(DataError::inconsistent(
                "split by material",
                "at least two known and two new materials",
                format!("{} known, {} new", known.len(), new_labels.len()),
            ));
        }
        Ok(Self {
            known: dataset.of_materials(&known)?,
            new: dataset.of_materials(&new_labels)?,
            new_labels,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LabelSet, Samples, SweepRecord, SweepShape};

    fn five_materials() -> Dataset {
        let records: Vec<SweepRecord> = (0..15).map(|i| SweepRecord::new(i % 5, i / 5)).collect();
        let shape = SweepShape {
            steps: 2,
            rows: 1,
            cols: 1,
        };
        let labels = LabelSet::new(["a", "b", "c", "d", "e"]).unwrap();
        let samples = Samples::U8((0..30).collect());
        Dataset::new("five", 750.0, shape, labels, records, samples).unwrap()
    }

    #[test]
    fn every_sweep_is_on_the_side_of_its_material() {
        let whole = five_materials();
        let split = MaterialSplit::of(&whole, &[3, 1]).unwrap();
        let names = |set: &Dataset| set.labels().names().map(String::from).collect::<Vec<_>>();
        assert_eq!(names(&split.known), ["a", "c", "e"]);
        assert_eq!(names(&split.new), ["b", "d"]);
        assert_eq!((split.known.len(), split.new.len()), (9, 6));
        for side in [&split.known, &split.new] {
            for (index, record) in side.records().iter().enumerate() {
                let name = side.labels().name(record.label);
                let original = whole
                    .records()
                    .iter()
                    .position(|r| whole.labels().name(r.label) == name && r.sweep == record.sweep);
                assert_eq!(side.sweep(index), whole.sweep(original.unwrap()));
            }
        }
    }

    #[test]
    fn draws_are_named() {
        let whole = five_materials();
        let drawn = |seed, number| {
            MaterialSplit::draw(&whole, 2, Seed(seed), number)
                .unwrap()
                .new_labels
        };
        assert_eq!(drawn(1, 0), drawn(1, 0));
        let different: std::collections::BTreeSet<_> = (0..20).map(|n| drawn(1, n)).collect();
        assert!(different.len() > 5, "{different:?}");
        let refused = MaterialSplit::draw(&whole, 4, Seed(1), 0)
            .unwrap_err()
            .to_string();
        assert!(refused.contains("1 known, 4 new"), "{refused}");
    }
}
