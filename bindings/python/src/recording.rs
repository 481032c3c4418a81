//! Recordings of channels.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use tactnet_recording::{RecordedPacket, SweepSettings, sweeps};

use crate::dataset::Dataset;
use crate::error::{TactnetError, raised};
use crate::threads::detached;
use crate::words::{belief_in_words, in_words};

/// Recording of the tactile channels, in memory.
#[pyclass(frozen, module = "tactnet")]
pub(crate) struct Recording {
    path: PathBuf,
    inner: tactnet_recording::Recording,
}

/// Sequence numbers, times of the put in nanoseconds since 1970, times of the sensor in nanoseconds, digits
/// `[frames][taxels]`.
type Frames<'py> = (
    Bound<'py, PyArray1<u64>>,
    Bound<'py, PyArray1<u64>>,
    Bound<'py, PyArray1<u64>>,
    Bound<'py, PyArray2<f32>>,
);

#[pymethods]
impl Recording {
    /// Reads an MCAP file, complete or not.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let inner = detached(py, || tactnet_recording::Recording::read(&path))?.map_err(raised)?;
        Ok(Self { path, inner })
    }

    /// Channels with skin frames, in the order of their first frames.
    #[getter]
    fn fingers(&self) -> Vec<String> {
        let mut found: Vec<String> = Vec::new();
        for entry in &self.inner.entries {
            if matches!(entry.packet, RecordedPacket::Frame(_))
                && !found.iter().any(|known| **known == *entry.channel)
            {
                found.push(entry.channel.to_string());
            }
        }
        found
    }

    /// Returns `(sequence, time_ns, sensor_time_ns, digits)` of a finger's frames.
    #[pyo3(signature = (finger=None))]
    fn frames<'py>(&self, py: Python<'py>, finger: Option<&str>) -> PyResult<Frames<'py>> {
        let fingers = self.fingers();
        let Some(finger) = finger
            .map(String::from)
            .or_else(|| fingers.first().cloned())
        else {
            return Err(TactnetError::new_err("the recording has no frames"));
        };
        if !fingers.contains(&finger) {
            return Err(TactnetError::new_err(format!(
                "no frames of `{finger}`; there are some of {}",
                fingers.join(", ")
            )));
        }
        let frames = || {
            self.inner
                .entries
                .iter()
                .filter_map(|entry| match &entry.packet {
                    RecordedPacket::Frame(frame) if *entry.channel == *finger => {
                        Some((entry.time_ns, frame))
                    }
                    _ => None,
                })
        };
        let taxels = frames()
            .map(|(_, frame)| frame.values().len())
            .max()
            .unwrap_or(0);
        let count = frames().count();
        let mut digits = Vec::with_capacity(count * taxels);
        for (_, frame) in frames() {
            digits.extend_from_slice(&frame.digits[..taxels]);
        }
        let flat = PyArray1::from_vec(py, digits);
        Ok((
            PyArray1::from_iter(py, frames().map(|(_, frame)| frame.sequence)),
            PyArray1::from_iter(py, frames().map(|(time, _)| time)),
            PyArray1::from_iter(py, frames().map(|(_, frame)| frame.sensor_time_ns)),
            numpy::PyArrayMethods::reshape(&flat, [count, taxels])?,
        ))
    }

    /// Returns `(channel, time_ns, sender, JSON document)` of every packet except frames. The sender is the number of its put-port, `None` in
    /// recordings that do not tell.
    fn packets_json(&self) -> Vec<(String, u64, Option<u64>, String)> {
        let mut found = Vec::new();
        let mut network = None;
        for entry in &self.inner.entries {
            let words = match &entry.packet {
                RecordedPacket::Frame(_) => None,
                RecordedPacket::Command(packet) => in_words(packet, network),
                RecordedPacket::Belief(packet) => belief_in_words(packet, network),
                RecordedPacket::Status(packet) => in_words(&**packet, network),
                RecordedPacket::Model(packet) => {
                    network = Some(&**packet);
                    in_words(&**packet, network)
                }
                RecordedPacket::Plain(packet) => serde_json::to_value(packet).ok(),
            };
            if let Some(words) = words {
                let channel = entry.channel.to_string();
                found.push((channel, entry.time_ns, entry.sender, words.to_string()));
            }
        }
        found
    }

    /// Returns the labelled sweeps as a data set, cut like the online classifier does.
    ///
    /// - `material`: label of sweeps whose start command names none
    #[pyo3(signature = (material=None, steps=None, rate_hz=None, rows_cols=None))]
    fn sweeps(
        &self,
        py: Python<'_>,
        material: Option<&str>,
        steps: Option<usize>,
        rate_hz: Option<f64>,
        rows_cols: Option<(usize, usize)>,
    ) -> PyResult<Dataset> {
        let settings = SweepSettings {
            steps,
            rate_hz,
            rows_cols,
        };
        detached(py, || sweeps(&self.path, &self.inner, material, settings))?
            .map(|found| found.dataset.into())
            .map_err(raised)
    }

    /// Reason why the end of the recording is missing, or None.
    #[getter]
    fn cut(&self) -> Option<&str> {
        self.inner.cut.as_deref()
    }

    fn __len__(&self) -> usize {
        self.inner.entries.len()
    }
}
