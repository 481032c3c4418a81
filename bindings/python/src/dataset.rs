//! Data sets.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::ndarray::IntoDimension;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray4};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use tactnet_data::format::{self, Format, Keep, ReadOptions, Span, Windows};
use tactnet_data::twin::{self, TwinConfig, TwinVersion};
use tactnet_data::{
    CheckReport, DataError, Fold, LabelSet, Quantity, Samples, Scheme, Seed, Severity, SweepRecord,
    SweepShape, check,
};
use tactnet_pipeline::RegressionReport;

use crate::error::{TactnetError, raised, with_cure};
use crate::threads::detached;

/// Sweeps of a tactile skin with their materials.
#[pyclass(frozen, module = "tactnet")]
pub(crate) struct Dataset {
    pub(crate) inner: Arc<tactnet_data::Dataset>,
}

/// Length of a window: frames, seconds, or text such as `1.28s`.
#[derive(FromPyObject)]
pub(crate) enum Length {
    Steps(usize),
    Seconds(f64),
    Text(String),
}

impl TryFrom<Length> for Span {
    type Error = DataError;

    fn try_from(length: Length) -> Result<Self, DataError> {
        // The text has the checks.
        match length {
            Length::Steps(steps) => steps.to_string(),
            Length::Seconds(seconds) => format!("{seconds}s"),
            Length::Text(text) => text,
        }
        .parse()
    }
}

/// Frames to keep of each sweep: a number, `shortest` or `all`.
#[derive(FromPyObject)]
pub(crate) enum StepsToKeep {
    Steps(usize),
    Text(String),
}

impl TryFrom<StepsToKeep> for Keep {
    type Error = DataError;

    fn try_from(steps: StepsToKeep) -> Result<Self, DataError> {
        match steps {
            StepsToKeep::Steps(steps) => steps.to_string(),
            StepsToKeep::Text(text) => text,
        }
        .parse()
    }
}

/// Values of sweeps, `[sweeps][steps][rows][cols]`, in the types of a data set.
#[derive(FromPyObject)]
pub(crate) enum Values<'py> {
    U8(PyReadonlyArray4<'py, u8>),
    U16(PyReadonlyArray4<'py, u16>),
    F32(PyReadonlyArray4<'py, f32>),
}

impl Values<'_> {
    fn samples(&self) -> Result<(Vec<usize>, Samples), numpy::AsSliceError> {
        Ok(match self {
            Self::U8(array) => (array.shape_of(), Samples::U8(array.as_slice()?.to_vec())),
            Self::U16(array) => (array.shape_of(), Samples::U16(array.as_slice()?.to_vec())),
            Self::F32(array) => (array.shape_of(), Samples::F32(array.as_slice()?.to_vec())),
        })
    }
}

trait ShapeOf {
    fn shape_of(&self) -> Vec<usize>;
}

impl<T: numpy::Element> ShapeOf for PyReadonlyArray4<'_, T> {
    fn shape_of(&self) -> Vec<usize> {
        numpy::PyUntypedArrayMethods::shape(&**self).to_vec()
    }
}

/// Succeeds if 32-bit floats keep the resolution of `samples`, `[sweeps][steps][rows][cols]`, C-contiguous.
#[pyfunction]
pub(crate) fn check_resolution(py: Python<'_>, samples: PyReadonlyArray4<'_, f64>) -> PyResult<()> {
    let extents = samples.shape_of();
    let shape = SweepShape {
        steps: extents[1],
        rows: extents[2],
        cols: extents[3],
    };
    let samples = samples.as_slice()?;
    detached(py, || Samples::from_f64(samples, shape))?
        .map(drop)
        .map_err(raised)
}

/// Indices of the training and test sweeps of a fold.
type Indices<'py> = (Bound<'py, PyArray1<usize>>, Bound<'py, PyArray1<usize>>);

#[pymethods]
impl Dataset {
    /// Creates a data set from arrays.
    ///
    /// - `samples`: `[sweeps][steps][rows][cols]` of uint8, uint16 or float32, C-contiguous; copied once
    /// - `labels`: `[sweeps]`, indices into `materials`
    /// - `rate_hz`: frames per second; None: 750, marked as assumed
    /// - `lengths`: `[sweeps]`, numbers of frames; None: all
    #[staticmethod]
    #[pyo3(signature = (samples, labels, materials, rate_hz=None, blocks=None, name="arrays", lengths=None))]
    #[allow(clippy::too_many_arguments)] // keyword arguments of Python
    fn from_arrays(
        py: Python<'_>,
        samples: Values<'_>,
        labels: Vec<usize>,
        materials: Vec<String>,
        rate_hz: Option<f64>,
        blocks: Option<Vec<u32>>,
        name: &str,
        lengths: Option<Vec<usize>>,
    ) -> PyResult<Self> {
        let (extents, samples) = samples
            .samples()
            .map_err(|error| TactnetError::new_err(error.to_string()))?;
        let count = extents[0];
        if labels.len() != count || blocks.as_ref().is_some_and(|blocks| blocks.len() != count) {
            let found = blocks
                .as_ref()
                .map_or(labels.len(), |blocks| blocks.len().min(labels.len()));
            return Err(TactnetError::new_err(format!(
                "labels and blocks: expected one for each of the {count} sweeps, found {found}"
            )));
        }
        let mut seen = vec![0; materials.len()];
        let mut records = Vec::with_capacity(count);
        for (index, &label) in labels.iter().enumerate() {
            let Some(sweep) = seen.get_mut(label) else {
                return Err(TactnetError::new_err(format!(
                    "labels: expected indices of the {} materials, found {label}",
                    materials.len()
                )));
            };
            records.push(SweepRecord {
                label,
                sweep: *sweep,
                block: blocks.as_ref().map(|blocks| blocks[index]),
                test: None,
            });
            *sweep += 1;
        }
        let shape = SweepShape {
            steps: extents[1],
            rows: extents[2],
            cols: extents[3],
        };
        let labels = LabelSet::new(materials).map_err(raised)?;
        detached(py, || {
            tactnet_data::Dataset::at_rate(name, rate_hz, shape, labels, records, samples).and_then(
                |dataset| match lengths {
                    Some(lengths) => dataset.with_lengths(lengths),
                    None => Ok(dataset),
                },
            )
        })?
        .map(Self::from)
        .map_err(raised)
    }

    /// Returns the sweeps with these indices, in this order, with the materials that occur.
    fn select(&self, py: Python<'_>, indices: Vec<usize>) -> PyResult<Self> {
        if let Some(wrong) = indices.iter().find(|index| **index >= self.inner.len()) {
            return Err(PyIndexError::new_err(format!(
                "sweep: expected an index below {}, found {wrong}",
                self.inner.len()
            )));
        }
        detached(py, || self.inner.of_sweeps(&indices))?
            .map(Self::from)
            .map_err(raised)
    }

    /// Returns the frames of one sweep, `[steps][rows][cols]`, in the type of the data set.
    fn sweep<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyAny>> {
        let shape = self.inner.shape();
        let extents = [self.inner.steps_of(index), shape.rows, shape.cols];
        let start = index * shape.values();
        let range = start..start + extents.iter().product::<usize>();
        match self.inner.samples() {
            Samples::U8(values) => array(py, &values[range], extents),
            Samples::U16(values) => array(py, &values[range], extents),
            Samples::F32(values) => array(py, &values[range], extents),
        }
    }

    /// Reads HDF5, npz, MATLAB, CSV, Parquet or a folder of CSV.
    #[staticmethod]
    #[pyo3(signature = (path, rate_hz=None, steps=None, columns=Vec::new(), resample_hz=None, window=None, hop=None, intervals=None, drop_labels=Vec::new(), samples=None, labels=None, blocks=None))]
    #[allow(clippy::too_many_arguments)] // keyword arguments of Python
    fn read(
        py: Python<'_>,
        path: PathBuf,
        rate_hz: Option<f64>,
        steps: Option<StepsToKeep>,
        columns: Vec<String>,
        resample_hz: Option<f64>,
        window: Option<Length>,
        hop: Option<Length>,
        intervals: Option<PathBuf>,
        drop_labels: Vec<String>,
        samples: Option<String>,
        labels: Option<String>,
        blocks: Option<String>,
    ) -> PyResult<Self> {
        let span = |length: Option<Length>| length.map(Span::try_from).transpose().map_err(raised);
        let (length, hop) = (span(window)?, span(hop)?);
        let only_windows = hop.is_some() || intervals.is_some() || !drop_labels.is_empty();
        if length.is_none() && only_windows {
            let message = "hop, intervals, drop_labels: expected `window=` with them, found none";
            return Err(TactnetError::new_err(message));
        }
        let options = ReadOptions {
            keep: steps
                .map_or(Ok(Keep::Equal), Keep::try_from)
                .map_err(raised)?,
            rate_hz,
            columns,
            samples,
            labels,
            blocks,
            resample_hz,
            windows: length.map(|length| Windows {
                hop,
                intervals,
                drop_labels,
                ..Windows::of(length)
            }),
            ..ReadOptions::default()
        };
        detached(py, || format::read_with(&path, &options))?
            .map(Self::from)
            .map_err(raised)
    }

    /// Reads back a .npz file that `write` made, also with values that are not finite.
    #[staticmethod]
    fn restored(
        py: Python<'_>,
        path: PathBuf,
        name: &str,
        rate_is_assumed: bool,
    ) -> PyResult<Self> {
        let read = detached(py, || format::npz::read_with_gaps(&path))?.map_err(raised)?;
        let named = read.with_name(name);
        Ok(match rate_is_assumed {
            true => named.with_assumed_rate().into(),
            false => named.into(),
        })
    }

    /// Messages of the warnings that only the reader of the file can make.
    #[getter]
    fn reading_warnings(&self) -> Vec<String> {
        let findings = self.inner.reading_findings().iter();
        let warnings = findings.filter(|finding| finding.severity == Severity::Warning);
        warnings
            .map(|finding| with_cure(finding.message.clone(), finding.remedy.as_ref()))
            .collect()
    }

    /// Reads sweeps without materials. Also returns their names: of files or of sweeps in a table.
    #[staticmethod]
    #[pyo3(signature = (path, rate_hz=None, steps=None))]
    fn read_unlabelled(
        py: Python<'_>,
        path: PathBuf,
        rate_hz: Option<f64>,
        steps: Option<StepsToKeep>,
    ) -> PyResult<(Self, Vec<String>)> {
        detached(py, || -> Result<_, DataError> {
            let options = ReadOptions {
                rate_hz,
                keep: steps.map_or(Ok(Keep::Equal), Keep::try_from)?,
                ..ReadOptions::default()
            };
            let sweeps = format::read_to_classify_with(&path, &options)?;
            Ok((Self::from(sweeps.dataset), sweeps.names))
        })?
        .map_err(raised)
    }

    /// Generates the synthetic twin of TactMat.
    #[staticmethod]
    #[pyo3(signature = (materials=None, sweeps=None, steps=None, seed=None, version=2))]
    fn twin(
        py: Python<'_>,
        materials: Option<usize>,
        sweeps: Option<usize>,
        steps: Option<usize>,
        seed: Option<u64>,
        version: u32,
    ) -> PyResult<Self> {
        let version = match version {
            1 => TwinVersion::One,
            2 => TwinVersion::Two,
            other => {
                return Err(TactnetError::new_err(format!(
                    "version: expected 1 or 2, found {other}"
                )));
            }
        };
        let usual = TwinConfig {
            version,
            ..TwinConfig::default()
        };
        let config = TwinConfig {
            materials: materials.unwrap_or(usual.materials),
            sweeps: sweeps.unwrap_or(usual.sweeps),
            steps: steps.unwrap_or(usual.steps),
            seed: seed.unwrap_or(usual.seed),
            ..usual
        };
        detached(py, || twin::generate(&config))?
            .map(Self::from)
            .map_err(raised)
    }

    /// Writes a file in the format that its extension names: .h5, .npz, .ts.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        detached(py, || {
            Format::from_extension(&path)?.write(&path, &self.inner)
        })?
        .map_err(raised)
    }

    /// Returns errors, warnings and findings of the check as a JSON document.
    fn check_json(&self, py: Python<'_>) -> PyResult<String> {
        let mut report = detached(py, || CheckReport::of(check(&self.inner)))?;
        for finding in &mut report.findings {
            let message = std::mem::take(&mut finding.message);
            finding.message = with_cure(message, finding.remedy.as_ref());
        }
        serde_json::to_string(&report).map_err(raised)
    }

    /// Returns the report of [`RegressionReport`] as a JSON document, with the default split.
    ///
    /// - `target`: "speed" or "force"; `None`: all conditions of the data set
    #[pyo3(signature = (target=None, seed=1))]
    fn regress_json(&self, py: Python<'_>, target: Option<&str>, seed: u64) -> PyResult<String> {
        let target = match target {
            None => None,
            Some(name) => {
                let mut all = Quantity::ALL.into_iter();
                let found = all.find(|quantity| quantity.name() == name);
                Some(found.ok_or_else(|| {
                    TactnetError::new_err(format!(
                        "target: expected speed or force, found `{name}`"
                    ))
                })?)
            }
        };
        let scheme = Scheme::default_for(&self.inner);
        let report = detached(py, || {
            RegressionReport::of(&self.inner, target, scheme, Seed(seed))
        })?
        .map_err(raised)?;
        serde_json::to_string(&report).map_err(raised)
    }

    /// Returns `(train, test)` indices of every fold of one repeat.
    ///
    /// - `scheme`: "default" (the file's own test sweeps, otherwise "group-k-fold" if materials have several blocks, otherwise
    ///   "k-fold"), "k-fold", "group-k-fold" or "leave-block-out"
    /// - `folds`: number of folds; `None`: up to 5
    #[pyo3(signature = (scheme="default", folds=None, seed=1, repeat=0))]
    fn folds<'py>(
        &self,
        py: Python<'py>,
        scheme: &str,
        folds: Option<usize>,
        seed: u64,
        repeat: usize,
    ) -> PyResult<Vec<Indices<'py>>> {
        let scheme = match (scheme, folds) {
            ("default", None) => Scheme::default_for(&self.inner),
            ("default", Some(_)) => Scheme::cross_validation_for(&self.inner),
            ("k-fold", _) => Scheme::folds_for(&self.inner),
            ("group-k-fold", _) => Scheme::group_folds_for(&self.inner),
            ("leave-block-out", _) => Scheme::LeaveBlockOut,
            (other, _) => {
                return Err(TactnetError::new_err(format!(
                    "scheme: expected default, k-fold, group-k-fold or leave-block-out, found {other}"
                )));
            }
        };
        let repeats = repeat + 1;
        let scheme = match scheme {
            Scheme::StratifiedKFold { folds: usual, .. } => Scheme::StratifiedKFold {
                folds: folds.unwrap_or(usual),
                repeats,
            },
            Scheme::GroupKFold { folds: usual, .. } => Scheme::GroupKFold {
                folds: folds.unwrap_or(usual),
                repeats,
            },
            other => other,
        };
        let count = scheme.folds(&self.inner).map_err(raised)?;
        let mut found = Vec::with_capacity(count);
        for number in 0..count {
            let fold =
                Fold::new(&self.inner, scheme, Seed(seed), repeat, number).map_err(raised)?;
            found.push((
                PyArray1::from_slice(py, fold.train.indices()),
                PyArray1::from_slice(py, fold.test.indices()),
            ));
        }
        Ok(found)
    }

    /// Copy of the values, `[sweeps][steps][rows][cols]`, in the type of the data set: uint8, uint16 or float32.
    #[getter]
    fn samples<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let shape = self.inner.shape();
        let extents = [self.inner.len(), shape.steps, shape.rows, shape.cols];
        match self.inner.samples() {
            Samples::U8(values) => array(py, values, extents),
            Samples::U16(values) => array(py, values, extents),
            Samples::F32(values) => array(py, values, extents),
        }
    }

    /// Label of each sweep, an index into `materials`.
    #[getter]
    fn labels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<usize>> {
        let labels: Vec<usize> = self
            .inner
            .records()
            .iter()
            .map(|record| record.label)
            .collect();
        PyArray1::from_vec(py, labels)
    }

    /// Number of frames of each sweep; None if all sweeps have one length.
    #[getter]
    fn lengths<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<usize>>> {
        let lengths = self.inner.lengths()?;
        Some(PyArray1::from_slice(py, lengths))
    }

    /// Recording block of each sweep, or None.
    #[getter]
    fn blocks<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<u32>>> {
        let blocks: Option<Vec<u32>> = self
            .inner
            .records()
            .iter()
            .map(|record| record.block)
            .collect();
        blocks.map(|blocks| PyArray1::from_vec(py, blocks))
    }

    /// Names of the materials, in label order.
    #[getter]
    fn materials(&self) -> Vec<String> {
        self.inner.labels().names().map(String::from).collect()
    }

    /// Shape of every sweep, `(steps, rows, cols)`.
    #[getter]
    fn sweep_shape(&self) -> (usize, usize, usize) {
        let shape = self.inner.shape();
        (shape.steps, shape.rows, shape.cols)
    }

    /// Frames per second.
    #[getter]
    fn rate_hz(&self) -> f64 {
        self.inner.sample_rate_hz()
    }

    /// True if the file does not contain the rate.
    #[getter]
    fn rate_is_assumed(&self) -> bool {
        self.inner.is_rate_assumed()
    }

    /// Name of the data set.
    #[getter]
    fn name(&self) -> &str {
        self.inner.name()
    }

    /// SHA-256 of the content, in hexadecimal.
    #[getter]
    fn sha256(&self) -> &str {
        self.inner.sha256()
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }

    fn __repr__(&self) -> String {
        format!(
            "Dataset({:?}: {} sweeps of {}, {} materials, {} Hz{})",
            self.inner.name(),
            self.inner.len(),
            self.inner.describe_shape(),
            self.inner.labels().len(),
            self.inner.sample_rate_hz(),
            if self.inner.is_rate_assumed() {
                " assumed"
            } else {
                ""
            }
        )
    }
}

/// Returns a copy of `values` as an array of this shape.
fn array<'py, T: numpy::Element + Copy>(
    py: Python<'py>,
    values: &[T],
    extents: impl IntoDimension,
) -> PyResult<Bound<'py, PyAny>> {
    let shaped = PyArray1::from_slice(py, values).reshape(extents)?;
    Ok(shaped.into_any())
}

impl From<tactnet_data::Dataset> for Dataset {
    fn from(dataset: tactnet_data::Dataset) -> Self {
        Self {
            inner: Arc::new(dataset),
        }
    }
}
