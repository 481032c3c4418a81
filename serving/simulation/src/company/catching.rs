//! The catching stack as company of the classifier.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::{Scope, ScopedJoinHandle};
use std::time::Duration;

use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_roles::RoleSettings;
use tactnet_catching_stage::{CatchRun, RunEvent, RunReport, WorldSettings};
use tactnet_channel::{Bus, Domain, Start, Table, Wait};

use super::CompanyReport;
use crate::{Scheduling, SimulationError, Trip};

/// Timeout for the start of all processes, which start one after the other.
const START_TIMEOUT: Duration = Duration::from_secs(60);

/// A running catching stack and the thread that times its commands.
pub(crate) struct RunningStack<'scope> {
    run: ScopedJoinHandle<'scope, Result<RunReport, SimulationError>>,
    commands: ScopedJoinHandle<'scope, Result<(Vec<Trip>, u64), SimulationError>>,
}

/// Returns the table with the channels of the catching stack added.
pub(crate) fn channels(table: Table, program: &Path) -> Result<Table, SimulationError> {
    Ok(catch_run(program, Scheduling::Usual).channels(table)?)
}

impl<'scope> RunningStack<'scope> {
    /// Starts the stack and waits until it is ready; setting `over` ends it.
    pub(crate) fn start<'env>(
        scope: &'scope Scope<'scope, 'env>,
        program: &'env Path,
        (table, path): (&'env Table, &'env Path),
        scheduling: Scheduling,
        over: &'env AtomicBool,
    ) -> Result<Self, SimulationError> {
        let bus = Bus::open(Domain::Host, table)?;
        let commands = scope.spawn(move || follow_commands(&bus, over));
        let (started, has_started) = channel();
        let run = scope.spawn(move || {
            let run = catch_run(program, scheduling);
            let mut on_event = |event| announce_start(&event, &started);
            let stopped = || over.load(Ordering::Relaxed);
            Ok(run.run_on(table, path, &mut on_event, &stopped)?)
        });
        let running = Self { run, commands };
        match has_started.recv_timeout(START_TIMEOUT) {
            Ok(()) => Ok(running),
            Err(RecvTimeoutError::Timeout) => Err(SimulationError::child(
                "catching stack",
                "is not ready after a minute",
            )),
            // The run has ended; its error is returned.
            Err(RecvTimeoutError::Disconnected) => running.end().and(Err(SimulationError::Stopped)),
        }
    }

    /// Returns true if the stack has ended by itself.
    pub(crate) fn has_ended(&self) -> bool {
        self.run.is_finished()
    }

    /// Waits until the stack has ended after `over` was set, and returns its report.
    pub(crate) fn end(self) -> Result<CompanyReport, SimulationError> {
        let report = self
            .run
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        let (trips, missed) = self
            .commands
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        let lost = report.processes.values().map(|of| of.lost).sum::<u64>();
        Ok(CompanyReport {
            trips,
            lost: lost + missed,
            catching: Some(report),
        })
    }
}

fn catch_run(program: &Path, scheduling: Scheduling) -> CatchRun<'_> {
    CatchRun {
        program,
        folder: Path::new(""),
        stack: RoleSettings::default(),
        world: WorldSettings::default(),
        feel: None,
        throws: None,
        seconds: None,
        record: None,
        git: "",
        priority: (scheduling == Scheduling::Fifo).then_some(80),
    }
}

fn announce_start(event: &RunEvent, started: &Sender<()>) {
    if let RunEvent::Started(_) = event {
        // The receiver is gone if the start timed out.
        let _ = started.send(());
    }
}

/// Returns the delays from the controller's ticks to its commands, from the timestamps in the packets, and the number
/// of lost commands.
fn follow_commands(bus: &Bus, over: &AtomicBool) -> Result<(Vec<Trip>, u64), SimulationError> {
    let commands = bus.get_port::<JointCommand>("joint/command", Start::Now)?;
    let poll = Wait::Block {
        timeout: Duration::from_millis(100),
    };
    let mut trips = Vec::new();
    while !over.load(Ordering::Relaxed) {
        let Some(packet) = commands.get(poll)? else {
            continue;
        };
        let put_ns = packet.header().put_ns;
        if let Some(command) = packet.first() {
            let round_ns = put_ns.saturating_sub(command.command_ns);
            trips.push(Trip {
                at_ns: put_ns,
                round_ns: u32::try_from(round_ns).unwrap_or(u32::MAX),
            });
        }
    }
    Ok((trips, commands.lost()))
}
