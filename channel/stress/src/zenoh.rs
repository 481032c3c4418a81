//! The stress test on plain zenoh, between processes, over TCP or with its shared memory.

use std::time::Duration;

use zenoh::Wait;
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::CongestionControl;
use zenoh::sample::Sample;
use zenoh::shm::{BlockOn, GarbageCollect, ShmProvider, ShmProviderBuilder};

use crate::plan::{Cell, Transport};
use crate::{Client, Failure, Master};

/// TCP port of the master.
const PORT: u16 = 17_480;

fn session(cell: &Cell, role: &str) -> Result<zenoh::Session, Failure> {
    let endpoint = format!("[\"tcp/{}:{PORT}\"]", cell.domain.address(0));
    let mut config = zenoh::Config::default();
    let shared = cell.transport == Transport::ZenohShm;
    for (key, value) in [
        ("mode", "\"peer\""),
        (role, endpoint.as_str()),
        ("scouting/multicast/enabled", "false"),
        // Clients connect to the master only.
        ("scouting/gossip/enabled", "false"),
        (
            "transport/shared_memory/enabled",
            if shared { "true" } else { "false" },
        ),
    ] {
        config.insert_json5(key, value)?;
    }
    if role == "connect/endpoints" {
        config.insert_json5("listen/endpoints", "[]")?;
    }
    zenoh::open(config).wait()
}

struct Put {
    publisher: Publisher<'static>,
    memory: Option<ShmProvider<zenoh::shm::PosixShmProviderBackend>>,
    size: usize,
}

impl Put {
    fn open(session: &zenoh::Session, cell: &Cell, key: &str) -> Result<Self, Failure> {
        let publisher = session
            .declare_publisher(key.to_string())
            .congestion_control(CongestionControl::Block)
            .express(true)
            .wait()?;
        let memory = match cell.transport {
            Transport::ZenohShm => {
                let bytes = 4 * cell.size.max(4096) + (1 << 20);
                Some(ShmProviderBuilder::default_backend(bytes).wait()?)
            }
            _ => None,
        };
        Ok(Self {
            publisher,
            memory,
            size: cell.size,
        })
    }

    fn put(&self, round: u32) -> Result<(), Failure> {
        match &self.memory {
            Some(memory) => {
                let mut packet = memory
                    .alloc(self.size)
                    .with_policy::<BlockOn<GarbageCollect>>()
                    .wait()
                    .map_err(|error| format!("{error:?}"))?;
                packet[..4].copy_from_slice(&round.to_le_bytes());
                self.publisher.put(packet).wait()
            }
            None => {
                let mut packet = vec![0; self.size];
                packet[..4].copy_from_slice(&round.to_le_bytes());
                self.publisher.put(packet).wait()
            }
        }
    }
}

struct Get(Subscriber<FifoChannelHandler<Sample>>);

impl Get {
    fn get(&self, patience: Duration) -> Result<Option<u32>, Failure> {
        let Ok(Some(sample)) = self.0.recv_timeout(patience) else {
            return Ok(None);
        };
        let mut word = [0; 4];
        let mut at = 0;
        for slice in sample.payload().slices() {
            for byte in slice.iter().take(4 - at) {
                word[at] = *byte;
                at += 1;
            }
            if at == 4 {
                break;
            }
        }
        Ok(Some(u32::from_le_bytes(word)))
    }
}

pub(super) struct ZenohMaster {
    there: Put,
    back: Get,
    _session: zenoh::Session,
}

impl ZenohMaster {
    pub(super) fn open(cell: &Cell, name: &str) -> Result<Self, Failure> {
        let session = session(cell, "listen/endpoints")?;
        let back = session.declare_subscriber(format!("{name}/back")).wait()?;
        Ok(Self {
            there: Put::open(&session, cell, &format!("{name}/there"))?,
            back: Get(back),
            _session: session,
        })
    }
}

impl Master for ZenohMaster {
    fn broadcast(&mut self, round: u32) -> Result<(), Failure> {
        self.there.put(round)
    }

    fn answer(&mut self, patience: Duration) -> Result<Option<u32>, Failure> {
        self.back.get(patience)
    }
}

pub(super) struct ZenohClient {
    there: Get,
    back: Put,
    _session: zenoh::Session,
}

impl ZenohClient {
    pub(super) fn open(cell: &Cell, name: &str) -> Result<Self, Failure> {
        let session = session(cell, "connect/endpoints")?;
        let there = session.declare_subscriber(format!("{name}/there")).wait()?;
        Ok(Self {
            there: Get(there),
            back: Put::open(&session, cell, &format!("{name}/back"))?,
            _session: session,
        })
    }
}

impl Client for ZenohClient {
    fn round(&mut self, patience: Duration) -> Result<Option<u32>, Failure> {
        self.there.get(patience)
    }

    fn answer(&mut self, round: u32) -> Result<(), Failure> {
        self.back.put(round)
    }
}
