//! Ports for packets of any type, as bytes.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use tactnet_channel::{ChannelError, GetPort, PutPort, Table, Wait, hub_runs};

use crate::error::{TactnetError, raised};
use crate::of_process::OfProcess;

/// Maximum sleep of a wait, which bounds the reaction time to Ctrl-C.
const PATIENCE: Duration = Duration::from_millis(100);

pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Puts packets as bytes.
#[pyclass(frozen, module = "tactnet.channel")]
pub(crate) struct RawPutPort {
    pub(crate) port: OfProcess<PutPort<u8>>,
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
        let port = locked(self.port.here()?);
        let mut loan = port.loan(items.len()).map_err(raised)?;
        loan.copy_from_slice(items);
        port.put(loan).map_err(raised)
    }

    /// Packets that each get-port has lost because it took them too slowly, as a dict from its number.
    fn losses(&self) -> PyResult<BTreeMap<u64, u64>> {
        let losses = locked(self.port.here()?).losses();
        let losses = losses.iter().map(|loss| (loss.getter, loss.packets));
        Ok(losses.collect())
    }
}

/// Gets packets as bytes.
#[pyclass(frozen, module = "tactnet.channel")]
pub(crate) struct RawGetPort {
    pub(crate) port: OfProcess<GetPort<u8>>,
    pub(crate) table: Table,
}

#[pymethods]
impl RawGetPort {
    /// Waits for the next packet. Returns its bytes, the number of its sender and the time of its put in nanoseconds of the sending host's
    /// monotonic clock, or None after `timeout` seconds.
    #[pyo3(signature = (timeout=None))]
    fn get<'py>(
        &self,
        py: Python<'py>,
        timeout: Option<f64>,
    ) -> PyResult<Option<(Bound<'py, PyBytes>, u64, u64)>> {
        let port = self.port.here()?;
        let packet = wait_for(py, &self.table, timeout, |wait| {
            let packet = locked(port).get(wait)?;
            Ok(packet.map(|packet| (packet.to_vec(), *packet.header())))
        })?;
        Ok(packet.map(|(items, header)| {
            let items = PyBytes::new(py, &items);
            (items, header.sender, header.put_ns)
        }))
    }

    /// Number of this port in the `losses` of put-ports.
    #[getter]
    fn number(&self) -> PyResult<u64> {
        Ok(locked(self.port.here()?).number())
    }

    /// Number of lost packets since the port was opened.
    #[getter]
    fn lost(&self) -> PyResult<u64> {
        Ok(locked(self.port.here()?).lost())
    }
}

/// Waits until `get` returns a value, or `timeout` seconds are over. Signals interrupt it.
///
/// # Errors
/// No hub holds the bus any more, and nothing that it brought is left.
pub(crate) fn wait_for<T: Send>(
    py: Python<'_>,
    table: &Table,
    timeout: Option<f64>,
    get: impl Fn(Wait) -> Result<Option<T>, ChannelError> + Sync,
) -> PyResult<Option<T>> {
    let deadline = deadline(timeout)?;
    loop {
        let left = deadline.map_or(PATIENCE, |end| {
            end.saturating_duration_since(Instant::now())
        });
        let wait = Wait::Block {
            timeout: left.min(PATIENCE),
        };
        if let Some(found) = py.detach(|| get(wait)).map_err(raised)? {
            return Ok(Some(found));
        }
        py.check_signals()?;
        if !py.detach(|| hub_runs(table)).map_err(raised)? {
            let bus = table.bus.clone();
            return Err(raised(ChannelError::NoHub { bus }));
        }
        if deadline.is_some_and(|end| Instant::now() >= end) {
            return Ok(None);
        }
    }
}

/// Returns the time at which to stop waiting; `None`: never.
fn deadline(timeout: Option<f64>) -> PyResult<Option<Instant>> {
    match timeout.map(Duration::try_from_secs_f64) {
        None => Ok(None),
        Some(Ok(timeout)) => Ok(Instant::now().checked_add(timeout)),
        Some(Err(_)) => Err(TactnetError::new_err("timeout: expected 0 or more seconds")),
    }
}
