//! Creation of ports while dead clients may hold the last places.

use std::time::{Duration, Instant};

use iceoryx2::port::port_name::PortName;
use iceoryx2::prelude::{CallbackProgression, NodeState, PortFactory};
use iceoryx2::service::Service;

use crate::service::{CLEARING_UP, Channel};

/// Time that the hub needs to clean up after one dead client on an idle machine. The client's node is no longer listed
/// during that time.
const CLEARING_UP_ONE: Duration = Duration::from_millis(100);
/// Retry interval.
const AGAIN: Duration = Duration::from_millis(10);

/// Places for ports of a channel.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Places {
    /// Put-ports of clients, at most this many.
    Put(usize),
    /// Get-ports.
    Get,
    /// Put-ports of the hub, which have separate places.
    Hub,
}

/// Returns the name of the hub's put-ports.
pub(crate) fn hub_name() -> PortName {
    PortName::new("hub").unwrap_or_else(|error| panic!("a valid name: {error:?}"))
}

/// Returns the number of put-ports of clients.
pub(crate) fn client_put_ports<S: Service>(channel: &Channel<S>) -> usize {
    let mut ports = 0;
    channel.dynamic_config().list_publishers(|port| {
        ports += usize::from(port.publisher_name != hub_name());
        CallbackProgression::Continue
    });
    ports
}

/// Creates a port. If all places are taken, waits while dead clients hold some of them.
///
/// Only the hub cleans up: if a client did and were killed meanwhile, its place would be lost for ever (iceoryx2 0.10
/// skips a port whose tag is gone and forgets its node).
pub(crate) fn create_port<S: Service, P, E>(
    channel: &Channel<S>,
    places: Places,
    is_full: impl Fn(&E) -> bool,
    mut create: impl FnMut() -> Result<P, E>,
) -> Result<P, E> {
    let begun = Instant::now();
    let mut seen = begun;
    loop {
        let created = create();
        if !created.as_ref().is_err_and(&is_full) {
            return created;
        }
        // A node whose state cannot be read counts as alive.
        let _ = channel.nodes(|node| {
            if matches!(node, NodeState::Dead(_)) {
                seen = Instant::now();
            }
            CallbackProgression::Continue
        });
        let cleared = seen.elapsed() > CLEARING_UP_ONE && all_places_are_held(channel, places);
        if cleared || begun.elapsed() > CLEARING_UP {
            return created;
        }
        std::thread::sleep(AGAIN);
    }
}

/// Returns true if running processes hold all places.
///
/// While the hub cleans up after a dead client, the list shows its port, but not its node.
fn all_places_are_held<S: Service>(channel: &Channel<S>, places: Places) -> bool {
    let mut held = 0;
    let mut count = |pid: Option<i32>| {
        held += usize::from(pid.is_none_or(runs));
        CallbackProgression::Continue
    };
    let (all, now) = (channel.static_config(), channel.dynamic_config());
    match places {
        Places::Put(most) => {
            now.list_publishers(|port| match port.publisher_name == hub_name() {
                true => CallbackProgression::Continue,
                false => count(port.node_id.pid::<S>().ok().map(|pid| pid.value())),
            });
            held >= most
        }
        Places::Get => {
            now.list_subscribers(|port| count(port.node_id.pid::<S>().ok().map(|pid| pid.value())));
            held >= all.max_subscribers()
        }
        Places::Hub => true,
    }
}

/// Returns true if a process with this id exists on this host, of any user.
fn runs(pid: i32) -> bool {
    // SAFETY: signal 0 checks for existence only.
    let asked = unsafe { libc::kill(pid, 0) };
    asked == 0 || std::io::Error::last_os_error().raw_os_error() != Some(libc::ESRCH)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_runs_until_somebody_has_seen_its_end() {
        assert!(runs(std::process::id().cast_signed()));
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let pid = child.id().cast_signed();
        child.wait().unwrap();
        assert!(!runs(pid));
    }
}
