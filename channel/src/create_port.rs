//! Creation of ports while dead clients may hold the last places.

use std::time::{Duration, Instant};

use iceoryx2::prelude::{CallbackProgression, NodeState, PortFactory};
use iceoryx2::service::Service;

use crate::service::{CLEARING_UP, Channel};

/// Time that the hub needs to clean up after one dead client on an idle machine. The client's node is no longer listed
/// during that time.
const CLEARING_UP_ONE: Duration = Duration::from_millis(100);
/// Retry interval.
const AGAIN: Duration = Duration::from_millis(10);

/// Direction of a port.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Side {
    /// Puts packets.
    Put,
    /// Gets packets.
    Get,
}

/// Creates a port. If all places are taken, waits while dead clients hold some of them.
///
/// Only the hub cleans up: if a client did and were killed meanwhile, its place would be lost for ever (iceoryx2 0.10
/// skips a port whose tag is gone and forgets its node).
pub(crate) fn create_port<S: Service, P, E>(
    channel: &Channel<S>,
    side: Side,
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
        let cleared = seen.elapsed() > CLEARING_UP_ONE && all_places_are_held(channel, side);
        if cleared || begun.elapsed() > CLEARING_UP {
            return created;
        }
        std::thread::sleep(AGAIN);
    }
}

/// Returns true if running processes hold all places.
///
/// While the hub cleans up after a dead client, the list shows its port, but not its node.
fn all_places_are_held<S: Service>(channel: &Channel<S>, side: Side) -> bool {
    let mut held = 0;
    let mut count = |pid: Option<i32>| {
        held += usize::from(pid.is_none_or(runs));
        CallbackProgression::Continue
    };
    let (places, now) = (channel.static_config(), channel.dynamic_config());
    match side {
        Side::Put => {
            now.list_publishers(|port| count(port.node_id.pid::<S>().ok().map(|pid| pid.value())));
            held >= places.max_publishers()
        }
        Side::Get => {
            now.list_subscribers(|port| count(port.node_id.pid::<S>().ok().map(|pid| pid.value())));
            held >= places.max_subscribers()
        }
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
