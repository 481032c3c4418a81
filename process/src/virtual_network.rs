//! Several hosts on one machine: network namespaces of Linux, joined by a bridge.

use std::ffi::OsStr;
use std::fs::File;
use std::io;
use std::os::fd::AsRawFd;
use std::process::Command;

use crate::{ProcessError, ReadyProcess, run_to_end};

/// Brings up loopback, then keeps the namespace.
const ANCHOR: &str = "ip link set lo up && echo ready && exec sleep infinity";

/// Error of network namespaces.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// The namespaces cannot be created.
    #[error(
        "network namespaces need root and the programs `ip`, `unshare` and `nsenter`; one of these {0}"
    )]
    Create(#[from] ProcessError),
    /// A namespace cannot be entered.
    #[error("cannot enter a network namespace: {0}")]
    Enter(#[source] io::Error),
}

/// Hosts in separate network namespaces. They share memory and files of this machine.
///
/// ```text
///  host 0 ── cable ─┐
///  host 1 ── cable ─┼─ bridge, in another namespace
///  host 2 ── cable ─┘
/// ```
///
/// The namespaces have no names. The system removes each when its last process has ended. Their own processes end when this value is
/// dropped, and when the thread that created it ends, also if it is killed.
#[derive(Debug)]
pub struct VirtualNetwork {
    hosts: Vec<Namespace>,
    _bridge: Namespace,
}

impl VirtualNetwork {
    /// Creates hosts, at most 250, and the bridge between them.
    ///
    /// # Errors
    /// No permission, or a program is missing.
    pub fn new(hosts: usize) -> Result<Self, NetworkError> {
        let bridge = Namespace::new()?;
        bridge.ip("link add name bridge type bridge")?;
        bridge.ip("link set bridge up")?;
        let mut joined = Vec::new();
        for number in 0..hosts {
            let host = Namespace::new()?;
            bridge.ip(&format!(
                "link add name port{number} type veth peer name cable netns {}",
                host.0.id()
            ))?;
            bridge.ip(&format!("link set port{number} master bridge up"))?;
            host.ip(&format!("addr add {}/24 dev cable", Self::address(number)))?;
            host.ip("link set cable up")?;
            joined.push(host);
        }
        Ok(Self {
            hosts: joined,
            _bridge: bridge,
        })
    }

    /// Returns the IPv4 address of a host. The address of its network card `cable` is the same in every virtual network.
    pub fn address(host: usize) -> String {
        format!("10.78.0.{}", host + 1)
    }

    /// Returns a command that runs a program on a host.
    pub fn command(&self, host: usize, program: impl AsRef<OsStr>) -> Command {
        self.hosts[host].command(program)
    }

    /// Moves this thread to a host, with all threads and processes that it starts later.
    ///
    /// # Errors
    /// No permission.
    pub fn enter(&self, host: usize) -> Result<(), NetworkError> {
        let namespace = format!("/proc/{}/ns/net", self.hosts[host].0.id());
        let namespace = File::open(namespace).map_err(NetworkError::Enter)?;
        // SAFETY: a system call without memory, and the file is open.
        if unsafe { libc::setns(namespace.as_raw_fd(), libc::CLONE_NEWNET) } != 0 {
            return Err(NetworkError::Enter(io::Error::last_os_error()));
        }
        Ok(())
    }
}

/// Network namespace, kept by a process that sleeps.
#[derive(Debug)]
struct Namespace(ReadyProcess);

impl Namespace {
    fn new() -> Result<Self, NetworkError> {
        let mut unshare = Command::new("unshare");
        unshare.args(["--net", "sh", "-c", ANCHOR]);
        let mut anchor = ReadyProcess::start(&mut unshare)?;
        anchor.wait_until_ready()?;
        Ok(Self(anchor))
    }

    fn command(&self, program: impl AsRef<OsStr>) -> Command {
        let mut command = Command::new("nsenter");
        command.arg(format!("--target={}", self.0.id()));
        command.args(["--net", "--"]).arg(program);
        command
    }

    fn ip(&self, arguments: &str) -> Result<(), NetworkError> {
        run_to_end(self.command("ip").args(arguments.split(' ')))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::{TcpListener, TcpStream};
    use std::path::Path;

    use super::*;

    /// Returns the result of `work` on a thread of a host.
    fn on_host<T: Send>(
        network: &VirtualNetwork,
        host: usize,
        work: impl FnOnce() -> T + Send,
    ) -> T {
        std::thread::scope(|scope| {
            let run = || {
                network.enter(host).unwrap();
                work()
            };
            scope.spawn(run).join().unwrap()
        })
    }

    #[test]
    fn hosts_reach_each_other_by_their_addresses_only_and_vanish() {
        let network = match VirtualNetwork::new(3) {
            Ok(network) => network,
            Err(error) => {
                assert!(error.to_string().contains("need root"), "{error}");
                return eprintln!("SKIPPED: {error}");
            }
        };
        let address = (VirtualNetwork::address(0), 4000);
        let listener = on_host(&network, 0, || TcpListener::bind(&address).unwrap());
        // This thread is on none of the hosts, and the second host does not listen.
        assert!(TcpListener::bind(&address).is_err());
        let wrong = (VirtualNetwork::address(1), 4000);
        assert!(on_host(&network, 2, || TcpStream::connect(wrong)).is_err());
        for host in [1, 2] {
            on_host(&network, host, || {
                let mut stream = TcpStream::connect(&address).unwrap();
                stream.write_all(&[host as u8]).unwrap();
            });
            let mut byte = [0];
            let (mut stream, from) = listener.accept().unwrap();
            stream.read_exact(&mut byte).unwrap();
            assert_eq!(from.ip().to_string(), VirtualNetwork::address(host));
            assert_eq!(byte, [host as u8]);
        }
        let cables = run_to_end(network.command(1, "ip").args(["-br", "addr"])).unwrap();
        assert!(cables.contains("10.78.0.2/24"), "{cables}");

        let anchors: Vec<u32> = network.hosts.iter().map(|host| host.0.id()).collect();
        drop(network);
        for anchor in anchors {
            assert!(!Path::new(&format!("/proc/{anchor}")).exists());
        }
    }
}
