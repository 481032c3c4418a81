//! A run of the whole stack: starts and supervises hub, world and all processes until the end.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use tactnet_catching_packets::packets::{
    ArmPath, CalibrationState, CatchOutcome, CatchPhase, CatchStatus, ControllerCommand,
    ControllerMode, ControllerOrder, ControllerState, HandState, Text, ThrowStatus, ThrownBack,
};
use tactnet_catching_roles::{Role, RoleReport, RoleSettings, catching_channels};
use tactnet_channel::{
    Bus, Domain, GetPort, Hub, Priority, PutPort, Start, Table, now_ns, remove_abandoned_buses,
    remove_bus,
};
use tactnet_process::ReadyProcess;
use tactnet_skin::ServeConfig;

use crate::run_recorder::RunRecorder;
use crate::run_report::LivePacket;
use crate::throw_report::HeardThrows;
use crate::world_role::WorldReport;
use crate::{RunReport, StageError, WorldSettings};

/// Polling period of the processes.
const LOOK: Duration = Duration::from_millis(10);
/// Timeout without a throw after which the run fails, in s.
const NO_THROW: u64 = 60;
/// Time without a held or flying ball after which a run ends.
const QUIET: Duration = Duration::from_millis(1500);
/// Number of early ends in a row after which a process is not restarted.
const TRIES: usize = 5;
/// Time after the start within which an end counts as early.
const SOON: Duration = Duration::from_secs(5);

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

/// A process of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    World,
    Skin,
    Classifier,
    Role(Role),
}

impl Part {
    fn name(self) -> &'static str {
        match self {
            Self::World => "world",
            Self::Skin => "skin",
            Self::Classifier => "classifier",
            Self::Role(role) => role.name(),
        }
    }

    /// Returns true if the robot brakes when the process ends.
    fn is_needed_to_move(self) -> bool {
        // Without a thrower, the hand keeps its ball.
        !matches!(
            self,
            Self::Skin
                | Self::Classifier
                | Self::Role(Role::Feel | Role::Thrower | Role::SlipWatch)
        )
    }
}

/// Event of a run.
#[derive(Debug, Clone, PartialEq)]
pub enum RunEvent {
    /// All processes are ready. Holds their names and process IDs.
    Started(Vec<(&'static str, u32)>),
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
        name: &'static str,
        /// True if the robot brakes because of it.
        brakes: bool,
        /// Last message of the process.
        said: String,
    },
    /// A process was restarted.
    Restarted {
        /// Name of the process.
        name: &'static str,
        /// New process ID.
        process: u32,
    },
    /// The robot brakes. Holds the reason.
    Braked(String),
}

struct Child {
    name: &'static str,
    part: Part,
    process: ReadyProcess,
    begun: Instant,
    /// Number of early ends in a row.
    soon: usize,
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
        // Failure to clean up is harmless.
        let _ = remove_abandoned_buses("catch");
        let name = format!("catch{}", std::process::id());
        let table = match self.feel {
            Some(_) => ServeConfig::default().table(&name),
            None => Table::new(&name),
        };
        let table = self.channels(table)?;
        let path = self.folder.join("robot.toml");
        let processes = self.keep_calibration()?.into_table(table.clone());
        write(&path, &toml::to_string(&processes)?)?;
        let _own = OwnBus(&table);
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
        let mut watched = Watched::open(&bus)?;
        let mut children = Vec::new();
        for part in self.parts() {
            children.push(self.start(part, path)?);
        }
        on_event(RunEvent::Started(
            children
                .iter()
                .map(|child| (child.name, child.process.id()))
                .collect(),
        ));
        let begun = Instant::now();
        let mut last_throw = Instant::now();
        let mut restarts = 0;
        while !stopped()
            && self
                .seconds
                .is_none_or(|s| begun.elapsed().as_secs_f64() < s)
        {
            std::thread::sleep(LOOK);
            for child in &mut children {
                restarts += self.look_after(child, path, &watched.orders, on_event)?;
            }
            if watched.look(on_event)? {
                last_throw = Instant::now();
            }
            let balls = self.world.balls as u64;
            let over = self
                .throws
                .is_some_and(|throws| watched.heard.outcomes.len() as u64 >= throws * balls);
            // The run waits until the last ball is thrown back.
            if over && (!self.world.throw_back || watched.busy.elapsed() > QUIET) {
                break;
            }
            if last_throw.elapsed().as_secs() >= NO_THROW {
                return Err(watched.no_throw());
            }
        }
        let seconds = begun.elapsed().as_secs_f64();
        // The controller stops last, so that the robot stands still by then.
        let mut parts = Vec::new();
        let mut world = WorldReport::default();
        for child in children.into_iter().rev() {
            let name = child.name;
            let said = child
                .process
                .end()
                .map_err(|source| StageError::Process { name, source })?;
            if child.part == Part::World {
                world = report_of(&said).unwrap_or_default();
            } else if let Part::Role(_) = child.part
                && let Some(report) = report_of::<RoleReport>(&said)
            {
                parts.push((name, report));
            }
        }
        parts.reverse();
        let recorded = recording.map(RunRecorder::finish);
        let mut report = RunReport::of(&watched.heard, parts, world, restarts, seconds, recorded);
        report.throw_back = self.world.throw_back.then(|| watched.throws.report());
        Ok(report)
    }

    /// Returns the processes of the run, in a valid start order.
    fn parts(&self) -> Vec<Part> {
        let mut parts = vec![Part::World];
        if self.feel.is_some() {
            parts.extend([Part::Skin, Part::Classifier]);
        }
        let roles = Role::ALL.into_iter().filter(|role| match role {
            Role::Eyes => self.world.pixels,
            Role::Feel => self.feel.is_some(),
            Role::Thrower => self.world.throw_back,
            Role::SlipWatch => self.stack.calibration.is_some(),
            _ => true,
        });
        parts.extend(roles.map(Part::Role));
        parts
    }

    fn start(&self, part: Part, table: &Path) -> Result<Child, StageError> {
        let name = part.name();
        let mut command = Command::new(self.program);
        match (part, &self.feel) {
            (Part::Classifier, Some(feel)) => {
                command.args(["serve", "--json", "--metrics", "off", "--run"]);
                command.arg(feel.run);
            }
            _ => {
                command.args(["catch", "role", name]);
            }
        }
        let is_fast = match part {
            Part::World => true,
            Part::Role(role) => role.is_fast(),
            Part::Skin | Part::Classifier => false,
        };
        if let Some(priority) = self.priority.filter(|_| is_fast) {
            command.args(["--priority", &priority.to_string()]);
        }
        command.arg("--table").arg(table);
        // Only the world receives its settings.
        let started = match (part, &self.feel) {
            (Part::World, _) => {
                ReadyProcess::start_with_input(&mut command, &settings_line(&self.world)?)
            }
            (Part::Skin, Some(feel)) => ReadyProcess::start_with_input(&mut command, &feel.skin),
            _ => ReadyProcess::start(&mut command),
        };
        let process = started.and_then(|mut process| {
            process.wait_until_ready()?;
            Ok(process)
        });
        Ok(Child {
            name,
            part,
            process: process.map_err(|source| StageError::Process { name, source })?,
            begun: Instant::now(),
            soon: 0,
        })
    }

    /// Restarts a process that has ended, and brakes the robot if necessary. Returns 1 for a restart, otherwise 0.
    fn look_after(
        &self,
        child: &mut Child,
        table: &Path,
        orders: &PutPort<ControllerCommand>,
        on_event: &mut dyn FnMut(RunEvent),
    ) -> Result<u64, StageError> {
        let name = child.name;
        let failed = |source| StageError::Process { name, source };
        if child.process.ended().map_err(failed)?.is_none() {
            return Ok(0);
        }
        let brakes = child.part.is_needed_to_move();
        if brakes {
            orders.put_copy(&[ControllerCommand {
                command_ns: now_ns(),
                command: ControllerOrder::Brake as u64,
                reason: Text::new(&format!("the {name} has ended")),
            }])?;
        }
        let said = child.process.last_words();
        let soon = if child.begun.elapsed() < SOON {
            child.soon + 1
        } else {
            1
        };
        on_event(RunEvent::Ended {
            name,
            said: said.clone(),
            brakes,
        });
        if soon >= TRIES {
            return Err(StageError::KeepsEnding {
                name,
                times: soon,
                said,
            });
        }
        *child = self.start(child.part, table)?;
        child.soon = soon;
        on_event(RunEvent::Restarted {
            name,
            process: child.process.id(),
        });
        Ok(1)
    }
}

struct Watched {
    outcomes: GetPort<CatchOutcome>,
    paths: GetPort<ArmPath>,
    states: GetPort<ControllerState>,
    status: GetPort<CatchStatus>,
    hands: GetPort<HandState>,
    throw_states: GetPort<ThrowStatus>,
    backs: GetPort<ThrownBack>,
    holds: GetPort<CalibrationState>,
    orders: PutPort<ControllerCommand>,
    heard: LivePacket,
    throws: HeardThrows,
    /// Time of the last held ball or finished throw.
    busy: Instant,
    mode: Option<ControllerMode>,
    phase: CatchStatus,
}

impl Watched {
    fn open(bus: &Bus) -> Result<Self, StageError> {
        Ok(Self {
            outcomes: bus.get_port("catch/outcome", Start::Now)?,
            paths: bus.get_port("arm/path", Start::Now)?,
            states: bus.get_port("controller/state", Start::Now)?,
            status: bus.get_port("catch/state", Start::Now)?,
            hands: bus.get_port("hand/state", Start::Now)?,
            throw_states: bus.get_port("throw/state", Start::Now)?,
            backs: bus.get_port("throw/outcome", Start::Now)?,
            holds: bus.get_port("calibration/state", Start::Now)?,
            orders: bus.put_port("controller/command", Priority::High)?,
            heard: LivePacket::default(),
            throws: HeardThrows::default(),
            busy: Instant::now(),
            mode: None,
            phase: bytemuck::Zeroable::zeroed(),
        })
    }

    /// Takes all waiting packets. Returns true if a throw finished.
    fn look(&mut self, on_event: &mut dyn FnMut(RunEvent)) -> Result<bool, StageError> {
        let before = self.heard.outcomes.len() + self.throws.count();
        while let Some(packet) = self.paths.try_get()? {
            let put_ns = packet.header().put_ns;
            packet
                .iter()
                .for_each(|path| self.heard.times.path(put_ns, path));
        }
        while let Some(packet) = self.states.try_get()? {
            for state in packet.iter() {
                let mode = state.mode();
                if mode == Some(ControllerMode::Braking) && self.mode != mode {
                    let why = state.reason.as_str().to_string();
                    self.heard.braked(&why);
                    on_event(RunEvent::Braked(why));
                }
                self.heard.refused(state.refused, state.reason.as_str());
                self.mode = mode;
            }
        }
        while let Some(packet) = self.status.try_get()? {
            if let Some(status) = packet.first() {
                self.phase = *status;
                self.heard.no_plans = self.heard.no_plans.max(status.no_plans);
            }
        }
        while let Some(packet) = self.outcomes.try_get()? {
            for outcome in packet.iter() {
                self.heard.outcome(outcome);
                let caught = self.heard.outcomes.iter().filter(|o| o.caught == 1).count();
                on_event(RunEvent::Thrown {
                    throws: self.heard.outcomes.len() as u64,
                    caught: caught as u64,
                    outcome: *outcome,
                });
            }
        }
        while let Some(packet) = self.throw_states.try_get()? {
            for why in packet
                .iter()
                .filter_map(|status| self.throws.status(status))
            {
                on_event(RunEvent::NotThrown(why));
            }
        }
        while let Some(packet) = self.backs.try_get()? {
            for thrown in packet.iter() {
                self.throws.thrown(thrown);
                on_event(RunEvent::ThrownBack(*thrown));
            }
        }
        let throws = self.heard.outcomes.len() as u64;
        while let Some(packet) = self.holds.try_get()? {
            for state in packet.iter() {
                if self.heard.hold.take(state, throws) {
                    on_event(RunEvent::NoLongerCalibrated(*state));
                }
            }
        }
        let over = self.heard.outcomes.len() + self.throws.count() > before;
        let mut holds = false;
        while let Some(packet) = self.hands.try_get()? {
            holds |= packet.iter().any(|hand| hand.holds == 1);
        }
        if over || holds {
            self.busy = Instant::now();
        }
        Ok(over)
    }

    fn no_throw(&self) -> StageError {
        let phase = match self.phase.phase() {
            None | Some(CatchPhase::Starting) => "is starting",
            Some(CatchPhase::Armed) => "waits",
            Some(CatchPhase::Tracking) => "sees a ball",
            Some(CatchPhase::Reaching) => "reaches",
            Some(CatchPhase::Closed) => "has closed its hands",
            Some(CatchPhase::GoingBack) => "goes back",
            Some(CatchPhase::Braking) => "brakes",
            Some(CatchPhase::Stuck) => "is stuck",
            Some(CatchPhase::Throwing) => "throws",
        };
        StageError::NoThrow {
            seconds: NO_THROW,
            phase,
            reason: self.phase.reason.as_str().into(),
        }
    }
}

/// A bus whose shared memory is removed on drop.
struct OwnBus<'a>(&'a Table);

impl Drop for OwnBus<'_> {
    fn drop(&mut self) {
        // Failure to clean up is harmless.
        let _ = remove_bus(self.0);
    }
}

fn write(path: &Path, text: &str) -> Result<(), StageError> {
    std::fs::write(path, text).map_err(|source| StageError::Io {
        path: path.into(),
        source,
    })
}

/// Returns the settings of the world as a line, as the process of the world reads them.
fn settings_line(settings: &WorldSettings) -> Result<String, StageError> {
    serde_json::to_string(settings).map_err(|error| StageError::Io {
        path: PathBuf::from("the world's settings"),
        source: error.into(),
    })
}

/// Parses a report; returns `None` if the process was killed.
fn report_of<T: serde::de::DeserializeOwned>(text: &str) -> Option<T> {
    serde_json::from_str(text.trim()).ok()
}
