//! What runs beside the classifier in a soak test.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::{Scope, ScopedJoinHandle};
use std::time::Duration;

use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_roles::RoleSettings;
use tactnet_catching_stage::{CatchRun, RunEvent, RunReport, WorldSettings};
use tactnet_channel::{Bus, Domain, Start, Table, Wait};

use crate::{CatchingStack, RehearsalError, Scheduling, Trip, catching_table, trips};

/// Its processes start one after the other.
const STARTING: Duration = Duration::from_secs(60);

/// What runs beside the classifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Company {
    /// Processes that send each other packets as the catching stack does, two pictures of 2 megapixels among them, and compute next to nothing.
    #[default]
    Load,
    /// The catching stack itself, before the simulated world that throws balls at it.
    Catching,
}

/// What came of it.
#[derive(Debug)]
pub(crate) struct CompanyReport {
    /// Of the 1 kHz loop.
    pub trips: Vec<Trip>,
    /// Packets that were put and never came.
    pub lost: u64,
    /// Of the catching stack.
    pub catching: Option<RunReport>,
}

/// The company while it runs.
pub(crate) enum Running<'scope> {
    Load(CatchingStack),
    Catching {
        run: ScopedJoinHandle<'scope, Result<RunReport, RehearsalError>>,
        commands: ScopedJoinHandle<'scope, Result<(Vec<Trip>, u64), RehearsalError>>,
    },
}

impl Company {
    /// Adds its channels to a table.
    pub(crate) fn channels(self, table: Table, program: &Path) -> Result<Table, RehearsalError> {
        Ok(match self {
            Self::Load => catching_table(table),
            Self::Catching => catch_run(program, Scheduling::Usual).channels(table)?,
        })
    }

    /// Starts it, and waits until all of it is ready.
    ///
    /// - `path`: where the table is written
    /// - `over`: ends it once it is true
    pub(crate) fn start<'scope, 'env>(
        self,
        scope: &'scope Scope<'scope, 'env>,
        program: &'env Path,
        (table, path): (&'env Table, &'env Path),
        scheduling: Scheduling,
        over: &'env AtomicBool,
    ) -> Result<Running<'scope>, RehearsalError> {
        if self == Self::Load {
            return Ok(Running::Load(CatchingStack::start(
                program, path, scheduling,
            )?));
        }
        let bus = Bus::open(Domain::Host, table)?;
        let commands = scope.spawn(move || follow_commands(&bus, over));
        let (started, has_started) = channel();
        let run = scope.spawn(move || {
            let run = catch_run(program, scheduling);
            let mut on_event = |event| tell_start(&event, &started);
            let stopped = || over.load(Ordering::Relaxed);
            Ok(run.run_on(table, path, &mut on_event, &stopped)?)
        });
        let running = Running::Catching { run, commands };
        match has_started.recv_timeout(STARTING) {
            Ok(()) => Ok(running),
            Err(RecvTimeoutError::Timeout) => Err(RehearsalError::child(
                "catching stack",
                "is not ready after a minute",
            )),
            // It has ended, and says why.
            Err(RecvTimeoutError::Disconnected) => running.end().and(Err(RehearsalError::Stopped)),
        }
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

fn tell_start(event: &RunEvent, started: &Sender<()>) {
    if let RunEvent::Started(_) = event {
        // Whoever waited has given up.
        let _ = started.send(());
    }
}

/// Times from the controller's beats to its commands, from the stamps in their packets, and how many commands were lost.
fn follow_commands(bus: &Bus, over: &AtomicBool) -> Result<(Vec<Trip>, u64), RehearsalError> {
    let commands = bus.get_port::<JointCommand>("joint/command", Start::Now)?;
    let patience = Wait::Block {
        timeout: Duration::from_millis(100),
    };
    let mut trips = Vec::new();
    while !over.load(Ordering::Relaxed) {
        let Some(packet) = commands.get(patience)? else {
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

impl Running<'_> {
    /// Returns true if it has ended by itself.
    pub(crate) fn has_ended(&self) -> bool {
        match self {
            Self::Load(_) => false,
            Self::Catching { run, .. } => run.is_finished(),
        }
    }

    /// Ends it and returns what came of it; what was started with `over` ends by that.
    pub(crate) fn end(self) -> Result<CompanyReport, RehearsalError> {
        match self {
            Self::Load(stack) => {
                let reports = stack.end()?;
                Ok(CompanyReport {
                    trips: trips(&reports)?.to_vec(),
                    lost: reports.iter().map(|report| report.lost).sum(),
                    catching: None,
                })
            }
            Self::Catching { run, commands } => {
                let report = run
                    .join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
                let (trips, unheard) = commands
                    .join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
                let lost = report.processes.values().map(|of| of.lost).sum::<u64>();
                Ok(CompanyReport {
                    trips,
                    lost: lost + unheard,
                    catching: Some(report),
                })
            }
        }
    }
}
