//! Values of the flags of `tactnet channel stress`.

use clap::ValueEnum;
use tactnet_channel_stress::{Configuration, StressDomain, Transport};

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum DomainChoice {
    /// Threads of one process
    Process,
    /// Processes of this host
    Host,
    /// Three hosts on this machine, connected over loopback (needs a build with `--features zenoh`)
    Distributed,
    /// Three hosts on this machine in network namespaces, connected by a bridge (needs root, `ip`, and a build with `--features zenoh`)
    Namespaces,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum ConfigurationChoice {
    /// One channel for packets, one for answers
    Standard,
    /// The master waits with a sync group
    #[value(name = "1-sync")]
    OneSync,
    /// Every client waits with a sync group
    NSync,
    /// One answer channel per client; the master waits for one after the other
    NChannels,
    /// One answer channel per client; the master waits for all with a sync group
    SyncOnN,
    /// All configurations
    All,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum TransportChoice {
    /// Plain iceoryx2
    Iceoryx2,
    /// Plain zenoh, over TCP and with shared memory (needs a build with `--features zenoh`)
    Zenoh,
}

impl DomainChoice {
    pub(super) fn domain(self) -> StressDomain {
        match self {
            Self::Process => StressDomain::Process,
            Self::Host => StressDomain::Host,
            Self::Distributed => StressDomain::Distributed,
            Self::Namespaces => StressDomain::Namespaces,
        }
    }
}

impl TransportChoice {
    pub(super) fn transports(self) -> &'static [Transport] {
        match self {
            Self::Iceoryx2 => &[Transport::Iceoryx2],
            Self::Zenoh => &[Transport::Zenoh, Transport::ZenohShm],
        }
    }
}

/// Returns the configurations of `choices`; `all` replaces those before it.
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
