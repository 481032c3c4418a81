//! Training sweeps of a split, and their inner splits.

use std::ops::Deref;

use super::split::{SplitKey, SweepView, ValidationSplit};
use super::{Fold, Scheme, SplitManifest, distribute};
use crate::{DataError, Dataset, Seed};

/// Training sweeps, the only ones that models are fitted to.
///
/// Only a [`Fold`](crate::Fold) or [`TrainSplit::all`], which leaves no test sweeps, makes one. So a function that takes
/// a `TrainSplit` cannot see a test sweep, while one that takes a [`SweepView`] reads any side:
///
/// ```
/// use tactnet_data::{Fold, SweepView, TrainSplit};
/// fn fit(_: &TrainSplit) {}
/// fn predict(_: &SweepView) {}
/// fn learn(fold: &Fold) {
///     fit(&fold.train);
///     predict(&fold.train);
///     predict(&fold.test);
/// }
/// ```
///
/// Fitting to the test side does not compile:
///
/// ```compile_fail,E0308
/// use tactnet_data::{Fold, TrainSplit};
/// fn fit(_: &TrainSplit) {}
/// fn learn(fold: &Fold) {
///     fit(&fold.test);
/// }
/// ```
///
/// Turning test sweeps into training sweeps does not compile either:
///
/// ```compile_fail,E0451
/// use tactnet_data::{Fold, TrainSplit};
/// fn cheat<'a>(fold: &Fold<'a>) -> TrainSplit<'a> {
///     TrainSplit { view: (*fold.test).clone() }
/// }
/// ```
#[derive(Debug, Clone)]
pub struct TrainSplit<'a> {
    view: SweepView<'a>,
    key: SplitKey,
    /// Weight of each sweep, `[sweeps]`, of mean 1; `None`: all are equal.
    weights: Option<Vec<f64>>,
}

impl<'a> TrainSplit<'a> {
    pub(super) fn new(dataset: &'a Dataset, indices: Vec<usize>, key: SplitKey) -> Self {
        Self {
            view: SweepView::new(dataset, indices),
            key,
            weights: None,
        }
    }

    /// Returns the split with a weight for every sweep, by which models fit it more or less closely. Only ratios matter: the weights are
    /// scaled to a mean of 1.
    ///
    /// - `weights`: `[sweeps]`, in the order of the positions
    ///
    /// # Errors
    /// Another number of weights than sweeps; a weight that is not a positive number.
    ///
    /// ```
    /// use tactnet_data::twin;
    /// use tactnet_data::{Seed, TrainSplit};
    ///
    /// let dataset = twin::small(2, 1, 100)?;
    /// let train = TrainSplit::all(&dataset, Seed(1)).weighted(vec![3.0, 1.0])?;
    /// assert_eq!(train.weights(), Some(&[1.5, 0.5][..]));
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn weighted(self, weights: Vec<f64>) -> Result<Self, DataError> {
        let refused = |expected: String, found: String| {
            Err(DataError::inconsistent("sample weights", expected, found))
        };
        let sweeps = self.view.len();
        if weights.len() != sweeps {
            let expected = format!("one for each of {sweeps} training sweeps");
            return refused(expected, weights.len().to_string());
        }
        let is_valid = |weight: &&f64| weight.is_finite() && **weight > 0.0;
        if let Some(wrong) = weights.iter().find(|weight| !is_valid(weight)) {
            return refused("positive numbers".into(), wrong.to_string());
        }
        let mean = weights
            .iter()
            .map(|weight| weight / sweeps as f64)
            .sum::<f64>();
        let weights = weights.iter().map(|weight| weight / mean).collect();
        Ok(Self {
            weights: Some(weights),
            ..self
        })
    }

    /// Returns the weight of each sweep, `[sweeps]`, in the order of the positions; `None` if all are equal.
    pub fn weights(&self) -> Option<&[f64]> {
        self.weights.as_deref()
    }

    /// Returns all sweeps of `dataset`, for a classifier that is evaluated on another data set.
    ///
    /// - `seed`: seed of the parts of [`TrainSplit::inner`]
    pub fn all(dataset: &'a Dataset, seed: Seed) -> Self {
        let key = SplitKey {
            scheme: Scheme::TrainOnAll,
            seed,
            repeat: 0,
            fold: 0,
        };
        Self::new(dataset, (0..dataset.len()).collect(), key)
    }

    /// Returns the number of parts of [`TrainSplit::inner`]: [`Fold::INNER_FOLDS`], or as many as the material with the
    /// fewest sweeps has, at least two. Materials with a single sweep do not count.
    pub fn inner_folds(&self) -> usize {
        let counts = self.sweeps_per_label().into_iter();
        let fewest = counts.filter(|count| *count > 1).min().unwrap_or(0);
        fewest.clamp(2, Fold::INNER_FOLDS)
    }

    /// Splits the training sweeps once more, stratified, to choose settings without the test sweeps.
    ///
    /// With [`Scheme::LeaveBlockOut`](crate::Scheme::LeaveBlockOut), too, the inner sides share recording blocks. The only sweep of a
    /// material is a training sweep in every part.
    ///
    /// - `part`: validation part, below [`TrainSplit::inner_folds`]
    ///
    /// # Errors
    /// No such part, or no material with two training sweeps.
    pub fn inner(&self, part: usize) -> Result<(Self, ValidationSplit<'a>), DataError> {
        let folds = self.inner_folds();
        if part >= folds {
            return Err(DataError::inconsistent(
                "inner fold",
                format!("a number below {folds}"),
                part.to_string(),
            ));
        }
        let SplitKey {
            seed, repeat, fold, ..
        } = self.key;
        let (dataset, sweeps) = (self.view.dataset(), self.view.indices());
        let counts = self.sweeps_per_label();
        let several = counts.iter().any(|count| *count > 1);
        // Without any second sweep, the error of `distribute` names the first material.
        let is_only = |index: usize| several && counts[dataset.records()[index].label] == 1;
        let shared: Vec<usize> = sweeps.iter().copied().filter(|&s| !is_only(s)).collect();
        let stream = format!("folds, inside fold {fold}");
        let parts = distribute(dataset, &shared, folds, seed, &stream, repeat)?;
        let (mut fitted, mut weights, mut held) = (Vec::new(), Vec::new(), Vec::new());
        let mut parts = parts.into_iter();
        for (position, &sweep) in sweeps.iter().enumerate() {
            if !is_only(sweep) && parts.next() == Some(part) {
                held.push(sweep);
                continue;
            }
            fitted.push(sweep);
            weights.extend(self.weights.as_ref().map(|all| all[position]));
        }
        Ok((
            Self {
                weights: self.weights.is_some().then_some(weights),
                ..Self::new(dataset, fitted, self.key)
            },
            ValidationSplit::new(dataset, held),
        ))
    }
}

impl TrainSplit<'_> {
    /// Returns the split as data, which is saved with a classifier: these training sweeps, and the test sweeps of their
    /// fold.
    ///
    /// # Errors
    /// A data set that cannot be split the same way again.
    pub fn manifest(&self) -> Result<SplitManifest, DataError> {
        let SplitKey {
            scheme,
            seed,
            repeat,
            fold,
        } = self.key;
        let fold = Fold {
            train: self.clone(),
            ..Fold::new(self.view.dataset(), scheme, seed, repeat, fold)?
        };
        Ok(fold.manifest())
    }
}

impl<'a> Deref for TrainSplit<'a> {
    type Target = SweepView<'a>;

    fn deref(&self) -> &SweepView<'a> {
        &self.view
    }
}
