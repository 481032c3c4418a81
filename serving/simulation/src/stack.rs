//! Processes of the catching load, and the times of its 1 kHz loop.

use std::path::Path;

use serde::Serialize;
use tactnet_serving::Realtime;

use crate::load::Trip;
use crate::{ChildProcess, LoadReport, LoadRole, SimulationError};

/// Scheduling of the processes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scheduling {
    /// The default scheduler.
    Usual,
    /// SCHED_FIFO with the 1 kHz loop above the skin and the skin above the classifier.
    Fifo,
}

impl Scheduling {
    /// Tries SCHED_FIFO on a separate thread.
    ///
    /// # Errors
    /// Returns [`SimulationError::NoFifo`] if it is not permitted.
    pub fn fifo() -> Result<Self, SimulationError> {
        let tried = std::thread::spawn(|| with_priority(1).apply()).join();
        match tried.unwrap_or_default().first() {
            None => Ok(Self::Fifo),
            Some(reason) => Err(SimulationError::NoFifo {
                reason: reason.clone(),
            }),
        }
    }
}

/// Returns a request for SCHED_FIFO with this priority, 1 to 99, and nothing else.
pub(crate) fn with_priority(priority: u8) -> Realtime {
    Realtime {
        priority: Some(priority),
        ..Realtime::default()
    }
}

/// Processes of the catching load. They are killed if this is dropped before [`CatchingLoad::end`].
pub struct CatchingLoad(Vec<ChildProcess>);

impl CatchingLoad {
    /// Starts the processes one after the other and waits until each is ready.
    ///
    /// - `program`: path of the command-line program
    /// - `table`: path of the channel table
    ///
    /// # Errors
    /// Fails if a process does not start.
    pub fn start(
        program: &Path,
        table: &Path,
        scheduling: Scheduling,
    ) -> Result<Self, SimulationError> {
        let mut stack = Self(Vec::new());
        for role in LoadRole::ALL {
            let mut arguments = vec!["simulate", "catching", "--role", role.name()];
            let of_the_loop = matches!(role, LoadRole::Controller | LoadRole::Drives);
            if scheduling == Scheduling::Fifo && of_the_loop {
                arguments.extend(["--priority", "80"]);
            }
            arguments.push("--table");
            let process = ChildProcess::start(program, role.name(), &arguments, table)?;
            stack.0.push(process);
        }
        Ok(stack)
    }

    /// Ends the processes and returns their reports.
    ///
    /// # Errors
    /// Fails if a process failed.
    pub fn end(self) -> Result<Vec<LoadReport>, SimulationError> {
        let processes = self.0.into_iter().rev();
        processes.map(ChildProcess::end_with_report).collect()
    }
}

/// Returns the round trips of the controller.
///
/// # Errors
/// Fails if its report is missing.
pub fn trips(reports: &[LoadReport]) -> Result<&[Trip], SimulationError> {
    let is_controller = |report: &&LoadReport| report.role == LoadRole::Controller;
    let controller = reports.iter().find(is_controller);
    let none = || SimulationError::child(LoadRole::Controller.name(), "gave no report");
    controller
        .map(|report| report.trips.as_slice())
        .ok_or_else(none)
}

/// Statistics of the 1 kHz loop's round trips. With the real stack these are delays from the controller's tick to its command.
#[derive(Debug, Clone, Serialize)]
pub struct LoopTimes {
    /// Number of round trips.
    pub rounds: usize,
    /// Median, in µs.
    pub p50_us: f64,
    /// 99th percentile, in µs.
    pub p99_us: f64,
    /// 99.9th percentile, in µs.
    pub p999_us: f64,
}

impl LoopTimes {
    /// Computes the statistics.
    ///
    /// - `trips`: all round trips
    /// - `windows`: start and end of the evaluated intervals, in ns of the host's monotonic clock
    pub fn of(trips: &[Trip], windows: &[(u64, u64)]) -> Self {
        let mut rounds_ns: Vec<u32> = trips
            .iter()
            .filter(|trip| {
                windows
                    .iter()
                    .any(|(from, to)| (*from..*to).contains(&trip.at_ns))
            })
            .map(|trip| trip.round_ns)
            .collect();
        rounds_ns.sort_unstable();
        let at = |share| {
            let ns = tactnet_channel::percentile(&rounds_ns, share);
            ns.map_or(0.0, |ns| f64::from(ns) / 1e3)
        };
        Self {
            rounds: rounds_ns.len(),
            p50_us: at(0.5),
            p99_us: at(0.99),
            p999_us: at(0.999),
        }
    }
}
