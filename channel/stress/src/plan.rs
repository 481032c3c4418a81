//! Plan of the stress test: the cells to measure.

use serde::{Deserialize, Serialize};
use tactnet_process::VirtualNetwork;

/// Error in the plan of a stress test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// Packets that cannot hold the number of the round.
    #[error("sizes: expected at least 4 bytes, found {found}")]
    Size {
        /// Requested size, in bytes.
        found: usize,
    },
    /// Number of clients out of range.
    #[error("clients: expected 1 to 1000, found {found}")]
    Clients {
        /// Requested number.
        found: usize,
    },
    /// The plan needs zenoh, and this build lacks the feature.
    #[error("this program was built without the feature `zenoh`")]
    WithoutZenoh,
}

/// Number of hosts of the distributed domains: the master's and two for the clients.
pub(crate) const HOSTS: usize = 3;

/// Location of master and clients.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StressDomain {
    /// Threads of one process.
    Process,
    /// Processes of one host.
    Host,
    /// A master on one host and clients on two others; all three share this machine and use TCP over loopback.
    Distributed,
    /// Like `Distributed`, but each host is a network namespace; they use TCP over a bridge.
    Namespaces,
}

impl StressDomain {
    /// All domains, in the order of the thesis.
    pub const ALL: [Self; 4] = [
        Self::Process,
        Self::Host,
        Self::Distributed,
        Self::Namespaces,
    ];

    /// Returns the name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Process => "process",
            Self::Host => "host",
            Self::Distributed => "distributed",
            Self::Namespaces => "namespaces",
        }
    }

    /// Returns the number of hosts with a hub; a process needs none.
    pub(crate) fn hubs(self) -> usize {
        match self {
            Self::Process => 0,
            Self::Host => 1,
            Self::Distributed | Self::Namespaces => HOSTS,
        }
    }

    /// Returns true if the clients are on other hosts than the master.
    pub(crate) fn is_distributed(self) -> bool {
        self.hubs() > 1
    }

    /// Returns the address of a host.
    pub(crate) fn address(self, host: usize) -> String {
        match self {
            Self::Namespaces => VirtualNetwork::address(host),
            Self::Process | Self::Host | Self::Distributed => "127.0.0.1".into(),
        }
    }
}

/// Transport of the packets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Transport {
    /// This project's channels.
    Tactnet,
    /// Plain iceoryx2: publish-subscribe and event services.
    Iceoryx2,
    /// Zenoh over TCP.
    Zenoh,
    /// Zenoh with shared memory.
    ZenohShm,
}

impl Transport {
    /// Returns the name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tactnet => "tactnet",
            Self::Iceoryx2 => "iceoryx2",
            Self::Zenoh => "zenoh",
            Self::ZenohShm => "zenoh-shm",
        }
    }
}

/// Channels and sync groups of the test (thesis, section 2.4.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Configuration {
    /// One channel for the answers of all clients; the master waits at its get-port.
    Standard,
    /// Like `Standard`, but the master waits with a sync group of this get-port.
    OneSync,
    /// Like `Standard`, but every client waits with a sync group.
    NSync,
    /// One channel per client for its answers; the master waits for one after the other.
    NChannels,
    /// One channel per client for its answers; the master waits for all at once with a sync group.
    SyncOnN,
}

impl Configuration {
    /// All configurations, in the order of the thesis.
    pub const ALL: [Self; 5] = [
        Self::Standard,
        Self::OneSync,
        Self::NSync,
        Self::NChannels,
        Self::SyncOnN,
    ];

    /// Returns the name in results.
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
    /// Transport of the packets.
    pub transport: Transport,
    /// Location of master and clients.
    pub domain: StressDomain,
    /// Channels and sync groups; always [`Configuration::Standard`] for other transports.
    pub configuration: Configuration,
    /// Packet size, in bytes; at least 4.
    pub size: usize,
    /// Number of clients.
    pub clients: usize,
    /// True to poll instead of sleeping.
    pub spin: bool,
}

impl Cell {
    /// Returns the host of a client: the second or third, if there are several.
    pub(crate) fn host_of(&self, client: usize) -> usize {
        if self.domain.is_distributed() {
            1 + client % (HOSTS - 1)
        } else {
            0
        }
    }
}

/// Lists of everything to measure.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Locations of master and clients.
    pub domains: Vec<StressDomain>,
    /// Packet sizes, in bytes.
    pub sizes: Vec<usize>,
    /// Numbers of clients.
    pub clients: Vec<usize>,
    /// Configurations of this project's channels.
    pub configurations: Vec<Configuration>,
    /// Transports to compare with.
    pub against: Vec<Transport>,
    /// True to poll instead of sleeping.
    pub spin: bool,
}

impl Plan {
    /// Returns all cells; those to be compared follow each other.
    ///
    /// # Errors
    /// A value is out of range, or the build lacks a transport.
    pub fn cells(&self) -> Result<Vec<Cell>, PlanError> {
        if let Some(&found) = self.sizes.iter().find(|size| **size < 4) {
            return Err(PlanError::Size { found });
        }
        if let Some(&found) = self.clients.iter().find(|c| !(1..=1000).contains(*c)) {
            return Err(PlanError::Clients { found });
        }
        let zenoh = |t: &Transport| matches!(t, Transport::Zenoh | Transport::ZenohShm);
        let distributed = self.domains.iter().any(|domain| domain.is_distributed());
        if !cfg!(feature = "zenoh") && (self.against.iter().any(zenoh) || distributed) {
            return Err(PlanError::WithoutZenoh);
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
                    let others = self.against.iter().filter(|t| runs(**t, domain));
                    cells.extend(others.map(|t| cell(*t, Configuration::Standard)));
                }
            }
        }
        Ok(cells)
    }
}

/// Returns true if a transport can be measured in a domain.
fn runs(transport: Transport, domain: StressDomain) -> bool {
    match transport {
        Transport::Tactnet => true,
        Transport::Iceoryx2 | Transport::ZenohShm => domain == StressDomain::Host,
        Transport::Zenoh => domain != StressDomain::Process,
    }
}
