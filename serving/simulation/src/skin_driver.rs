//! Simulated skin on its channels, in real time.

use tactnet_channel::{Bus, Priority, PutPort, Ticker};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{Command, SkinFrame, SweepCommand};

use crate::{SimulationError, SkinSimulator};

/// Put-ports of the first finger and of commands.
pub struct SkinDriver {
    frames: PutPort<SkinFrame>,
    commands: PutPort<SweepCommand>,
    speed: f64,
    commanded: Commanded,
}

/// Source of the commands that start and stop sweeps.
#[derive(Clone, Copy, PartialEq)]
enum Commanded {
    Here,
    Elsewhere,
}

impl SkinDriver {
    /// Opens the channels.
    ///
    /// # Errors
    /// Fails without a hub, or if channels are missing in the table.
    pub fn open(bus: &Bus, config: &ServeConfig) -> Result<Self, SimulationError> {
        Ok(Self {
            frames: bus.put_port(config.fingers[0].as_str(), Priority::High)?,
            commands: bus.put_port(config.command.as_str(), Priority::High)?,
            speed: 1.0,
            commanded: Commanded::Here,
        })
    }

    /// Sends frames at `speed` times the skin's rate. The sensor's clock is unchanged.
    pub fn at_speed(self, speed: f64) -> Self {
        Self { speed, ..self }
    }

    /// Sends frames without commands.
    pub fn without_commands(self) -> Self {
        Self {
            commanded: Commanded::Elsewhere,
            ..self
        }
    }

    /// Sends frames and commands at the skin's rate.
    ///
    /// - `on_start`: called with the number of each motion that starts
    /// - `ended`: called before every frame with the number of ended motions; returns true to stop
    ///
    /// # Errors
    /// Fails if the channels break down or `on_start` fails.
    pub fn run<E: From<SimulationError>>(
        &self,
        skin: &mut SkinSimulator<'_>,
        mut on_start: impl FnMut(&SkinSimulator<'_>, u64) -> Result<(), E>,
        ended: &dyn Fn(u64) -> bool,
    ) -> Result<(), E> {
        let failed = |error| E::from(SimulationError::Channel(error));
        let mut ticker = Ticker::new(skin.rate_hz() * self.speed);
        let mut motions = 0;
        while !ended(motions) {
            ticker.wait();
            let step = skin.step();
            if let Some(command) = step.command {
                if self.commanded == Commanded::Here {
                    self.commands.put_copy(&[command]).map_err(failed)?;
                }
                match command.command() {
                    Some(Command::Start) => on_start(skin, command.motion)?,
                    _ => motions = command.motion,
                }
                if ended(motions) {
                    break;
                }
            }
            self.frames.put_copy(&[step.frame]).map_err(failed)?;
        }
        Ok(())
    }
}
