//! Ports for packets of any type, as bytes.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use tactnet_channel::{ChannelError, GetPort, PutPort, Wait};

use crate::channel::{PATIENCE, locked};
use crate::error::{TactnetError, raised};

/// Puts packets as bytes.
#[pyclass(frozen, module = "tactnet.channel")]
pub(crate) struct RawPutPort {
    pub(crate) port: Mutex<PutPort<u8>>,
    pub(crate) item_bytes: usize,
}

#[pymethods]
impl RawPutPort {
    /// Puts the bytes of one or more items; returns the number of get-ports that have them.
    fn put(&self, items: &[u8]) -> PyResult<usize> {
        if !items.len().is_multiple_of(self.item_bytes) {
            return Err(TactnetError::new_err(format!(
                "packet: expected a multiple of {} bytes, found {}",
                self.item_bytes,
                items.len()
            )));
        }
        let port = locked(&self.port);
        let mut loan = port.loan(items.len()).map_err(raised)?;
        loan.copy_from_slice(items);
        port.put(loan).map_err(raised)
    }
}

/// Gets packets as bytes.
#[pyclass(frozen, module = "tactnet.channel")]
pub(crate) struct RawGetPort {
    pub(crate) port: Mutex<GetPort<u8>>,
}

#[pymethods]
impl RawGetPort {
    /// Waits for the next packet. Returns its bytes and the time of its put, or None after `timeout` seconds.
    #[pyo3(signature = (timeout=None))]
    fn get<'py>(
        &self,
        py: Python<'py>,
        timeout: Option<f64>,
    ) -> PyResult<Option<(Bound<'py, PyBytes>, u64)>> {
        let deadline = deadline(timeout)?;
        loop {
            let left = deadline.map_or(PATIENCE, |end| {
                end.saturating_duration_since(Instant::now())
            });
            let found = py.detach(|| {
                let wait = Wait::Block {
                    timeout: left.min(PATIENCE),
                };
                let packet = locked(&self.port).get(wait)?;
                Ok::<_, ChannelError>(
                    packet.map(|packet| (packet.to_vec(), packet.header().put_ns)),
                )
            });
            if let Some((items, put_ns)) = found.map_err(raised)? {
                return Ok(Some((PyBytes::new(py, &items), put_ns)));
            }
            py.check_signals()?;
            if deadline.is_some_and(|end| Instant::now() >= end) {
                return Ok(None);
            }
        }
    }

    /// Number of lost packets.
    #[getter]
    fn lost(&self) -> u64 {
        locked(&self.port).lost()
    }
}

/// Returns the time at which to stop waiting; `None`: never.
pub(crate) fn deadline(timeout: Option<f64>) -> PyResult<Option<Instant>> {
    match timeout.map(Duration::try_from_secs_f64) {
        None => Ok(None),
        Some(Ok(timeout)) => Ok(Instant::now().checked_add(timeout)),
        Some(Err(_)) => Err(TactnetError::new_err("timeout: expected 0 or more seconds")),
    }
}
