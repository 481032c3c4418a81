//! Fitted classifiers.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use tactnet::Recipe;
use tactnet_data::{Seed, SweepView, TrainSplit};
use tactnet_pipeline::{LeftOutMember, MeanRemoval, NewSweeps, RiskPolicy};

use crate::dataset::Dataset;
use crate::error::{TactnetError, raised};
use crate::fit::fit_watched;
use crate::online::Online;
use crate::threads::{detached, detached_with};

/// A fitted classifier: a network, a baseline or a committee.
#[pyclass(frozen, module = "tactnet")]
pub(crate) struct Classifier {
    inner: Mutex<tactnet::Classifier>,
}

impl Classifier {
    fn lock(&self) -> MutexGuard<'_, tactnet::Classifier> {
        // Nothing is modified behind the lock, so a poisoned one is safe to use.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl From<tactnet::Classifier> for Classifier {
    fn from(classifier: tactnet::Classifier) -> Self {
        Self {
            inner: Mutex::new(classifier),
        }
    }
}

#[pymethods]
impl Classifier {
    /// Fits to all sweeps of `dataset`.
    ///
    /// - `weights`: `[sweeps]`, positive; None: all are equal
    /// - `recipe`: a built-in name (spectra, fast, thesis, minirocket, …) or a TOML file
    /// - `levels`: "kept" or "removed"; None: as in the recipe
    /// - `progress`: called as `progress(epoch, batch, batches, epochs, loss, accuracy)` after every batch of a network's
    ///   training
    #[staticmethod]
    #[pyo3(signature = (dataset, recipe, weights=None, epochs=None, seed=1, levels=None, progress=None))]
    #[allow(clippy::too_many_arguments)] // keyword arguments of Python
    fn fit(
        py: Python<'_>,
        dataset: &Dataset,
        recipe: &str,
        weights: Option<Vec<f64>>,
        epochs: Option<usize>,
        seed: u64,
        levels: Option<&str>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let mut recipe = if recipe.ends_with(".toml") {
            Recipe::read(recipe)
        } else {
            Recipe::named(recipe)
        }
        .map_err(raised)?
        .seed(Seed(seed));
        if let Some(epochs) = epochs {
            recipe = recipe.epochs(epochs);
        }
        match levels {
            None => {}
            Some("kept") => recipe = recipe.mean_removal(MeanRemoval::None),
            Some("removed") => recipe = recipe.mean_removal(MeanRemoval::PerSweep),
            Some(other) => {
                return Err(TactnetError::new_err(format!(
                    "levels: expected kept or removed, found {other}"
                )));
            }
        }
        let mut train = TrainSplit::all(&dataset.inner, Seed(seed));
        if let Some(weights) = weights {
            train = train.weighted(weights).map_err(raised)?;
        }
        fit_watched(py, &recipe, &train, progress.as_ref()).map(Self::from)
    }

    /// Opens a saved classifier or a run directory of the command line.
    #[staticmethod]
    fn load(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        detached(py, || tactnet::Classifier::load(folder))?
            .map(Self::from)
            .map_err(raised)
    }

    /// Saves into a new folder, which the command line can open as well.
    fn save(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        detached_with(py, &self.inner, |own| own.save(folder))?.map_err(raised)
    }

    /// Returns `[sweeps][materials]`, natural logarithms of the probabilities. Labels are ignored.
    fn predict_log_proba<'py>(
        &self,
        py: Python<'py>,
        dataset: &Dataset,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = detached_with(py, &self.inner, |own| {
            own.log_probabilities(&SweepView::all(&dataset.inner))
        })?
        .map_err(raised)?;
        Ok(PyArray2::from_vec2(py, &rows)?)
    }

    /// Returns a score per sweep that is larger for sweeps unlike any known material. For networks and committees.
    fn unknown_scores<'py>(
        &self,
        py: Python<'py>,
        dataset: &Dataset,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let scores = detached_with(py, &self.inner, |own| {
            own.unknown_scores(&SweepView::all(&dataset.inner))
        })?
        .map_err(raised)?;
        Ok(PyArray1::from_vec(py, scores))
    }

    /// Compares sweeps with the training sweeps: a JSON document, or None if the training sweeps were too few.
    fn likeness(&self, py: Python<'_>, dataset: &Dataset) -> PyResult<Option<String>> {
        let report = detached_with(py, &self.inner, |own| {
            own.likeness(&SweepView::all(&dataset.inner))
        })?
        .map_err(raised)?;
        report
            .map(|report| serde_json::to_string(&report))
            .transpose()
            .map_err(|error| TactnetError::new_err(error.to_string()))
    }

    /// Returns a classifier with one more material, learned from all sweeps of `dataset`.
    fn enroll(&self, py: Python<'_>, material: &str, dataset: &Dataset) -> PyResult<Self> {
        detached_with(py, &self.inner, |own| {
            own.enroll(material, &SweepView::all(&dataset.inner))
        })?
        .map(Self::from)
        .map_err(raised)
    }

    /// Returns a committee with one more material, learned from all sweeps of `dataset`, and why members were left out.
    ///
    /// - `train`: training sweeps of the committee
    fn enroll_with(
        &self,
        py: Python<'_>,
        train: &Dataset,
        material: &str,
        dataset: &Dataset,
    ) -> PyResult<(Self, Vec<String>)> {
        let (grown, left_out) = detached_with(py, &self.inner, |own| {
            let train = TrainSplit::all(&train.inner, Seed(1));
            own.enroll_with(&train, material, &SweepView::all(&dataset.inner))
        })?
        .map_err(raised)?;
        let reasons = left_out.iter().map(lacks).collect();
        Ok((grown.into(), reasons))
    }

    /// Returns a classifier that is adapted to sweeps of another skin, robot or day, and its warnings.
    ///
    /// - `labelled`: True: the output layer is also fitted to the labels
    #[pyo3(signature = (dataset, labelled=false, accept_risk=false))]
    fn adapt(
        &self,
        py: Python<'_>,
        dataset: &Dataset,
        labelled: bool,
        accept_risk: bool,
    ) -> PyResult<(Self, Vec<String>)> {
        let policy = match accept_risk {
            true => RiskPolicy::Accept,
            false => RiskPolicy::Refuse,
        };
        let adapted = detached_with(py, &self.inner, |own| {
            let sweeps = SweepView::all(&dataset.inner);
            let new = match labelled {
                true => NewSweeps {
                    unlabelled: None,
                    labelled: Some(&sweeps),
                },
                false => NewSweeps {
                    unlabelled: Some(&sweeps),
                    labelled: None,
                },
            };
            own.adapt(new, policy)
        })?;
        let adapted = adapted.map_err(raised)?;
        let last = adapted.adaptations().last();
        let risks = last.map_or(Vec::new(), |last| {
            let risks = last.risks.iter().map(ToString::to_string);
            risks.chain(last.left_out.iter().map(lacks)).collect()
        });
        Ok((adapted.into(), risks))
    }

    /// Returns the same network for frame-by-frame classification.
    fn online(&self, py: Python<'_>) -> PyResult<Online> {
        detached_with(py, &self.inner, |own| own.online())?
            .map(Online::from)
            .map_err(raised)
    }

    /// Names of the materials, in the order of the probability columns.
    #[getter]
    fn materials(&self) -> Vec<String> {
        self.lock().materials().map(String::from).collect()
    }

    /// Expected shape of sweeps, `(steps, rows, cols)`.
    #[getter]
    fn sweep_shape(&self) -> (usize, usize, usize) {
        let shape = self.lock().shape();
        (shape.steps, shape.rows, shape.cols)
    }

    /// True if it was trained on sweeps of unequal length, so that sweeps may have any length.
    #[getter]
    fn any_length(&self) -> bool {
        self.lock().any_length()
    }

    /// Expected frames per second; None if the rate was assumed.
    #[getter]
    fn rate_hz(&self) -> Option<f64> {
        let (rate, assumed) = self.lock().sample_rate_hz();
        (!assumed).then_some(rate)
    }

    fn __repr__(&self) -> String {
        let inner = self.lock();
        format!(
            "Classifier({} materials, {})",
            inner.materials().count(),
            inner.shape()
        )
    }
}

/// Returns the sentence about a member that a committee has lost.
fn lacks(member: &LeftOutMember) -> String {
    format!(
        "the committee lacks `{}` now: {}",
        member.name, member.reason
    )
}
