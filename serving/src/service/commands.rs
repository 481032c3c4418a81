//! Commands of motion controllers and people.

use std::time::{Duration, Instant};

use tactnet_skin::packets::{Command, Event, SweepCommand};
use tactnet_skin::{Segmentation, SweepChange};

use super::Service;
use super::command_rates::COMMAND_RATE;
use super::waiting_commands::MAX_COMMANDS;
use crate::ServeError;
use crate::model_worker::Job;

/// Commands that are looked at before the next frame.
const MAX_LOOKED_AT: usize = 4096;
/// How often it is said that commands were refused.
const TELL_EVERY: Duration = Duration::from_secs(1);

impl Service {
    /// Takes all commands that have come.
    pub(super) fn receive_commands(&mut self) -> Result<(), ServeError> {
        let mut followed = 0;
        // A port looks at those who put in a fixed order: what the first has too many of is passed over, to come to the others.
        for _ in 0..MAX_LOOKED_AT {
            let Some(command) = self.commands.try_get()? else {
                break;
            };
            let header = *command.header();
            if !self.command_rates.allow(header.sender, Instant::now()) {
                self.refused_commands += 1;
                continue;
            }
            followed += 1;
            if followed > MAX_COMMANDS {
                self.refused_commands += 1;
                break;
            }
            // Another host's clock says nothing here.
            let put_ns = if header.remote == 1 { 0 } else { header.put_ns };
            if let Some(command) = command.first()
                && !self.waiting.add(put_ns, *command)
            {
                self.publish_status(
                    Event::Refused,
                    command.finger,
                    format_args!(
                        "more than {MAX_COMMANDS} commands wait for frames of this finger"
                    ),
                )?;
            }
        }
        if self.refused_commands > 0 && self.told_refused.elapsed() > TELL_EVERY {
            self.told_refused = Instant::now();
            let refused = std::mem::take(&mut self.refused_commands);
            self.publish_status(
                Event::Refused,
                0,
                format_args!(
                    "{refused} commands refused: more than {COMMAND_RATE} a second of one putter"
                ),
            )?;
        }
        let lost = self.commands.lost();
        if lost > self.lost_commands {
            let more = lost - self.lost_commands;
            self.lost_commands = lost;
            self.publish_status(Event::Refused, 0, format_args!("{more} commands were lost"))?;
        }
        Ok(())
    }

    /// Follows the commands that were put until then, so that a command divides the frames at its own time, whenever it is seen.
    pub(super) fn follow_waiting(
        &mut self,
        until_ns: u64,
        finger: Option<usize>,
    ) -> Result<(), ServeError> {
        while let Some(command) = self.waiting.take(until_ns, finger) {
            self.command(&command)?;
        }
        Ok(())
    }

    fn command(&mut self, command: &SweepCommand) -> Result<(), ServeError> {
        let number = command.finger;
        let by_contact = self.config.segmenter.segmentation != Segmentation::Command;
        let Some(finger) = self.fingers.get_mut(number as usize) else {
            return self.publish_status(
                Event::Refused,
                number,
                format_args!(
                    "no finger {number}; there are {}",
                    self.config.fingers.len()
                ),
            );
        };
        match command.command() {
            Some(Command::Start | Command::Stop) if by_contact => self.publish_status(
                Event::Refused,
                number,
                format_args!("sweeps begin and end by contact"),
            ),
            Some(Command::Start) => {
                let change = finger.segmenter.start();
                if let SweepChange::RejectedAndBegun(reject) = change {
                    self.reject(number as usize, &reject)?;
                }
                self.begin(number as usize, command.motion)
            }
            Some(Command::Stop) => {
                let change = finger.segmenter.stop();
                self.apply_change(number as usize, change, 0, 0)
            }
            Some(Command::Reset) => {
                finger.classifier.reset();
                finger.recent.forget();
                self.publish_status(Event::Reset, number, format_args!("fused sweeps forgotten"))
            }
            Some(Command::Enroll) => self.enroll(number, command),
            None => {
                let kind = command.kind;
                self.publish_status(Event::Refused, number, format_args!("no command {kind}"))
            }
        }
    }

    fn enroll(&mut self, number: u32, command: &SweepCommand) -> Result<(), ServeError> {
        let recent = &self.fingers[number as usize].recent;
        let kept = recent.kept();
        let (material, sweeps) = (command.material, command.sweeps);
        if material.as_str().is_empty() {
            return self.publish_status(Event::Refused, number, format_args!("enrol: no name"));
        }
        let Some(digits) = recent.newest(sweeps as usize) else {
            return self.publish_status(
                Event::Refused,
                number,
                format_args!(
                    "enrol `{}`: {sweeps} sweeps asked for, {kept} are kept: whole ones since the last reset",
                    material.as_str()
                ),
            );
        };
        if self
            .worker
            .ask(Job::Enroll {
                finger: number,
                material,
                digits,
            })
            .is_err()
        {
            return self.publish_status(
                Event::Refused,
                number,
                format_args!("enrol `{}`: busy, try again", material.as_str()),
            );
        }
        Ok(())
    }
}
