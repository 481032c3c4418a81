//! systemd's notification protocol (`sd_notify`): a datagram to the socket named in the environment.

use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::{Duration, Instant};

/// Connection to the service manager, if there is one.
#[derive(Debug)]
pub struct ServiceManager {
    socket: Option<(UnixDatagram, SocketAddr)>,
    /// Time between keep-alive messages: half of the manager's timeout.
    watchdog: Option<Duration>,
    last: Instant,
}

impl ServiceManager {
    /// Reads `NOTIFY_SOCKET` and `WATCHDOG_USEC`.
    pub fn from_environment() -> Self {
        let socket = std::env::var("NOTIFY_SOCKET").ok().and_then(|name| {
            let address = match name.strip_prefix('@') {
                Some(name) => SocketAddr::from_abstract_name(name),
                None => SocketAddr::from_pathname(&name),
            };
            let socket = UnixDatagram::unbound().ok()?;
            // A manager that does not read must not block the service.
            socket.set_nonblocking(true).ok()?;
            Some((socket, address.ok()?))
        });
        let watchdog = std::env::var("WATCHDOG_USEC")
            .ok()
            .and_then(|time| time.parse().ok())
            .map(|time: u64| Duration::from_micros(time / 2));
        Self {
            socket,
            watchdog,
            last: Instant::now(),
        }
    }

    /// Sends a state, for example `READY=1`.
    pub fn notify(&self, state: &str) {
        if let Some((socket, address)) = &self.socket {
            let _ = socket.send_to_addr(state.as_bytes(), address);
        }
    }

    /// Sends a keep-alive message when one is due.
    pub fn keep_alive(&mut self) {
        if self
            .watchdog
            .is_some_and(|every| self.last.elapsed() >= every)
        {
            self.last = Instant::now();
            self.notify("WATCHDOG=1");
        }
    }
}
