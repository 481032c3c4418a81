//! A domain to test in: where packets are put, and where they are got.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

#[cfg(feature = "zenoh")]
use tactnet_channel::Network;
use tactnet_channel::{Bus, ChannelConfig, Domain, Hub, Table, Wait};

pub const SOON: Wait = Wait::Block {
    timeout: Duration::from_secs(20),
};

enum Kind {
    Process,
    Host,
    #[cfg(feature = "zenoh")]
    Distributed,
}

pub struct World {
    kind: Kind,
}

/// Two ends of the channels of one table; in the process and host domain they are the same bus.
pub struct Ends {
    pub near: Bus,
    pub far: Bus,
    /// Time for news to travel from one end to the other.
    pub travel: Duration,
    hubs: Vec<RunningHub>,
}

impl Drop for Ends {
    fn drop(&mut self) {
        self.hubs.clear();
        let own = &self.near.table().bus;
        for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
            if entry
                .file_name()
                .to_string_lossy()
                .starts_with(own.as_str())
            {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

impl Ends {
    /// Waits until both ends know of each other's ports.
    pub fn settle(&self) {
        std::thread::sleep(self.travel);
    }
}

struct RunningHub {
    stop: Sender<()>,
    thread: Option<JoinHandle<()>>,
}

impl RunningHub {
    fn start(table: Table) -> Self {
        let (stop, stopped) = channel::<()>();
        let (up, is_up) = channel();
        let thread = std::thread::spawn(move || {
            let mut hub = Hub::start(&table).unwrap();
            up.send(()).unwrap();
            while stopped.recv_timeout(Duration::from_millis(20)).is_err() {
                hub.tick().unwrap();
            }
        });
        is_up.recv().unwrap();
        Self {
            stop,
            thread: Some(thread),
        }
    }
}

impl Drop for RunningHub {
    fn drop(&mut self) {
        let _ = self.stop.send(());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
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

    #[cfg(feature = "zenoh")]
    pub fn distributed() -> Self {
        Self {
            kind: Kind::Distributed,
        }
    }

    /// A bus with these channels.
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
                }
            }
            Kind::Host => {
                let hub = RunningHub::start(table.clone());
                Ends {
                    near: Bus::open(Domain::Host, &table).unwrap(),
                    far: Bus::open(Domain::Host, &table).unwrap(),
                    travel: Duration::ZERO,
                    hubs: vec![hub],
                }
            }
            #[cfg(feature = "zenoh")]
            Kind::Distributed => {
                let endpoint = format!("tcp/127.0.0.1:{}", free_port());
                let side = |host: &str, network: Network| {
                    let mut table = Table {
                        network: Network {
                            host: host.into(),
                            ..network
                        },
                        ..table.clone()
                    };
                    for channel in table.channels.values_mut() {
                        channel.distributed = true;
                        channel.congestion = tactnet_channel::Congestion::Block;
                    }
                    let hub = RunningHub::start(table.clone());
                    (Bus::open(Domain::Host, &table).unwrap(), hub)
                };
                let listen = Network {
                    listen: vec![endpoint.clone()],
                    ..Network::default()
                };
                let connect = Network {
                    connect: vec![endpoint],
                    ..Network::default()
                };
                let (near, first) = side("a", listen);
                let (far, second) = side("b", connect);
                Ends {
                    near,
                    far,
                    travel: Duration::from_millis(3000),
                    hubs: vec![first, second],
                }
            }
        }
    }
}

#[cfg(feature = "zenoh")]
fn free_port() -> u16 {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().port()
}
