//! Bridge between hosts, over zenoh.
//!
//! ```text
//! put-port ─> channel ─> forwarder ══ zenoh, TCP ══> deliverer ─> channel ─> get-ports
//! └──────── this host ──────────┘    one copy       └───────── other host ─────────┘
//! ```
//!
//! A hub subscribes to a channel only while its host has get-ports, and forwards only while another hub subscribes. A
//! packet therefore crosses the network once for each host that wants it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use zenoh::Wait as _;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority as WirePriority};
use zenoh::sample::{Locality, Sample};

use crate::network_settings::{key, settings};
use crate::packet::Header;
use crate::rate_limit::RateLimit;
use crate::{
    Bus, ChannelConfig, ChannelError, ChannelId, ChannelState, Congestion, Domain, GetPort,
    Priority, PutPort, Table, Wait,
};

/// Interval at which a forwarder checks for a stop request.
const LOOK: Duration = Duration::from_millis(100);

/// Network connection of a hub with its distributed channels.
#[derive(Debug)]
pub(crate) struct Bridge {
    /// `None` if the table names no endpoints.
    network: Option<Network>,
}

#[derive(Debug)]
struct Network {
    bus: Bus,
    session: zenoh::Session,
    mirrors: Vec<Mirror>,
    stop: Arc<AtomicBool>,
}

/// A channel that is shared with other hosts.
#[derive(Debug)]
struct Mirror {
    id: ChannelId,
    config: ChannelConfig,
    key: String,
    forwarder: Option<JoinHandle<()>>,
    /// Subscription to other hosts; present while this host has get-ports.
    deliverer: Option<Subscriber<()>>,
}

impl Bridge {
    /// Connects to the other hubs. Missing ones are retried in the background.
    ///
    /// The channels must exist already.
    pub(crate) fn start(table: &Table) -> Result<Self, ChannelError> {
        let network = &table.network;
        if network.listen.is_empty() && network.connect.is_empty() {
            return Ok(Self { network: None });
        }
        let session = zenoh::open(settings(table)?)
            .wait()
            .map_err(|error| ChannelError::transport("network", error))?;
        let bus = Bus::open(Domain::Host, table)?;
        let distributed = table
            .channels
            .iter()
            .filter(|(_, config)| config.distributed);
        let mirrors = distributed
            .map(|(id, config)| {
                Ok(Mirror {
                    id: ChannelId::new(id)?,
                    config: config.clone(),
                    key: key(table, id, config),
                    forwarder: None,
                    deliverer: None,
                })
            })
            .collect::<Result<_, ChannelError>>()?;
        let mut network = Network {
            bus,
            session,
            mirrors,
            stop: Arc::new(AtomicBool::new(false)),
        };
        network.forward()?;
        Ok(Self {
            network: Some(network),
        })
    }

    /// Subscribes to channels that have get-ports on this host, and unsubscribes from the others.
    ///
    /// - `states`: returns the states of all channels; not called without a network
    pub(crate) fn follow(
        &mut self,
        states: impl FnOnce() -> Vec<ChannelState>,
    ) -> Result<(), ChannelError> {
        let Some(network) = &mut self.network else {
            return Ok(());
        };
        let states = states();
        network.forward()?;
        for mirror in &mut network.mirrors {
            let Some(state) = states.iter().find(|state| state.id == mirror.id) else {
                continue;
            };
            // The forwarder holds one of the get-ports.
            let wanted = state.get_ports > usize::from(mirror.forwarder.is_some());
            if wanted && mirror.deliverer.is_none() {
                let delivery = Mutex::new(Delivery::new(&network.bus, mirror));
                let deliverer = network
                    .session
                    .declare_subscriber(mirror.key.clone())
                    .allowed_origin(Locality::Remote)
                    .callback(move |sample| {
                        // Zenoh calls this from one thread for each remote host; the lock keeps the number of loans
                        // within the table's limit.
                        let delivery = delivery.lock();
                        delivery
                            .unwrap_or_else(PoisonError::into_inner)
                            .deliver(&sample);
                    })
                    .wait()
                    .map_err(|error| ChannelError::transport(mirror.id, error))?;
                mirror.deliverer = Some(deliverer);
            } else if !wanted {
                mirror.deliverer = None;
            }
        }
        Ok(())
    }
}

impl Network {
    /// Starts missing forwarders, and restarts those that have ended.
    fn forward(&mut self) -> Result<(), ChannelError> {
        for mirror in &mut self.mirrors {
            if mirror
                .forwarder
                .as_ref()
                .is_some_and(|thread| !thread.is_finished())
            {
                continue;
            }
            mirror.forwarder = None;
            let get = match self.bus.raw_get_port(mirror.id) {
                Ok(get) => get,
                // A client has taken the hub's place, which may become free soon.
                Err(ChannelError::TooManyPorts { .. }) => continue,
                Err(error) => return Err(error),
            };
            let wire = Wire::declare(&self.session, &mirror.key, &mirror.config)?;
            let stop = self.stop.clone();
            let thread = std::thread::Builder::new().name(format!("to {}", mirror.id));
            let thread = thread
                .spawn(move || forward(&get, &wire, &stop))
                .map_err(|error| ChannelError::transport(mirror.id, error))?;
            mirror.forwarder = Some(thread);
        }
        Ok(())
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        if let Some(mut network) = self.network.take() {
            network.stop.store(true, Ordering::SeqCst);
            for mirror in network.mirrors.drain(..) {
                drop(mirror.deliverer);
                if let Some(forwarder) = mirror.forwarder {
                    let _ = forwarder.join();
                }
            }
            let _ = network.session.close().wait();
        }
    }
}

/// Zenoh publishers of one channel, one for each priority.
struct Wire {
    publishers: [Publisher<'static>; 4],
    /// True while any other hub subscribes.
    wanted: Arc<AtomicBool>,
}

impl Wire {
    fn declare(
        session: &zenoh::Session,
        key: &str,
        config: &ChannelConfig,
    ) -> Result<Self, ChannelError> {
        let failed = |error| ChannelError::transport(key, error);
        let congestion = match config.congestion {
            Congestion::Block => CongestionControl::Block,
            Congestion::Drop => CongestionControl::Drop,
        };
        let declare = |priority| {
            session
                .declare_publisher(key.to_string())
                .allowed_destination(Locality::Remote)
                .congestion_control(congestion)
                .priority(priority)
                .express(true)
                .wait()
                .map_err(failed)
        };
        let publishers = [
            declare(WirePriority::Background)?,
            declare(WirePriority::Data)?,
            declare(WirePriority::InteractiveHigh)?,
            declare(WirePriority::RealTime)?,
        ];
        let wanted = Arc::new(AtomicBool::new(false));
        let listener = wanted.clone();
        publishers[0]
            .matching_listener()
            .callback(move |status| listener.store(status.matching(), Ordering::Release))
            .background()
            .wait()
            .map_err(failed)?;
        let now = publishers[0].matching_status().wait().map_err(failed)?;
        wanted.fetch_or(now.matching(), Ordering::AcqRel);
        Ok(Self { publishers, wanted })
    }
}

/// Sends packets that were put on this host to other hosts, until stopped.
fn forward(get: &GetPort<u8>, wire: &Wire, stop: &AtomicBool) {
    let wait = Wait::Block { timeout: LOOK };
    while !stop.load(Ordering::Acquire) {
        // `Network::forward` starts a new forwarder after a failure.
        let Ok(packet) = get.get(wait) else { return };
        let Some(packet) = packet else { continue };
        let header = packet.header();
        if header.remote != 0 || !wire.wanted.load(Ordering::Acquire) {
            continue;
        }
        let publisher = &wire.publishers[usize::from(header.priority.min(3))];
        let sent = publisher
            .put(&*packet)
            .attachment(bytemuck::bytes_of(header))
            .wait();
        // Getters count lost packets.
        drop(sent);
    }
}

/// Puts packets of other hosts into a local channel.
struct Delivery {
    bus: Bus,
    id: ChannelId,
    rate: RateLimit,
    /// Ports by priority, opened with the first packet of each.
    ports: [Option<PutPort<u8>>; 4],
    senders: Senders,
}

impl Delivery {
    fn new(bus: &Bus, mirror: &Mirror) -> Self {
        Self {
            bus: bus.clone(),
            id: mirror.id,
            rate: RateLimit::new(mirror.config.remote_rate),
            ports: [const { None }; 4],
            senders: Senders::default(),
        }
    }

    fn deliver(&mut self, sample: &Sample) {
        if !self.rate.allows(Instant::now()) {
            return;
        }
        let attachment = sample.attachment().map(|bytes| bytes.to_bytes());
        let header =
            attachment.and_then(|bytes| bytemuck::try_pod_read_unaligned::<Header>(&bytes).ok());
        // Sent by another program or another version.
        let Some(header) = header else { return };
        let priority = Priority::from_number(header.priority);
        let port = &mut self.ports[priority as usize];
        if port.is_none() {
            // Without memory the packet is lost, and the next one tries again.
            *port = self.bus.hub_put_port(self.id, priority).ok();
        }
        let Some(port) = port else { return };
        let payload = sample.payload();
        let Ok(mut packet) = port.loan(payload.len()) else {
            return;
        };
        let mut at = 0;
        for slice in payload.slices() {
            packet[at..at + slice.len()].copy_from_slice(slice);
            at += slice.len();
        }
        let missing = self.senders.missing_before(&header);
        if missing > 0 {
            port.add_missing(missing);
        }
        let header = Header {
            bytes: at as u64,
            remote: 1,
            ..header
        };
        let _ = port.put_as(packet, header);
    }
}

/// Maximum number of senders of other hosts that a channel follows.
const SENDERS: usize = 256;

/// Next sequence number of every sender; the longest silent sender comes first.
#[derive(Debug, Default)]
struct Senders(Vec<(u64, u64)>);

impl Senders {
    /// Returns the number of packets of the same sender that did not arrive before this one.
    fn missing_before(&mut self, header: &Header) -> u64 {
        let after = header.sequence.wrapping_add(1);
        let known = self
            .0
            .iter()
            .position(|(sender, _)| *sender == header.sender);
        let (missing, next) = match known.map(|at| self.0.remove(at)) {
            Some((_, expected)) => (
                header.sequence.saturating_sub(expected),
                expected.max(after),
            ),
            None => (0, after),
        };
        if self.0.len() == SENDERS {
            self.0.remove(0);
        }
        self.0.push((header.sender, next));
        missing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_in_a_senders_sequence_are_missing_packets() {
        let mut senders = Senders::default();
        let mut missing = |sender, sequence| {
            senders.missing_before(&Header {
                sender,
                sequence,
                ..Header::default()
            })
        };
        assert_eq!([missing(1, 5), missing(2, 0), missing(1, 6)], [0; 3]);
        assert_eq!((missing(1, 10), missing(2, 1)), (3, 0));
        // A late packet is not a gap.
        assert_eq!((missing(1, 8), missing(1, 11)), (0, 0));
    }
}
