//! Results of the stress test.

use std::time::Duration;

use serde::Serialize;
use tactnet_channel::percentile;

use crate::RoundTrips;
use crate::plan::{Cell, StressDomain};

/// Measurements of one cell.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// Name of the transport.
    pub transport: &'static str,
    /// Location of master and clients.
    pub domain: StressDomain,
    /// Name of the configuration of channels and sync groups.
    pub configuration: &'static str,
    /// Packet size, in bytes.
    pub size: usize,
    /// Number of clients.
    pub clients: usize,
    /// Number of measured rounds.
    pub rounds: usize,
    /// Minimum round trip, in microseconds.
    pub min_us: f64,
    /// Median round trip, in microseconds.
    pub median_us: f64,
    /// 99th percentile of the round trips, in microseconds.
    pub p99_us: f64,
    /// Maximum round trip, in microseconds.
    pub max_us: f64,
    /// Number of rounds without all answers within ten seconds; 1 for a cell that could not start.
    pub failures: usize,
    /// Bytes of all packets of a round over the median round trip, 2 C P / t, in megabytes per second (thesis, section 2.4.2).
    pub bandwidth_mb_s: f64,
    /// Reason why the cell could not be measured, if so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

/// All rows so far.
pub type Rows = Vec<Row>;

impl Row {
    /// Returns the row of a cell that was measured.
    pub(crate) fn measured(cell: &Cell, trips: RoundTrips) -> Self {
        let RoundTrips {
            mut trips,
            failures,
        } = trips;
        trips.sort();
        let at = |share| percentile(&trips, share).map_or(0.0, microseconds);
        let median = at(0.5);
        Self {
            rounds: trips.len(),
            min_us: at(0.0),
            median_us: median,
            p99_us: at(0.99),
            max_us: at(1.0),
            failures,
            bandwidth_mb_s: if median > 0.0 {
                2.0 * cell.clients as f64 * cell.size as f64 / median
            } else {
                0.0
            },
            ..Self::empty(cell)
        }
    }

    /// Returns the row of a cell that could not be measured.
    pub(crate) fn failed(cell: &Cell, reason: String) -> Self {
        Self {
            failures: 1,
            failure: Some(reason),
            ..Self::empty(cell)
        }
    }

    fn empty(cell: &Cell) -> Self {
        Self {
            transport: cell.transport.name(),
            domain: cell.domain,
            configuration: cell.configuration.name(),
            size: cell.size,
            clients: cell.clients,
            rounds: 0,
            min_us: 0.0,
            median_us: 0.0,
            p99_us: 0.0,
            max_us: 0.0,
            failures: 0,
            bandwidth_mb_s: 0.0,
            failure: None,
        }
    }
}

fn microseconds(trip: Duration) -> f64 {
    trip.as_secs_f64() * 1e6
}
