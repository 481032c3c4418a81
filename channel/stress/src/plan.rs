//! Which cells of the stress test are measured.

use serde::{Deserialize, Serialize};

use crate::Failure;

#[cfg_attr(feature = "zenoh", allow(dead_code))]
pub(super) const WITHOUT_ZENOH: &str = "this program was built without `zenoh`; in a checkout of the source, `cargo install --path . --features zenoh` builds one that has it";

/// Where master and clients are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StressDomain {
    /// Threads of one process.
    Process,
    /// Processes of one host.
    Host,
    /// The master on one host, the clients on two others; the three share this machine, connected by TCP over loopback.
    Distributed,
}

/// The carrier of the packets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Transport {
    /// This project's channels.
    Tactnet,
    /// Iceoryx2 as it comes: publish-subscribe and event services.
    Iceoryx2,
    /// Zenoh over TCP.
    Zenoh,
    /// Zenoh with shared memory.
    ZenohShm,
    /// A stream socket for each client.
    Unix,
    /// Two futex words in shared memory and no packet at all: what waking up costs.
    Futex,
}

impl Transport {
    /// Its name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tactnet => "tactnet",
            Self::Iceoryx2 => "iceoryx2",
            Self::Zenoh => "zenoh",
            Self::ZenohShm => "zenoh-shm",
            Self::Unix => "unix",
            Self::Futex => "futex",
        }
    }
}

/// Channels and sync groups of the test (thesis, section 2.4.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Configuration {
    /// One channel back for all clients; the master waits at its get-port.
    Standard,
    /// The master waits with a sync group that holds this one get-port.
    OneSync,
    /// Every client waits with a sync group of its own.
    NSync,
    /// A channel back for each client; the master waits for one after the other.
    NChannels,
    /// A channel back for each client; the master waits for any of them.
    SyncOnN,
}

impl Configuration {
    /// All, in the thesis's order.
    pub const ALL: [Self; 5] = [
        Self::Standard,
        Self::OneSync,
        Self::NSync,
        Self::NChannels,
        Self::SyncOnN,
    ];

    /// Its name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Standard => "standard",
            Self::OneSync => "1 sync",
            Self::NSync => "N sync",
            Self::NChannels => "N channels",
            Self::SyncOnN => "sync on N",
        }
    }
}

/// One measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cell {
    /// The carrier of the packets.
    pub transport: Transport,
    /// Where master and clients are.
    pub domain: StressDomain,
    /// Channels and sync groups; [`Configuration::Standard`] for other transports.
    pub configuration: Configuration,
    /// Packet size, bytes, at least 4.
    pub size: usize,
    /// Number of clients.
    pub clients: usize,
    /// Look again and again instead of sleeping.
    pub spin: bool,
}

/// Everything to measure.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Where.
    pub domains: Vec<StressDomain>,
    /// Packet sizes, bytes.
    pub sizes: Vec<usize>,
    /// Numbers of clients.
    pub clients: Vec<usize>,
    /// Configurations of this project's channels.
    pub configurations: Vec<Configuration>,
    /// Other transports.
    pub against: Vec<Transport>,
    /// Look again and again instead of sleeping.
    pub spin: bool,
}

impl Plan {
    /// All cells, those to be compared side by side.
    ///
    /// # Errors
    /// A size below 4 bytes, no clients, a transport that this build lacks.
    pub fn cells(&self) -> Result<Vec<Cell>, Failure> {
        if let Some(size) = self.sizes.iter().find(|size| **size < 4) {
            return Err(format!("sizes: expected at least 4 bytes, found {size}").into());
        }
        if let Some(clients) = self.clients.iter().find(|c| !(1..=1000).contains(*c)) {
            return Err(format!("clients: expected 1 to 1000, found {clients}").into());
        }
        let zenoh = |t: &Transport| matches!(t, Transport::Zenoh | Transport::ZenohShm);
        if !cfg!(feature = "zenoh")
            && (self.against.iter().any(zenoh) || self.domains.contains(&StressDomain::Distributed))
        {
            return Err(WITHOUT_ZENOH.into());
        }
        let mut cells = Vec::new();
        for &domain in &self.domains {
            for &size in &self.sizes {
                for &clients in &self.clients {
                    let cell = |transport, configuration| Cell {
                        transport,
                        domain,
                        configuration,
                        size,
                        clients,
                        spin: self.spin,
                    };
                    let own = self.configurations.iter();
                    cells.extend(own.map(|c| cell(Transport::Tactnet, *c)));
                    let others = self.against.iter().filter(|t| runs(**t, domain, clients));
                    cells.extend(others.map(|t| cell(*t, Configuration::Standard)));
                }
            }
        }
        Ok(cells)
    }
}

/// Returns true if a transport can be measured in a domain.
fn runs(transport: Transport, domain: StressDomain, clients: usize) -> bool {
    match transport {
        Transport::Tactnet => true,
        Transport::Futex => domain == StressDomain::Host && clients == 1,
        Transport::Iceoryx2 | Transport::Unix | Transport::ZenohShm => domain == StressDomain::Host,
        Transport::Zenoh => domain != StressDomain::Process,
    }
}
