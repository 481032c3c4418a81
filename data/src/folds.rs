//! Splits of a data set into training and test sweeps.
//!
//! ```text
//! Dataset ── Scheme, seed, repeat, fold ──> Fold { train, test } ──> SplitManifest
//!                                          └─ inner(i) ──> (TrainSplit, ValidationSplit)
//! ```

mod groups;
mod manifest;
mod scheme;
mod split;
mod train_split;

pub use manifest::SplitManifest;
pub use scheme::Scheme;
pub use split::{SweepView, TestSplit, ValidationSplit};
pub use train_split::TrainSplit;

use crate::{DataError, Dataset, Seed, shuffle};
use groups::Groups;
use scheme::blocks_of_each_label;
use split::SplitKey;

/// One split of a data set into training and test sweeps. It depends only on the data set's content, the scheme, the
/// seed, the repeat and the fold.
///
/// ```
/// use tactnet_data::twin;
/// use tactnet_data::{Fold, Scheme, Seed};
///
/// let dataset = twin::small(2, 10, 100)?;
/// let fold = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0)?;
/// assert_eq!((fold.train.len(), fold.test.len()), (16, 4));
///
/// // A second split of the training sweeps chooses settings without the test sweeps.
/// let (train, validation) = fold.inner(0)?;
/// assert_eq!(train.len() + validation.len(), 16);
///
/// // A manifest repeats the split later.
/// let same = fold.manifest().fold(&dataset)?;
/// assert_eq!(same.test.indices(), fold.test.indices());
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Fold<'a> {
    /// Training sweeps.
    pub train: TrainSplit<'a>,
    /// Test sweeps.
    pub test: TestSplit<'a>,
    dataset: &'a Dataset,
    scheme: Scheme,
    seed: Seed,
    repeat: usize,
    fold: usize,
}

impl<'a> Fold<'a> {
    /// Usual number of parts of [`Fold::inner`]: 100 sweeps of a material in 5 outer folds give the 64/16 split that
    /// TactNet-II's settings were chosen on (Tulbure & Bäuml, Humanoids 2018).
    pub const INNER_FOLDS: usize = 5;

    /// Splits `dataset`.
    ///
    /// - `repeat`: repetition, below [`Scheme::repeats`]
    /// - `fold`: fold of that repeat, below [`Scheme::folds`]
    ///
    /// # Errors
    /// No such repeat or fold; a material with fewer sweeps than folds; errors of [`Scheme::folds`]; a `test_flag` that
    /// leaves one side empty.
    pub fn new(
        dataset: &'a Dataset,
        scheme: Scheme,
        seed: Seed,
        repeat: usize,
        fold: usize,
    ) -> Result<Self, DataError> {
        let folds = scheme.folds(dataset)?;
        for (item, limit, found) in [("repeat", scheme.repeats(), repeat), ("fold", folds, fold)] {
            if found >= limit {
                return Err(DataError::inconsistent(
                    item,
                    format!("a number below {limit} to {scheme}"),
                    found.to_string(),
                ));
            }
        }
        let key = SplitKey {
            scheme,
            seed,
            repeat,
            fold,
        };
        let tested = tested(dataset, key)?;
        let (test, train): (Vec<usize>, Vec<usize>) = (0..dataset.len()).partition(|&i| tested[i]);
        if train.is_empty() || (test.is_empty() && scheme != Scheme::TrainOnAll) {
            return Err(DataError::inconsistent(
                format!("`test_flag` of data set `{}`", dataset.name()),
                "training and test sweeps",
                format!("{} training, {} test", train.len(), test.len()),
            ));
        }
        Ok(Self {
            train: TrainSplit::new(dataset, train, key),
            test: TestSplit::new(dataset, test),
            dataset,
            scheme,
            seed,
            repeat,
            fold,
        })
    }

    /// Returns the scheme of the split.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// Returns the seed of the random choices.
    pub fn seed(&self) -> Seed {
        self.seed
    }

    /// Returns the number of the repetition.
    pub fn repeat(&self) -> usize {
        self.repeat
    }

    /// Returns the number of the fold in its repeat.
    pub fn fold(&self) -> usize {
        self.fold
    }

    /// Splits the training sweeps once more, see [`TrainSplit::inner`].
    ///
    /// # Errors
    /// As [`TrainSplit::inner`].
    pub fn inner(&self, part: usize) -> Result<(TrainSplit<'a>, ValidationSplit<'a>), DataError> {
        self.train.inner(part)
    }

    fn key(&self) -> SplitKey {
        SplitKey {
            scheme: self.scheme,
            seed: self.seed,
            repeat: self.repeat,
            fold: self.fold,
        }
    }

    /// Returns the fold with only `shots` random training sweeps of every material. A smaller number gives a subset.
    ///
    /// # Errors
    /// No shot, or a material with fewer training sweeps.
    ///
    /// ```
    /// use tactnet_data::twin;
    /// use tactnet_data::{Fold, Scheme, Seed};
    ///
    /// let dataset = twin::small(2, 10, 100)?;
    /// let fold = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0)?;
    /// assert_eq!(fold.shots(3)?.train.len(), 6);
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn shots(&self, shots: usize) -> Result<Self, DataError> {
        let mut of_label = vec![Vec::new(); self.dataset.labels().len()];
        for &sweep in self.train.indices() {
            of_label[self.dataset.records()[sweep].label].push(sweep);
        }
        let stream = format!("shots, run {}", self.repeat);
        let mut drawn = Vec::new();
        for (label, mut sweeps) in of_label.into_iter().enumerate() {
            if shots == 0 || sweeps.len() < shots {
                return Err(DataError::inconsistent(
                    format!("training sweeps of `{}`", self.dataset.labels().name(label)),
                    format!("at least {}", shots.max(1)),
                    if shots == 0 {
                        "0 asked for".into()
                    } else {
                        sweeps.len().to_string()
                    },
                ));
            }
            shuffle(
                &mut sweeps,
                &mut self.seed.rng((stream.as_str(), self.fold, label)),
            );
            drawn.extend_from_slice(&sweeps[..shots]);
        }
        Ok(Self {
            train: TrainSplit::new(self.dataset, drawn, self.key()),
            ..self.clone()
        })
    }

    /// Returns the fold without a fifth of its training sweeps, and that fifth, which serves calibration.
    ///
    /// # Errors
    /// A material with fewer training sweeps than [`Fold::INNER_FOLDS`].
    pub fn set_aside(&self) -> Result<(Self, ValidationSplit<'a>), DataError> {
        self.refuse_too_few_to_set_aside()?;
        let (train, aside) = self.inner(0)?;
        let fold = Self {
            train,
            ..self.clone()
        };
        Ok((fold, aside))
    }

    fn refuse_too_few_to_set_aside(&self) -> Result<(), DataError> {
        let least = Self::INNER_FOLDS;
        let mut counts = vec![0; self.dataset.labels().len()];
        for &sweep in self.train.indices() {
            counts[self.dataset.records()[sweep].label] += 1;
        }
        match counts.iter().position(|&count| count < least) {
            None => Ok(()),
            Some(label) => Err(DataError::inconsistent(
                format!("training sweeps of `{}`", self.dataset.labels().name(label)),
                format!(
                    "at least {least}, since a calibration sets a fifth of every material's aside"
                ),
                counts[label].to_string(),
            )),
        }
    }

    /// Returns a fold that splits the training sweeps once more: part `part` is the test side, the rest the training
    /// side. It contains no test sweep of this fold.
    ///
    /// # Errors
    /// As [`Fold::inner`].
    pub fn nested(&self, part: usize) -> Result<Self, DataError> {
        let (train, validation) = self.inner(part)?;
        Ok(Self {
            train,
            test: TestSplit::new(self.dataset, validation.indices().to_vec()),
            ..self.clone()
        })
    }
}

/// Returns true for the test sweeps of a fold: `[sweeps]`.
fn tested(dataset: &Dataset, choice: SplitKey) -> Result<Vec<bool>, DataError> {
    Ok(match choice.scheme {
        Scheme::StratifiedKFold { folds, .. } => {
            let everything: Vec<usize> = (0..dataset.len()).collect();
            let parts = distribute(
                dataset,
                &everything,
                folds,
                choice.seed,
                "folds",
                choice.repeat,
            )?;
            parts.into_iter().map(|part| part == choice.fold).collect()
        }
        Scheme::GroupKFold { folds, .. } => {
            Groups::of(dataset).tested(folds, choice.seed, choice.repeat, choice.fold)
        }
        Scheme::HoldOut { test_percent, .. } => {
            held_out(dataset, test_percent, choice.seed, choice.repeat)?
        }
        Scheme::TestFlag => dataset
            .records()
            .iter()
            .map(|r| r.test == Some(true))
            .collect(),
        Scheme::TrainOnAll => vec![false; dataset.len()],
        Scheme::LeaveBlockOut => {
            let left_out: Vec<Option<u32>> = blocks_of_each_label(dataset)
                .iter()
                .map(|blocks| blocks.iter().nth(choice.fold).copied())
                .collect();
            let records = dataset.records().iter();
            records
                .map(|r| r.block.is_some() && r.block == left_out[r.label])
                .collect()
        }
    })
}

/// Returns true for held-out sweeps: `test_percent` of every material's sweeps, at least one and never all.
fn held_out(
    dataset: &Dataset,
    test_percent: usize,
    seed: Seed,
    repeat: usize,
) -> Result<Vec<bool>, DataError> {
    let mut of_label = vec![Vec::new(); dataset.labels().len()];
    for (index, record) in dataset.records().iter().enumerate() {
        of_label[record.label].push(index);
    }
    let mut tested = vec![false; dataset.len()];
    for (label, mut sweeps) in of_label.into_iter().enumerate() {
        if sweeps.len() < 2 {
            return Err(DataError::inconsistent(
                format!("sweeps of `{}`", dataset.labels().name(label)),
                "at least 2, one to train on and one to test on",
                sweeps.len().to_string(),
            ));
        }
        shuffle(&mut sweeps, &mut seed.rng(("hold-out", repeat, label)));
        let share = (sweeps.len() * test_percent + 50) / 100;
        for &sweep in &sweeps[..share.clamp(1, sweeps.len() - 1)] {
            tested[sweep] = true;
        }
    }
    Ok(tested)
}

/// Distributes sweeps to parts, label by label in random order. The sizes of the parts differ by at most one sweep, for
/// every label that occurs and in total.
///
/// Returns the part of each of `sweeps`, below `parts`. The order of label `l` comes from the stream `(stream, repeat,
/// l)`.
///
/// - `sweeps`: indices into the data set
fn distribute(
    dataset: &Dataset,
    sweeps: &[usize],
    parts: usize,
    seed: Seed,
    stream: &str,
    repeat: usize,
) -> Result<Vec<usize>, DataError> {
    let mut positions_of_label = vec![Vec::new(); dataset.labels().len()];
    for (position, &sweep) in sweeps.iter().enumerate() {
        positions_of_label[dataset.records()[sweep].label].push(position);
    }
    let mut part_of = vec![0; sweeps.len()];
    let mut next = 0;
    for (label, mut positions) in positions_of_label.into_iter().enumerate() {
        if positions.is_empty() {
            continue;
        }
        if positions.len() < parts {
            return Err(DataError::inconsistent(
                format!("sweeps of `{}`", dataset.labels().name(label)),
                format!("at least {parts}, one for each fold"),
                positions.len().to_string(),
            ));
        }
        shuffle(&mut positions, &mut seed.rng((stream, repeat, label)));
        for position in positions {
            part_of[position] = next;
            next = (next + 1) % parts;
        }
    }
    Ok(part_of)
}

#[cfg(test)]
mod tests;
