//! A run of the whole stack: starts and supervises hub, world and all processes until the end.

mod observer;
mod processes;

use std::path::Path;
use std::time::{Duration, Instant};

use tactnet_catching_packets::packets::{CalibrationState, CatchOutcome, ThrownBack};
use tactnet_catching_roles::{RoleSettings, catching_channels};
use tactnet_channel::{Bus, Domain, Hub, Table, TemporaryBus, temporary_bus_name};
use tactnet_skin::ServeConfig;

use crate::run_recorder::RunRecorder;
use crate::run_report::FinishedRun;
use crate::{RunReport, StageError, WorldSettings};
use observer::RunObserver;
use processes::Processes;

/// Polling period of the processes.
const LOOK: Duration = Duration::from_millis(10);
/// Timeout without a throw after which the run fails, in s.
const NO_THROW: u64 = 60;
/// Time without a held or flying ball after which a run ends.
const QUIET: Duration = Duration::from_millis(1500);
/// A run of the whole stack in the simulated world, in real time.
#[derive(Debug, Clone)]
pub struct CatchRun<'a> {
    /// Executable of the `tactnet` command.
    pub program: &'a Path,
    /// Folder for the table of channels.
    pub folder: &'a Path,
    /// Settings of the stack.
    pub stack: RoleSettings,
    /// Settings of the world.
    pub world: WorldSettings,
    /// Tactile classifier for caught balls; `None` disables it.
    pub feel: Option<Feel<'a>>,
    /// Number of throws after which the run ends.
    pub throws: Option<u64>,
    /// Time after which the run ends, in s.
    pub seconds: Option<f64>,
    /// File that records all channels except pictures.
    pub record: Option<&'a Path>,
    /// Commit of the program, for the recording.
    pub git: &'a str,
    /// SCHED_FIFO priority of the 1 kHz loops and the world, from 1 to 99.
    pub priority: Option<u8>,
}

/// Classifier process, and simulated skin of the hand that sweeps over caught balls.
#[derive(Debug, Clone)]
pub struct Feel<'a> {
    /// Run directory of the network.
    pub run: &'a Path,
    /// Settings of the simulated skin, as the process of the skin reads them.
    pub skin: String,
}

/// Event of a run.
#[derive(Debug, Clone, PartialEq)]
pub enum RunEvent {
    /// All processes are ready. Holds their names and process IDs.
    Started(Vec<(String, u32)>),
    /// A throw is finished.
    Thrown {
        /// Number of finished throws.
        throws: u64,
        /// Number of caught balls.
        caught: u64,
        /// Outcome of this throw.
        outcome: CatchOutcome,
    },
    /// A ball that was thrown back has landed.
    ThrownBack(ThrownBack),
    /// A throw back failed. Holds the reason.
    NotThrown(String),
    /// The calibration no longer holds; the robot needs a new one.
    NoLongerCalibrated(CalibrationState),
    /// A process ended by itself, and will be restarted.
    Ended {
        /// Name of the process.
        name: String,
        /// True if the robot brakes because of it.
        brakes: bool,
        /// Last message of the process.
        said: String,
    },
    /// A process was restarted.
    Restarted {
        /// Name of the process.
        name: String,
        /// New process ID.
        process: u32,
    },
    /// The robot brakes. Holds the reason.
    Braked(String),
}

impl CatchRun<'_> {
    /// Adds the channels and settings of the stack to a table.
    ///
    /// # Errors
    /// A description of the robot that cannot be read.
    pub fn channels(&self, table: Table) -> Result<Table, StageError> {
        let cameras = self.stack.robot()?.description().cameras;
        let pixels = cameras.width as usize * cameras.height as usize;
        let table = catching_channels(table, self.world.pixels.then_some(pixels));
        Ok(self.stack.into_table(table))
    }

    /// Starts all processes on a new bus. Stops them after the last throw, at the end of the time, or when `stopped`
    /// returns true.
    ///
    /// # Errors
    /// Missing channels, processes or files, a process that ends too often, or a robot that does not get ready.
    pub fn run(
        &self,
        on_event: &mut dyn FnMut(RunEvent),
        stopped: &dyn Fn() -> bool,
    ) -> Result<RunReport, StageError> {
        let name = temporary_bus_name("catch");
        let table = match self.feel {
            Some(_) => ServeConfig::default().table(&name),
            None => Table::new(&name),
        };
        let table = self.channels(table)?;
        let path = self.folder.join("robot.toml");
        let processes = self.keep_calibration()?.into_table(table.clone());
        write(&path, &toml::to_string(&processes)?)?;
        let _own = TemporaryBus(&table);
        let hub = Hub::spawn(&table)?;
        let ran = self.run_on(&table, &path, on_event, stopped);
        drop(hub);
        ran
    }

    /// Returns the settings for the stack's processes, with a copy of the calibration file. Restarted processes thus
    /// have the same calibration even if the file has changed.
    fn keep_calibration(&self) -> Result<RoleSettings, StageError> {
        let mut stack = self.stack.clone();
        if let Some(kept) = self.stack.kept()? {
            let path = self.folder.join("calibration.toml");
            write(&path, &kept.to_toml())?;
            stack.calibration = Some(path);
        }
        Ok(stack)
    }

    /// Runs as [`CatchRun::run`], on a bus with a running hub.
    ///
    /// - `table`: table that includes the result of [`CatchRun::channels`]
    /// - `path`: file of the table
    ///
    /// # Errors
    /// Same as [`CatchRun::run`].
    pub fn run_on(
        &self,
        table: &Table,
        path: &Path,
        on_event: &mut dyn FnMut(RunEvent),
        stopped: &dyn Fn() -> bool,
    ) -> Result<RunReport, StageError> {
        let bus = Bus::open(Domain::Host, table)?;
        // The recorder starts first, so that it receives all packets.
        let recording = self
            .record
            .map(|path| RunRecorder::start(&bus, table, path, self.git));
        let recording = recording.transpose()?;
        let mut observer = RunObserver::open(&bus)?;
        let mut processes = Processes::start(self, &bus, path)?;
        on_event(RunEvent::Started(processes.ids()));
        let begun = Instant::now();
        let mut last_throw = Instant::now();
        while !stopped()
            && self
                .seconds
                .is_none_or(|s| begun.elapsed().as_secs_f64() < s)
        {
            std::thread::sleep(LOOK);
            processes.look_after(on_event)?;
            if observer.look(on_event)? {
                last_throw = Instant::now();
            }
            if self.is_over(&observer) {
                break;
            }
            if last_throw.elapsed().as_secs() >= NO_THROW {
                return Err(observer.no_throw(NO_THROW));
            }
        }
        let seconds = begun.elapsed().as_secs_f64();
        let restarts = processes.restarts;
        let (processes, world) = processes.end()?;
        let mut report = RunReport::of(
            &observer.catches,
            FinishedRun {
                processes,
                world,
                restarts,
                seconds,
                recording: recording.map(RunRecorder::finish),
            },
        );
        report.throw_back = self.world.throw_back.then(|| observer.throws.report());
        Ok(report)
    }

    /// Returns true after the last throw; with throwing back, once the last ball is thrown back.
    fn is_over(&self, observer: &RunObserver) -> bool {
        let balls = self.world.balls as u64;
        let over = self
            .throws
            .is_some_and(|throws| observer.catches.outcomes.len() as u64 >= throws * balls);
        over && (!self.world.throw_back || observer.busy.elapsed() > QUIET)
    }
}

fn write(path: &Path, text: &str) -> Result<(), StageError> {
    std::fs::write(path, text).map_err(|source| StageError::Io {
        path: path.into(),
        source,
    })
}
