//! Connections that failed since descriptors or shared memory were short: said once, and tried again until they hold. And skins that are
//! connected and yet silent.

use tactnet_channel::{GetSide, Packet, PutPort, Start};
use tactnet_skin::packets::Event;

use super::Service;
use crate::ServeError;

/// Time between two tries.
const TRY_EVERY_NS: u64 = 1_000_000_000;
/// Silence of a skin that has put frames before.
const SILENCE_NS: u64 = 10_000_000_000;

/// When connections were last looked at, and whether the last ones failed.
#[derive(Debug, Default)]
pub(super) struct Connections {
    looked_ns: u64,
    failing: bool,
    /// True if a skin that is connected has fallen silent.
    pub(super) blind: bool,
}

impl Service {
    /// Looks once a second whether all components could be reached, and tries again where not.
    pub(super) fn keep_connections(&mut self, now_ns: u64) -> Result<(), ServeError> {
        if now_ns.saturating_sub(self.connections.looked_ns) < TRY_EVERY_NS {
            return Ok(());
        }
        self.connections.looked_ns = now_ns;
        self.connections.blind = self.is_a_skin_silent(now_ns)?;
        let mut failed = self.reopen_getters()?;
        failed |= self.look_for_getters(&self.beliefs)?;
        failed |= self.look_for_getters(&self.status)?;
        failed |= self.look_for_getters(&self.model)?;
        let before = std::mem::replace(&mut self.connections.failing, failed);
        match (before, failed) {
            (false, true) => self.say(
                Event::Unreachable,
                "a component cannot be reached: descriptors or shared memory are short; trying again every second",
            ),
            (true, false) => self.say(Event::Alive, "every component is reached again"),
            _ => Ok(()),
        }
    }

    fn is_a_skin_silent(&self, now_ns: u64) -> Result<bool, ServeError> {
        for (finger, skin) in self.fingers.iter().zip(&self.skins) {
            let silent = finger.framed_ns > 0
                && now_ns.saturating_sub(finger.framed_ns) > SILENCE_NS
                && !self.bus.putting_processes(skin.id())?.is_empty();
            if silent {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn say(&mut self, event: Event, text: &str) -> Result<(), ServeError> {
        self.news.push(text.into());
        self.publish_status(event, 0, format_args!("{text}"))
    }

    /// Opens get-ports anew whose putters could not be reached. Returns true if there were any.
    fn reopen_getters(&mut self) -> Result<bool, ServeError> {
        let mut failed = false;
        for (skin, id) in self.skins.iter_mut().zip(&self.config.fingers) {
            if skin.failed_connections() > 0 {
                failed = true;
                // Where that is not to be had either, the old one has all that it had.
                if let Ok(anew) = self.bus.get_port(id.as_str(), Start::Now) {
                    *skin = anew;
                }
            }
        }
        if self.commands.failed_connections() > 0 {
            failed = true;
            if let Ok(anew) = self.bus.get_port(self.config.command.as_str(), Start::Now) {
                self.commands = anew;
            }
        }
        if failed {
            let mut sides: Vec<&dyn GetSide> =
                self.skins.iter().map(|port| port as &dyn GetSide).collect();
            sides.push(&self.commands);
            self.group = self.bus.sync_group(&sides)?;
        }
        Ok(failed)
    }

    /// Lets a put-port look for its getters again. Returns true if it had missed some.
    fn look_for_getters<T: Packet>(&self, port: &PutPort<T>) -> Result<bool, ServeError> {
        if port.failed_connections() == 0 {
            return Ok(false);
        }
        // Where that is not to be had yet, the next try is in a second.
        let _ = port.retry_connections(&self.bus);
        Ok(true)
    }
}
