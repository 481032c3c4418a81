//! Frame-by-frame classification.

use std::sync::{Mutex, MutexGuard, PoisonError};

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use tactnet::OnlineClassifier;

use crate::error::TactnetError;
use crate::threads::detached_with;

/// Classifies one sweep at a time, and fuses the sweeps of one object.
#[pyclass(frozen, module = "tactnet")]
pub(crate) struct Online {
    inner: Mutex<OnlineClassifier>,
}

impl From<OnlineClassifier> for Online {
    fn from(online: OnlineClassifier) -> Self {
        Self {
            inner: Mutex::new(online),
        }
    }
}

impl Online {
    fn lock(&self) -> MutexGuard<'_, OnlineClassifier> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Online {
    /// Begins a sweep.
    fn begin(&self) {
        self.lock().begin();
    }

    /// Adds the next frame, `[taxels]` in raw digits.
    fn push(&self, digits: PyReadonlyArray1<'_, f32>) -> PyResult<()> {
        let mut online = self.lock();
        let digits = digits.as_slice()?;
        let (steps, taxels) = (online.config().shape.steps, online.config().shape.taxels());
        let skin = online.config().taxel_shape().taxels();
        if ![skin, taxels].contains(&digits.len()) {
            let found = digits.len();
            return Err(TactnetError::new_err(format!(
                "frame: expected {skin} taxels, found {found}"
            )));
        }
        if online.is_complete() {
            return Err(TactnetError::new_err(format!(
                "the sweep has all its {steps} frames; `begin()` starts the next"
            )));
        }
        online.push(digits);
        Ok(())
    }

    /// Returns `[materials]`, the probabilities given the sweep so far.
    #[pyo3(signature = (dropout=false))]
    fn classify<'py>(&self, py: Python<'py>, dropout: bool) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let probabilities = detached_with(py, &self.inner, |online| {
            if online.frames() == 0 {
                return Err("no frame of this sweep yet");
            }
            let belief = match dropout {
                false => online.classify(),
                true if online.mc_samples() > 0 => online.classify_by_dropout(),
                true => return Err("the network's recipe predicts without dropout masks"),
            };
            let log_p = belief.log_probability.iter();
            Ok(log_p.map(|log_p| log_p.exp()).collect::<Vec<f64>>())
        })?
        .map_err(TactnetError::new_err)?;
        Ok(PyArray1::from_vec(py, probabilities))
    }

    /// Fuses the newest belief with those of earlier sweeps of the same object.
    fn fuse(&self) {
        self.lock().fuse();
    }

    /// Returns `[materials]`, the probabilities given all fused sweeps.
    fn fused<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.lock().fused().probabilities())
    }

    /// Forgets the fused sweeps; the next sweep is of another object.
    fn reset(&self) {
        self.lock().reset();
    }

    /// Number of frames of this sweep so far.
    #[getter]
    fn frames(&self) -> usize {
        self.lock().frames()
    }

    /// True if the sweep has all its frames.
    #[getter]
    fn is_complete(&self) -> bool {
        self.lock().is_complete()
    }
}
