//! Retries connections that failed for lack of descriptors or shared memory, and detects connected skins that send no frames.

use tactnet_channel::{GetSide, Packet, PutPort, Start};
use tactnet_skin::packets::Event;

use super::Service;
use crate::ServeError;

/// Interval between two retries, in ns.
const RETRY_INTERVAL_NS: u64 = 1_000_000_000;
/// Silence after which a skin that has sent frames counts as silent, in ns.
const SILENCE_NS: u64 = 10_000_000_000;

/// State of the connections at the last check.
#[derive(Debug, Default)]
pub(super) struct Connections {
    checked_ns: u64,
    failing: bool,
    /// True if a connected skin has fallen silent.
    pub(super) skin_silent: bool,
}

impl Service {
    /// Checks all connections once a second and retries the failed ones.
    pub(super) fn keep_connections(&mut self, now_ns: u64) -> Result<(), ServeError> {
        if now_ns.saturating_sub(self.connections.checked_ns) < RETRY_INTERVAL_NS {
            return Ok(());
        }
        self.connections.checked_ns = now_ns;
        self.connections.skin_silent = self.is_a_skin_silent(now_ns)?;
        let mut failed = self.reopen_getters()?;
        failed |= self.look_for_getters(&self.beliefs)?;
        failed |= self.look_for_getters(&self.status)?;
        failed |= self.look_for_getters(&self.model)?;
        let before = std::mem::replace(&mut self.connections.failing, failed);
        match (before, failed) {
            (false, true) => self.report(
                Event::Unreachable,
                "cannot connect to a component: out of descriptors or shared memory; retrying every second",
            ),
            (true, false) => self.report(Event::Alive, "connected to all components again"),
            _ => Ok(()),
        }
    }

    fn is_a_skin_silent(&self, now_ns: u64) -> Result<bool, ServeError> {
        for (finger, skin) in self.fingers.iter().zip(&self.skins) {
            let silent = finger.last_frame_ns > 0
                && now_ns.saturating_sub(finger.last_frame_ns) > SILENCE_NS
                && !self.bus.putting_processes(skin.id())?.is_empty();
            if silent {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn report(&mut self, event: Event, text: &str) -> Result<(), ServeError> {
        self.messages.push(text.into());
        self.publish_status(event, 0, format_args!("{text}"))
    }

    /// Reopens get-ports that could not connect to their senders. Returns true if there were any.
    fn reopen_getters(&mut self) -> Result<bool, ServeError> {
        let mut failed = false;
        for (skin, id) in self.skins.iter_mut().zip(&self.config.fingers) {
            if skin.failed_connections() > 0 {
                failed = true;
                // If reopening fails too, the old port keeps its connections.
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

    /// Retries the failed connections of a put-port. Returns true if there were any.
    fn look_for_getters<T: Packet>(&self, port: &PutPort<T>) -> Result<bool, ServeError> {
        if port.failed_connections() == 0 {
            return Ok(false);
        }
        // If the retry fails, the next one follows in a second.
        let _ = port.retry_connections(&self.bus);
        Ok(true)
    }
}
