//! Processes that run beside the classifier in a soak test.

#[cfg(feature = "catching")]
mod catching;

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::thread::Scope;

use tactnet_channel::Table;

use crate::{CatchingLoad, Scheduling, SimulationError, Trip, load_table, trips};

/// Kind of processes that share the machine with the classifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Company {
    /// Processes with the packet load of the catching stack, including two 2-megapixel images, but almost no computation.
    #[default]
    Load,
    /// The catching stack in its simulated world.
    #[cfg(feature = "catching")]
    Catching,
}

/// Measurements of the company.
#[derive(Debug)]
pub(crate) struct CompanyReport {
    /// Round trips of the 1 kHz loop.
    pub trips: Vec<Trip>,
    /// Number of packets that were sent but not received.
    pub lost: u64,
    /// Report of the catching stack, if it ran.
    #[cfg(feature = "catching")]
    pub catching: Option<tactnet_catching_stage::RunReport>,
}

/// A running company.
pub(crate) enum Running<'scope> {
    Load(CatchingLoad, std::marker::PhantomData<&'scope ()>),
    #[cfg(feature = "catching")]
    Catching(catching::RunningStack<'scope>),
}

impl Company {
    /// Returns the table with the channels of the company added.
    pub(crate) fn channels(self, table: Table, program: &Path) -> Result<Table, SimulationError> {
        match self {
            Self::Load => {
                let _ = program;
                Ok(load_table(table))
            }
            #[cfg(feature = "catching")]
            Self::Catching => catching::channels(table, program),
        }
    }

    /// Starts the company and waits until all of it is ready.
    /// Starts the company and waits until all of its processes are ready.
    ///
    /// - `path`: file of the table
    /// - `over`: set to true to end the company
    pub(crate) fn start<'scope, 'env>(
        self,
        scope: &'scope Scope<'scope, 'env>,
        program: &'env Path,
        (table, path): (&'env Table, &'env Path),
        scheduling: Scheduling,
        over: &'env AtomicBool,
    ) -> Result<Running<'scope>, SimulationError> {
        match self {
            Self::Load => {
                let _ = (scope, table, over);
                let load = CatchingLoad::start(program, path, scheduling)?;
                Ok(Running::Load(load, std::marker::PhantomData))
            }
            #[cfg(feature = "catching")]
            Self::Catching => {
                catching::RunningStack::start(scope, program, (table, path), scheduling, over)
                    .map(Running::Catching)
            }
        }
    }
}

impl Running<'_> {
    /// Returns true if the company has ended by itself.
    pub(crate) fn has_ended(&self) -> bool {
        match self {
            Self::Load(..) => false,
            #[cfg(feature = "catching")]
            Self::Catching(stack) => stack.has_ended(),
        }
    }

    /// Ends the company and returns its report.
    pub(crate) fn end(self) -> Result<CompanyReport, SimulationError> {
        match self {
            Self::Load(load, _) => {
                let reports = load.end()?;
                Ok(CompanyReport {
                    trips: trips(&reports)?.to_vec(),
                    lost: reports.iter().map(|report| report.lost).sum(),
                    #[cfg(feature = "catching")]
                    catching: None,
                })
            }
            #[cfg(feature = "catching")]
            Self::Catching(stack) => stack.end(),
        }
    }
}
