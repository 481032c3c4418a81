//! Words of the flags of `tactnet channel stress`.

use clap::ValueEnum;
use tactnet_channel_stress::{Configuration, StressDomain, Transport};

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum DomainChoice {
    /// Threads of one process
    Process,
    /// Processes of this host
    Host,
    /// Three hosts, which share this machine and speak over loopback (needs a build with `--features zenoh`)
    Distributed,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum ConfigurationChoice {
    /// One channel there, one back
    Standard,
    /// The master waits with a sync group
    #[value(name = "1-sync")]
    OneSync,
    /// Every client waits with a sync group
    NSync,
    /// A channel back for each client, waited for one after the other
    NChannels,
    /// A channel back for each client, waited for together
    SyncOnN,
    /// All of them
    All,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum TransportChoice {
    /// Iceoryx2 as it comes
    Iceoryx2,
    /// Zenoh as it comes, over TCP and with shared memory (needs a build with `--features zenoh`)
    Zenoh,
    /// A Unix socket for each client
    Unix,
    /// A bare wake-up, no packet
    Futex,
}

impl DomainChoice {
    pub(super) fn domain(self) -> StressDomain {
        match self {
            Self::Process => StressDomain::Process,
            Self::Host => StressDomain::Host,
            Self::Distributed => StressDomain::Distributed,
        }
    }
}

impl TransportChoice {
    pub(super) fn transports(self) -> &'static [Transport] {
        match self {
            Self::Iceoryx2 => &[Transport::Iceoryx2],
            Self::Zenoh => &[Transport::Zenoh, Transport::ZenohShm],
            Self::Unix => &[Transport::Unix],
            Self::Futex => &[Transport::Futex],
        }
    }
}

/// The configurations of `choices`; `all` replaces those before it.
pub(super) fn configurations_of(choices: &[ConfigurationChoice]) -> Vec<Configuration> {
    let mut configurations = Vec::new();
    for choice in choices {
        match choice {
            ConfigurationChoice::Standard => configurations.push(Configuration::Standard),
            ConfigurationChoice::OneSync => configurations.push(Configuration::OneSync),
            ConfigurationChoice::NSync => configurations.push(Configuration::NSync),
            ConfigurationChoice::NChannels => configurations.push(Configuration::NChannels),
            ConfigurationChoice::SyncOnN => configurations.push(Configuration::SyncOnN),
            ConfigurationChoice::All => configurations = Configuration::ALL.to_vec(),
        }
    }
    configurations
}
