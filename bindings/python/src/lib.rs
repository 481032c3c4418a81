//! Native part of the Python package `tactnet`: data sets, classifiers, channels and recordings, on NumPy arrays.
//!
//! `python/tactnet` wraps it in scikit-learn estimators and plain functions, which are the public interface. Long
//! operations release the interpreter lock and check for Ctrl-C at every batch.

mod channel;
mod classifier;
mod dataset;
mod error;
mod fit;
mod of_process;
mod online;
mod packet_ports;
mod recording;
mod threads;
mod words;

use numpy::{PyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use tactnet::Belief;

/// Returns `[materials]`, the posterior of one object from the log-probabilities of several sweeps,
/// `[sweeps][materials]`.
#[pyfunction]
fn fuse<'py>(
    py: Python<'py>,
    log_proba: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let materials = log_proba.shape()[1];
    let mut belief = Belief::flat(materials);
    for row in log_proba.as_slice()?.chunks_exact(materials) {
        belief.fuse(row);
    }
    Ok(PyArray1::from_vec(py, belief.probabilities()))
}

#[pymodule]
fn _tactnet(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add(
        "TactnetError",
        module.py().get_type::<error::TactnetError>(),
    )?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(fuse, module)?)?;
    module.add_function(wrap_pyfunction!(dataset::check_resolution, module)?)?;
    module.add_class::<dataset::Dataset>()?;
    module.add_class::<classifier::Classifier>()?;
    module.add_class::<online::Online>()?;
    module.add_class::<channel::Hub>()?;
    module.add_class::<channel::Bus>()?;
    module.add_class::<channel::SkinPort>()?;
    module.add_class::<channel::CommandPort>()?;
    module.add_class::<channel::BeliefPort>()?;
    module.add_class::<packet_ports::RawPutPort>()?;
    module.add_class::<packet_ports::RawGetPort>()?;
    module.add_class::<recording::Recording>()?;
    Ok(())
}
