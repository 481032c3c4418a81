//! Commands of motion controllers and people.

use std::time::{Duration, Instant};

use tactnet_channel::now_ns;
use tactnet_skin::packets::{Command, Event, SweepCommand};
use tactnet_skin::{Segmentation, SweepChange};

use super::Service;
use super::command_rates::COMMAND_RATE;
use super::waiting_commands::MAX_COMMANDS;
use crate::ServeError;
use crate::model_worker::Job;

/// Maximum number of commands read before the next frame.
const MAX_READ: usize = 4096;
/// Minimum time between two reports of refused commands.
const REPORT_INTERVAL: Duration = Duration::from_secs(1);

impl Service {
    /// Reads all waiting commands.
    pub(super) fn receive_commands(&mut self) -> Result<(), ServeError> {
        let mut followed = 0;
        // A port reads its senders in a fixed order: excess commands of the first are skipped to reach the others.
        for _ in 0..MAX_READ {
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
            // The clock of another host is not comparable.
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
        if self.refused_commands > 0 && self.refusals_reported.elapsed() > REPORT_INTERVAL {
            self.refusals_reported = Instant::now();
            let refused = std::mem::take(&mut self.refused_commands);
            self.publish_status(
                Event::Refused,
                0,
                format_args!(
                    "{refused} commands refused: more than {COMMAND_RATE} a second from one sender"
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

    /// Executes the commands sent up to `until_ns`. A command thus splits the frames at its own time, whenever it is read.
    pub(super) fn execute_waiting(
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
                format_args!("the table starts and ends sweeps by contact"),
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
                // A sweep that ends early is classified now.
                let last = finger.sequences.map_or(0, |(_, last)| last);
                self.apply_change(number as usize, change, last, now_ns())
            }
            Some(Command::Reset) => {
                finger.classifier.reset();
                finger.object += 1;
                self.publish_status(Event::Reset, number, format_args!("fused sweeps discarded"))
            }
            Some(Command::Enroll) => self.enroll(number, command),
            Some(Command::Adapt) => self.adapt(number, command.sweeps as usize),
            None => {
                let kind = command.kind;
                self.publish_status(
                    Event::Refused,
                    number,
                    format_args!("unknown command {kind}"),
                )
            }
        }
    }

    fn enroll(&mut self, number: u32, command: &SweepCommand) -> Result<(), ServeError> {
        let material = command.material;
        if material.as_str().is_empty() {
            return self.publish_status(Event::Refused, number, format_args!("enroll: no name"));
        }
        let job = Job::Enroll {
            finger: number,
            object: self.fingers[number as usize].object,
            material,
            sweeps: command.sweeps as usize,
        };
        // The sweeps before the command are among those to enroll.
        if !self.hand_over_sweeps() || self.worker.ask(job).is_err() {
            return self.publish_status(
                Event::Refused,
                number,
                format_args!("enroll `{}`: busy, try again", material.as_str()),
            );
        }
        Ok(())
    }

    fn adapt(&mut self, finger: u32, sweeps: usize) -> Result<(), ServeError> {
        let job = Job::Adapt { finger, sweeps };
        // The sweeps before the command count.
        if !self.hand_over_sweeps() || self.worker.ask(job).is_err() {
            return self.publish_status(
                Event::Refused,
                finger,
                format_args!("adapt: busy, try again"),
            );
        }
        Ok(())
    }
}
