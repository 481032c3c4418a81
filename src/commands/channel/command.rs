//! `tactnet channel command`: manual commands to the online classifier.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::bail;
use clap::{Args, ValueEnum};
use tactnet_channel::{Bus, Domain, Priority, Start, Wait};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{Command, Event, SweepCommand, TactileStatus, Text};

use super::TableArgs;
use crate::failure;
use crate::output;
use crate::stop::Stop;
use crate::table;

/// Maximum length of a material's name in a command, in bytes.
const NAME: usize = 56;

/// Maximum sleep, which bounds the reaction time to Ctrl-C.
const LOOK: Wait = Wait::Block {
    timeout: Duration::from_millis(50),
};

/// Kind of the command.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum CommandChoice {
    /// Start a sweep with the next frame
    Start,
    /// End the sweep
    Stop,
    /// Forget the fused sweeps: the next sweep is of another object
    Reset,
    /// Learn a new material from the newest sweeps
    Enroll,
    /// Adapt the model to the newest sweeps, which must be of mixed materials
    Adapt,
}

impl CommandChoice {
    fn command(self) -> Command {
        match self {
            Self::Start => Command::Start,
            Self::Stop => Command::Stop,
            Self::Reset => Command::Reset,
            Self::Enroll => Command::Enroll,
            Self::Adapt => Command::Adapt,
        }
    }

    /// Returns true if the event is the answer to the command.
    fn is_answered_by(self, event: Event) -> bool {
        event == Event::Refused
            || match self {
                Self::Start => event == Event::Begun,
                Self::Stop => matches!(event, Event::Classified | Event::Rejected),
                Self::Reset => event == Event::Reset,
                Self::Enroll => event == Event::Enrolled,
                Self::Adapt => event == Event::Adapted,
            }
    }

    /// Returns true if the command changes the model, from a number of sweeps.
    fn changes_model(self) -> bool {
        matches!(self, Self::Enroll | Self::Adapt)
    }
}

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet channel command start --table robot.toml --motion 1\n  \
    tactnet channel command stop --table robot.toml --motion 1\n  \
    tactnet channel command reset --table robot.toml                                       the next sweep is of another object\n  \
    tactnet channel command enroll --table robot.toml --material felt --sweeps 5           the five newest sweeps were on felt\n  \
    tactnet channel command adapt --table robot.toml --sweeps 32                           another skin: the 32 newest sweeps were on many materials\n\n\
    Prints the answer of the classifier. Exit code 2: it refuses, or no classifier runs; 1: no answer, or the sweep was rejected.")]
pub struct CommandArgs {
    /// Kind of the command
    #[arg(value_enum, value_name = "COMMAND")]
    command: CommandChoice,
    #[command(flatten)]
    table: TableArgs,
    /// Number of the finger, from 0, in the order of the table
    #[arg(long, value_name = "N", default_value_t = 0)]
    finger: u32,
    /// Number of the motion; beliefs repeat it
    #[arg(long, value_name = "N", default_value_t = 0)]
    motion: u64,
    /// `enroll`: name of the new material; `start`: material under the finger, for recordings and the page
    #[arg(long, value_name = "NAME", required_if_eq("command", "enroll"))]
    material: Option<String>,
    /// `enroll`, `adapt`: number of the newest complete sweeps to learn from
    #[arg(long, value_name = "N", required_if_eq_any([("command", "enroll"), ("command", "adapt")]))]
    sweeps: Option<u32>,
    /// Timeout of the answer, in seconds [default: 5; `enroll`, `adapt`: 60]
    #[arg(long, value_name = "S", value_parser = seconds)]
    wait: Option<Duration>,
}

fn seconds(text: &str) -> Result<Duration, String> {
    text.parse()
        .ok()
        .and_then(|seconds: f64| Duration::try_from_secs_f64(seconds).ok())
        .ok_or_else(|| "expected seconds, 0 or more".into())
}

impl CommandArgs {
    fn packet(&self) -> anyhow::Result<SweepCommand> {
        let material = self.material.as_deref().unwrap_or_default();
        if material.len() > NAME {
            bail!(
                "--material: expected at most {NAME} bytes, found {}",
                material.len()
            );
        }
        if self.sweeps.is_some() && !self.command.changes_model() {
            bail!("--sweeps: expected only with `enroll` and `adapt`");
        }
        Ok(SweepCommand {
            kind: self.command.command() as u32,
            finger: self.finger,
            motion: self.motion,
            sweeps: self.sweeps.unwrap_or_default(),
            reserved: 0,
            material: Text::new(material),
        })
    }
}

/// Runs the command.
pub fn run(arguments: &CommandArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let packet = arguments.packet()?;
    let table = table::load(&arguments.table.table)?;
    let config = ServeConfig::of(&table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let status = bus.get_port::<TactileStatus>(config.status.as_str(), Start::Now)?;
    let commands = bus.put_port::<SweepCommand>(config.command.as_str(), Priority::High)?;
    if commands.put_copy(&[packet])? == 0 {
        bail!(
            "no classifier listens to `{}`: start `tactnet serve --run RUN --table {}`",
            config.command,
            arguments.table.table.display()
        );
    }
    let wait = arguments
        .wait
        .unwrap_or(match arguments.command.changes_model() {
            true => Duration::from_secs(60),
            false => Duration::from_secs(5),
        });
    let begun = Instant::now();
    while begun.elapsed() < wait && !stop.asked() {
        let Some(packets) = status.get(LOOK)? else {
            continue;
        };
        for answer in packets.iter() {
            let Some(event) = Event::of(answer.event) else {
                continue;
            };
            if answer.finger != arguments.finger || !arguments.command.is_answered_by(event) {
                continue;
            }
            let text = answer.text.as_str();
            let place = format!("finger {}, sweep {}", answer.finger, answer.sweep);
            if event == Event::Refused {
                bail!("refused, {place}: {text}");
            }
            let separator = if text.is_empty() { "" } else { ": " };
            output::print(format_args!("{}, {place}{separator}{text}", event.name()))?;
            return Ok(match event {
                Event::Rejected => ExitCode::from(failure::FAILED),
                _ => ExitCode::SUCCESS,
            });
        }
    }
    let why = match arguments.command {
        CommandChoice::Stop => "; possibly no sweep was in progress",
        CommandChoice::Start => {
            "; a sweep begins with the next frame of the skin, and possibly none arrives"
        }
        CommandChoice::Reset | CommandChoice::Enroll | CommandChoice::Adapt => "",
    };
    say!(
        "no answer on `{}` in {:.1} s; the command was put{why}",
        config.status,
        begun.elapsed().as_secs_f64()
    );
    Ok(ExitCode::from(failure::FAILED))
}
