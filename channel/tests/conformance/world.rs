//! A domain under test, with an end for putting and an end for getting.

use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use tactnet_channel::{Bus, ChannelConfig, Domain, Hub, HubThread, Table, Wait, remove_bus};

#[cfg(feature = "zenoh")]
use super::namespaces::Namespaces;

pub const SOON: Wait = Wait::Block {
    timeout: Duration::from_secs(20),
};

enum Kind {
    Process,
    Host,
    /// Hubs in network namespaces. Both buses are in this process and have different prefixes in `/dev/shm`.
    #[cfg(feature = "zenoh")]
    Distributed,
}

pub struct World {
    kind: Kind,
}

/// Two ends of the channels of one table. In the process and host domain they are the same bus.
pub struct Ends {
    pub near: Bus,
    pub far: Bus,
    /// Maximum time for changes to reach the other end.
    pub travel: Duration,
    hubs: Vec<HubThread>,
    #[cfg(feature = "zenoh")]
    hosts: Option<Namespaces>,
}

impl Drop for Ends {
    fn drop(&mut self) {
        self.hubs.clear();
        #[cfg(feature = "zenoh")]
        drop(self.hosts.take());
        for bus in [&self.near, &self.far] {
            remove_bus(bus.table()).unwrap();
        }
    }
}

impl Ends {
    /// Returns true if the ends are different hosts.
    pub fn is_distributed(&self) -> bool {
        self.travel > Duration::ZERO
    }

    /// Waits until both ends know each other's ports.
    pub fn settle(&self) {
        std::thread::sleep(self.travel);
    }
}

impl World {
    pub fn process() -> Self {
        Self {
            kind: Kind::Process,
        }
    }

    pub fn host() -> Self {
        Self { kind: Kind::Host }
    }

    /// Returns `None`, with a message, if network namespaces are not allowed.
    #[cfg(feature = "zenoh")]
    pub fn distributed() -> Option<Self> {
        super::namespaces::are_allowed().then_some(Self {
            kind: Kind::Distributed,
        })
    }

    /// Opens a bus with these channels.
    pub fn with(&self, channels: &[(&str, ChannelConfig)]) -> Ends {
        static BUSES: AtomicU32 = AtomicU32::new(0);
        let number = BUSES.fetch_add(1, Ordering::Relaxed);
        let name = format!("t{}-{number}x", std::process::id());
        let table = channels
            .iter()
            .fold(Table::new(&name), |table, (id, config)| {
                table.with(id, config.clone())
            });
        match self.kind {
            Kind::Process => {
                let bus = Bus::open(Domain::Process, &table).unwrap();
                Ends {
                    near: bus.clone(),
                    far: bus,
                    travel: Duration::ZERO,
                    hubs: Vec::new(),
                    #[cfg(feature = "zenoh")]
                    hosts: None,
                }
            }
            Kind::Host => {
                let hub = Hub::spawn(&table).unwrap();
                Ends {
                    near: Bus::open(Domain::Host, &table).unwrap(),
                    far: Bus::open(Domain::Host, &table).unwrap(),
                    travel: Duration::ZERO,
                    hubs: vec![hub],
                    #[cfg(feature = "zenoh")]
                    hosts: None,
                }
            }
            #[cfg(feature = "zenoh")]
            Kind::Distributed => {
                let (hosts, [near, far]) = Namespaces::with_hubs(&table);
                Ends {
                    near: Bus::open(Domain::Host, &near).unwrap(),
                    far: Bus::open(Domain::Host, &far).unwrap(),
                    travel: Duration::from_millis(3000),
                    hubs: Vec::new(),
                    hosts: Some(hosts),
                }
            }
        }
    }
}
