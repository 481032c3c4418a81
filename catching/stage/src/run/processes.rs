//! Processes of a run: start, supervision, end.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use tactnet_catching_packets::packets::{ControllerCommand, ControllerOrder, Text};
use tactnet_catching_roles::channels::CONTROLLER_COMMAND;
use tactnet_catching_roles::{Role, RoleReport};
use tactnet_channel::{Bus, PutPort, now_ns};
use tactnet_process::ReadyProcess;

use super::{CatchRun, RunEvent};
use crate::world_role::WorldReport;
use crate::{StageError, WorldSettings};

/// Number of early ends in a row after which a process is not restarted.
const TRIES: usize = 5;
/// Time after the start within which an end counts as early.
const SOON: Duration = Duration::from_secs(5);

/// A process of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    World,
    Skin,
    Classifier,
    Role(Role),
}

impl Part {
    fn name(self) -> String {
        match self {
            Self::World => "world".into(),
            Self::Skin => "skin".into(),
            Self::Classifier => "classifier".into(),
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

struct Child {
    name: String,
    part: Part,
    process: ReadyProcess,
    begun: Instant,
    /// Number of early ends in a row.
    soon: usize,
}

pub(super) struct Processes<'a> {
    run: &'a CatchRun<'a>,
    /// File of the table of channels.
    table: &'a Path,
    orders: PutPort<ControllerCommand>,
    children: Vec<Child>,
    /// Number of restarts.
    pub restarts: u64,
}

impl<'a> Processes<'a> {
    /// Starts all processes and waits until they are ready.
    pub fn start(run: &'a CatchRun<'a>, bus: &Bus, table: &'a Path) -> Result<Self, StageError> {
        let orders = CONTROLLER_COMMAND.put(bus)?;
        let mut children = Vec::new();
        for part in run.parts() {
            children.push(run.start(part, table)?);
        }
        Ok(Self {
            run,
            table,
            orders,
            children,
            restarts: 0,
        })
    }

    /// Returns the names and process IDs.
    pub fn ids(&self) -> Vec<(String, u32)> {
        self.children
            .iter()
            .map(|child| (child.name.clone(), child.process.id()))
            .collect()
    }

    /// Restarts processes that have ended, and brakes the robot if necessary.
    pub fn look_after(&mut self, on_event: &mut dyn FnMut(RunEvent)) -> Result<(), StageError> {
        for child in &mut self.children {
            let name = child.name.clone();
            let failed = |source| StageError::Process {
                name: child.name.clone(),
                source,
            };
            if child.process.ended().map_err(failed)?.is_none() {
                continue;
            }
            let brakes = child.part.is_needed_to_move();
            if brakes {
                self.orders.put_copy(&[ControllerCommand {
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
                name: name.clone(),
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
            *child = self.run.start(child.part, self.table)?;
            child.soon = soon;
            self.restarts += 1;
            on_event(RunEvent::Restarted {
                name,
                process: child.process.id(),
            });
        }
        Ok(())
    }

    /// Ends all processes and returns their reports, and that of the world. The controller stops last, so that the
    /// robot stands still by then.
    pub fn end(self) -> Result<(BTreeMap<String, RoleReport>, WorldReport), StageError> {
        let mut reports = BTreeMap::new();
        let mut world = WorldReport::default();
        for child in self.children.into_iter().rev() {
            let name = child.name;
            let said = child.process.end().map_err(|source| StageError::Process {
                name: name.clone(),
                source,
            })?;
            if child.part == Part::World {
                world = report_of(&said).unwrap_or_default();
            } else if let Part::Role(_) = child.part
                && let Some(report) = report_of(&said)
            {
                reports.insert(name, report);
            }
        }
        Ok((reports, world))
    }
}

impl CatchRun<'_> {
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
        for number in 1..self.stack.coordinator.planners() {
            parts.extend([0, 1].map(|arm| Part::Role(Role::Planner { arm, number })));
        }
        parts
    }

    /// Returns the command that runs a process.
    fn command(&self, part: Part, table: &Path) -> Command {
        let mut command = Command::new(self.program);
        match (part, &self.feel) {
            (Part::Classifier, Some(feel)) => {
                command.args(["serve", "--json", "--metrics", "off", "--run"]);
                command.arg(feel.run);
            }
            _ => {
                command.args(["catch", "role", &part.name()]);
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
        command
    }

    fn start(&self, part: Part, table: &Path) -> Result<Child, StageError> {
        let name = part.name();
        let mut command = self.command(part, table);
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
        let failed = |source| StageError::Process {
            name: name.clone(),
            source,
        };
        Ok(Child {
            process: process.map_err(failed)?,
            name,
            part,
            begun: Instant::now(),
            soon: 0,
        })
    }
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
