//! The stress test on plain iceoryx2: in each direction a publish-subscribe service for packets and an event service for wake-ups.

use std::time::{Duration, Instant};

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::*;

use crate::plan::Cell;
use crate::{Client, Failure, Master, first_word};

/// Services of one direction, sized for the cell.
struct Direction {
    packets:
        iceoryx2::service::port_factory::publish_subscribe::PortFactory<ipc::Service, [u8], ()>,
    events: iceoryx2::service::port_factory::event::PortFactory<ipc::Service>,
    size: usize,
}

struct Put {
    publisher: Publisher<ipc::Service, [u8], ()>,
    notifier: Notifier<ipc::Service>,
    size: usize,
}

struct Get {
    subscriber: Subscriber<ipc::Service, [u8], ()>,
    listener: Listener<ipc::Service>,
    spin: bool,
}

fn prefix(name: &str) -> String {
    format!("{name}raw_")
}

fn node(name: &str) -> Result<Node<ipc::Service>, Failure> {
    set_log_level(LogLevel::Fatal);
    let mut config = Config::default();
    config.global.prefix = FileName::new(prefix(name).as_bytes()).map_err(debug)?;
    NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()
        .map_err(debug)
}

fn debug(error: impl std::fmt::Debug) -> Failure {
    format!("iceoryx2: {error:?}").into()
}

impl Direction {
    fn open(
        node: &Node<ipc::Service>,
        name: &str,
        cell: &Cell,
        putters: usize,
        getters: usize,
    ) -> Result<Self, Failure> {
        let name = ServiceName::new(name).map_err(debug)?;
        let nodes = cell.clients + 4;
        Ok(Self {
            packets: node
                .service_builder(&name)
                .publish_subscribe::<[u8]>()
                .enable_safe_overflow(true)
                .subscriber_max_buffer_size(2)
                .subscriber_max_borrowed_samples(1)
                .max_publishers(putters)
                .max_subscribers(getters)
                .max_nodes(nodes)
                .open_or_create()
                .map_err(debug)?,
            events: node
                .service_builder(&name)
                .event()
                .max_notifiers(putters)
                .max_listeners(getters)
                .max_nodes(nodes)
                .open_or_create()
                .map_err(debug)?,
            size: cell.size,
        })
    }

    fn put(&self) -> Result<Put, Failure> {
        let publisher = self.packets.publisher_builder();
        Ok(Put {
            publisher: publisher
                .initial_max_slice_len(self.size)
                .create()
                .map_err(debug)?,
            notifier: self.events.notifier_builder().create().map_err(debug)?,
            size: self.size,
        })
    }

    fn get(&self, spin: bool) -> Result<Get, Failure> {
        Ok(Get {
            subscriber: self.packets.subscriber_builder().create().map_err(debug)?,
            listener: self.events.listener_builder().create().map_err(debug)?,
            spin,
        })
    }
}

impl Put {
    fn put(&self, round: u32) -> Result<(), Failure> {
        let sample = self.publisher.loan_slice_uninit(self.size).map_err(debug)?;
        // SAFETY: new shared memory is zeroed, and any byte is a valid `u8`.
        let mut sample = unsafe { sample.assume_init() };
        sample.payload_mut()[..4].copy_from_slice(&round.to_le_bytes());
        sample.send().map_err(debug)?;
        self.notifier.notify().map_err(debug)?;
        Ok(())
    }
}

impl Get {
    fn get(&self, patience: Duration) -> Result<Option<u32>, Failure> {
        let deadline = Instant::now() + patience;
        loop {
            if let Some(sample) = self.subscriber.receive().map_err(debug)? {
                return Ok(Some(first_word(sample.payload())));
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            if !self.spin {
                self.listener.timed_wait(|_| {}, left).map_err(debug)?;
            }
        }
    }
}

pub(super) struct IceoryxMaster {
    there: Put,
    back: Get,
    _node: Node<ipc::Service>,
    /// Last field, so that the node is closed before.
    _segment: ManagementSegment,
}

/// Removes a file that iceoryx2 never removes: 16 bytes of shared memory per prefix, writable by every user.
struct ManagementSegment {
    prefix: String,
}

impl Drop for ManagementSegment {
    fn drop(&mut self) {
        let Ok(entries) = std::fs::read_dir("/dev/shm") else {
            return;
        };
        for entry in entries.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.starts_with(&self.prefix) && name.ends_with(".global_mgmt") {
                // A file that stays does no harm.
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

impl IceoryxMaster {
    pub(super) fn open(cell: &Cell, name: &str) -> Result<Self, Failure> {
        let node = node(name)?;
        Ok(Self {
            there: Direction::open(&node, "there", cell, 1, cell.clients)?.put()?,
            back: Direction::open(&node, "back", cell, cell.clients, 1)?.get(cell.spin)?,
            _node: node,
            _segment: ManagementSegment {
                prefix: prefix(name),
            },
        })
    }
}

impl Master for IceoryxMaster {
    fn broadcast(&mut self, round: u32) -> Result<(), Failure> {
        self.there.put(round)
    }

    fn answer(&mut self, patience: Duration) -> Result<Option<u32>, Failure> {
        self.back.get(patience)
    }
}

pub(super) struct IceoryxClient {
    there: Get,
    back: Put,
    _node: Node<ipc::Service>,
}

impl IceoryxClient {
    pub(super) fn open(cell: &Cell, name: &str) -> Result<Self, Failure> {
        let node = node(name)?;
        Ok(Self {
            there: Direction::open(&node, "there", cell, 1, cell.clients)?.get(cell.spin)?,
            back: Direction::open(&node, "back", cell, cell.clients, 1)?.put()?,
            _node: node,
        })
    }
}

impl Client for IceoryxClient {
    fn round(&mut self, patience: Duration) -> Result<Option<u32>, Failure> {
        self.there.get(patience)
    }

    fn answer(&mut self, round: u32) -> Result<(), Failure> {
        self.back.put(round)
    }
}
