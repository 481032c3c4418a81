//! Listening at an address, and the program that already uses it.

use std::fmt;
use std::fs;
use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener};
use std::path::Path;

use crate::ServeError;

/// Number of ports tried after one that is in use.
const TRIED: u16 = 100;
/// State of a listening socket in Linux's tables.
const LISTENS: &str = "0A";

/// Binds an address. Clients can connect before the server accepts.
///
/// # Errors
/// Returns [`ServeError::Taken`] with the program and a free port, or [`ServeError::Listen`] if the address is not
/// local or not permitted.
pub fn listen(address: SocketAddr) -> Result<TcpListener, ServeError> {
    TcpListener::bind(address).map_err(|source| match source.kind() {
        ErrorKind::AddrInUse => ServeError::Taken {
            address,
            holder: Holder::of(address),
            free: next_free(address),
        },
        _ => ServeError::Listen { address, source },
    })
}

/// Name and process id of the program that listens at an address, if known.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Holder(Option<(String, u32)>);

impl Holder {
    /// Looks the program up in Linux's `/proc`. It stays unknown on other systems, and for programs of other users.
    fn of(address: SocketAddr) -> Self {
        let tables = ["/proc/net/tcp", "/proc/net/tcp6"].map(fs::read_to_string);
        let inodes = tables.into_iter().flatten();
        let inodes: Vec<u64> = inodes
            .flat_map(|table| listening(&table, address))
            .collect();
        Self(inodes.into_iter().find_map(program_of))
    }
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Some((name, process)) => write!(f, "`{name}` (process {process})"),
            None => f.write_str("another program"),
        }
    }
}

/// Returns the inodes of listening sockets that block `address`.
///
/// - `table`: `/proc/net/tcp` or `/proc/net/tcp6`
fn listening(table: &str, address: SocketAddr) -> Vec<u64> {
    let sockets = table.lines().filter_map(|line| {
        let columns: Vec<&str> = line.split_whitespace().collect();
        let (ip, port) = columns.get(1)?.split_once(':')?;
        let (ip, port) = (ip_of(ip)?, u16::from_str_radix(port, 16).ok()?);
        let every = ip.is_unspecified() || address.ip().is_unspecified();
        let same = port == address.port() && (every || ip == address.ip());
        (same && columns.get(3) == Some(&LISTENS)).then(|| columns.get(9)?.parse().ok())?
    });
    sockets.collect()
}

/// Parses an address as the kernel prints it: words of 32 bits in the host's byte order.
fn ip_of(hex: &str) -> Option<IpAddr> {
    let mut bytes = Vec::with_capacity(16);
    for at in (0..hex.len()).step_by(8) {
        let word = u32::from_str_radix(hex.get(at..at + 8)?, 16).ok()?;
        bytes.extend(word.to_ne_bytes());
    }
    match bytes.len() {
        4 => <[u8; 4]>::try_from(bytes)
            .ok()
            .map(|ip| Ipv4Addr::from(ip).into()),
        _ => <[u8; 16]>::try_from(bytes)
            .ok()
            .map(|ip| Ipv6Addr::from(ip).to_canonical()),
    }
}

/// Returns name and id of the process that has a socket open.
fn program_of(inode: u64) -> Option<(String, u32)> {
    let socket = format!("socket:[{inode}]");
    let has = |process: &Path| {
        let files = fs::read_dir(process.join("fd")).into_iter().flatten();
        files
            .flatten()
            .any(|file| fs::read_link(file.path()).is_ok_and(|to| to == Path::new(&socket)))
    };
    fs::read_dir("/proc").ok()?.flatten().find_map(|entry| {
        let number = entry.file_name().to_str()?.parse().ok()?;
        let path = entry.path();
        let name = fs::read_to_string(path.join("comm")).ok()?;
        has(&path).then(|| (name.trim().to_string(), number))
    })
}

fn next_free(address: SocketAddr) -> Option<SocketAddr> {
    let last = address.port().saturating_add(TRIED);
    (address.port()..=last)
        .skip(1)
        .map(|port| SocketAddr::new(address.ip(), port))
        .find(|address| TcpListener::bind(address).is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_taken_port_names_its_holder_and_a_free_one() {
        let holder = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = holder.local_addr().unwrap();
        let error = listen(address).unwrap_err();
        assert!(error.is_usage());
        let text = error.to_string();
        let begin = format!("cannot listen at {address}: ");
        assert!(text.starts_with(&begin), "{text}");
        if cfg!(target_os = "linux") {
            let process = format!("(process {}) uses that port", std::process::id());
            assert!(text.contains(&process), "{text}");
        }
        let ServeError::Taken {
            free: Some(free), ..
        } = error
        else {
            panic!("{text}");
        };
        assert!(free.port() > address.port(), "{text}");
        assert!(text.ends_with(&format!("; {free} is free")), "{text}");
    }

    #[test]
    fn sockets_of_other_ports_and_addresses_and_connections_are_no_holders() {
        let table = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n\
            0: 0100007F:222E 00000000:0000 0A 00000000:00000000 00:00000000 00000000  0 0 11 1 0 100 0 0 10 0\n\
            1: 00000000:222E 00000000:0000 0A 00000000:00000000 00:00000000 00000000  0 0 12 1 0 100 0 0 10 0\n\
            2: 0100007F:222E 0100007F:9C40 01 00000000:00000000 00:00000000 00000000  0 0 13 1 0 100 0 0 10 0\n\
            3: 0100007F:222F 00000000:0000 0A 00000000:00000000 00:00000000 00000000  0 0 14 1 0 100 0 0 10 0\n";
        let found = |address: &str| listening(table, address.parse().unwrap());
        if cfg!(target_endian = "little") {
            assert_eq!(found("127.0.0.1:8750"), [11, 12]);
            assert_eq!(found("127.0.0.2:8750"), [12]);
            assert_eq!(found("127.0.0.1:8751"), [14]);
        }
        assert!(found("127.0.0.1:8752").is_empty());
        assert_eq!(Holder::default().to_string(), "another program");
    }
}
