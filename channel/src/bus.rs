//! Where ports come from.

use std::collections::BTreeMap;
use std::path::{Path as FilePath, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use iceoryx2::prelude::*;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;

use crate::memory_folder::bus_folder;
use crate::packet::{Block, Header};
use crate::table::describe;
use crate::transport::{AnyChannel, AnyNode, Either, both};
use crate::wake_event::WakeEvent;
use crate::{
    ChannelConfig, ChannelError, ChannelId, ChannelState, GetPort, Packet, PacketType, Priority,
    PutPort, Start, SyncGroup, Table,
};

/// How long the places of dead clients may take to become free.
pub(crate) const CLEARING_UP: Duration = Duration::from_secs(4);
/// Which components a bus connects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// The threads of this process, through clones of one [`Bus`]; needs no hub.
    Process,
    /// All processes of this host, and through the hub those of other hosts.
    Host,
}

/// A component's access to the channels of a table. Clones are the same bus.
#[derive(Debug, Clone)]
pub struct Bus {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    node: AnyNode,
    table: Table,
    /// Of channels that were opened, in the process domain.
    wake_events: Mutex<BTreeMap<ChannelId, Arc<WakeEvent>>>,
    /// Rung for groups that are too large for the kernel.
    crowd: Arc<WakeEvent>,
    /// Of the files in [`Domain::Host`].
    folder: PathBuf,
}

/// A channel that was opened.
pub(crate) struct Opened {
    pub(crate) id: ChannelId,
    pub(crate) config: ChannelConfig,
    pub(crate) channel: AnyChannel,
    pub(crate) wake_event: Arc<WakeEvent>,
    pub(crate) crowd: Arc<WakeEvent>,
    /// Folder of its files in shared memory, and how their names begin.
    pub(crate) files: Option<(PathBuf, String)>,
    /// Bytes of what people call an item, also where the port's own are bytes.
    pub(crate) unit: usize,
}

impl Opened {
    /// With bytes for items.
    fn raw(mut self) -> Self {
        self.config.items = self.config.packet_bytes();
        self.config.item_bytes = 1;
        self
    }
}

impl Bus {
    /// Opens the channels of `table`.
    ///
    /// # Errors
    /// No hub runs on this host ([`Domain::Host`]); a table out of range.
    pub fn open(domain: Domain, table: &Table) -> Result<Self, ChannelError> {
        table.check().map_err(|reason| ChannelError::Table {
            path: "table".into(),
            reason,
        })?;
        set_log_level(LogLevel::Fatal);
        let (node, crowd, folder) = match domain {
            Domain::Process => {
                static BUSES: AtomicU32 = AtomicU32::new(0);
                let number = BUSES.fetch_add(1, Ordering::Relaxed);
                let folder = PathBuf::new();
                let config = iceoryx_config(&folder, &format!("{}-{number}", table.bus))?;
                (Either::Process(node(&config)?), WakeEvent::local(), folder)
            }
            Domain::Host => {
                let folder = bus_folder(table)?;
                let crowd = crowd_file(&folder);
                if !crowd.exists() {
                    return Err(ChannelError::NoHub {
                        bus: table.bus.clone(),
                    });
                }
                let config = iceoryx_config(&folder, &table.local_name())?;
                let crowd = WakeEvent::open(&crowd)?;
                (Either::Host(node(&config)?), crowd, folder)
            }
        };
        Ok(Self {
            inner: Arc::new(Inner {
                node,
                table: table.clone(),
                wake_events: Mutex::default(),
                crowd: Arc::new(crowd),
                folder,
            }),
        })
    }

    /// The table it was opened with.
    pub fn table(&self) -> &Table {
        &self.inner.table
    }

    /// A port to put packets of `T` into channel `id`.
    ///
    /// # Errors
    /// No such channel, another type, all put-ports taken, not enough shared memory, no hub.
    pub fn put_port<T: Packet>(
        &self,
        id: impl AsChannelId,
        priority: Priority,
    ) -> Result<PutPort<T>, ChannelError> {
        PutPort::open(self.open_channel::<T>(id.channel_id()?)?, priority)
    }

    /// A port to get packets of `T` from channel `id`.
    ///
    /// # Errors
    /// No such channel, another type, all get-ports taken, more history than it keeps, no hub.
    pub fn get_port<T: Packet>(
        &self,
        id: impl AsChannelId,
        start: Start,
    ) -> Result<GetPort<T>, ChannelError> {
        GetPort::open(self.open_channel::<T>(id.channel_id()?)?, start)
    }

    /// Ports to wait for together.
    ///
    /// # Errors
    /// No port; more than 128, some of them of another bus.
    pub fn sync_group(&self, ports: &[&dyn crate::GetSide]) -> Result<SyncGroup, ChannelError> {
        SyncGroup::new(ports, self.inner.crowd.clone())
    }

    fn open_channel<T: Packet>(&self, id: ChannelId) -> Result<Opened, ChannelError> {
        self.open_as(
            id,
            PacketType {
                name: T::NAME,
                version: T::VERSION,
                item_bytes: size_of::<T>(),
            },
        )
    }

    fn open_as(&self, id: ChannelId, packet: PacketType<'_>) -> Result<Opened, ChannelError> {
        let config = self.inner.table.channel(id.as_str()?)?;
        let asked = describe(packet.name, packet.version, packet.item_bytes);
        if asked != config.describe() {
            return Err(ChannelError::Type {
                id,
                expected: config.describe(),
                found: asked,
            });
        }
        self.open_any(id)
    }

    /// A port for the bytes of packets whose type is known only when the program runs, as in a library for other languages.
    ///
    /// # Errors
    /// As [`Bus::get_port`].
    pub fn get_port_of(
        &self,
        id: impl AsChannelId,
        packet: PacketType<'_>,
        start: Start,
    ) -> Result<GetPort<u8>, ChannelError> {
        GetPort::open(self.open_as(id.channel_id()?, packet)?.raw(), start)
    }

    /// A port to put the bytes of packets whose type is known only when the program runs.
    ///
    /// # Errors
    /// As [`Bus::put_port`].
    pub fn put_port_of(
        &self,
        id: impl AsChannelId,
        packet: PacketType<'_>,
        priority: Priority,
    ) -> Result<PutPort<u8>, ChannelError> {
        PutPort::open(self.open_as(id.channel_id()?, packet)?.raw(), priority)
    }

    /// A port for the bytes of a channel's packets, for tools that show any channel.
    ///
    /// # Errors
    /// As [`Bus::get_port`], but for the type.
    pub fn raw_get_port(&self, id: ChannelId) -> Result<GetPort<u8>, ChannelError> {
        GetPort::open(self.open_any(id)?.raw(), Start::Now)
    }

    /// A port to put bytes into any channel, for tools.
    ///
    /// # Errors
    /// As [`Bus::put_port`], but for the type.
    pub fn raw_put_port(
        &self,
        id: ChannelId,
        priority: Priority,
    ) -> Result<PutPort<u8>, ChannelError> {
        PutPort::open(self.open_any(id)?.raw(), priority)
    }

    /// Who is connected to every channel of the table, in its order.
    ///
    /// # Errors
    /// No hub.
    pub fn states(&self) -> Result<Vec<ChannelState>, ChannelError> {
        let ids = self.inner.table.channels.keys();
        ids.map(|id| {
            let id = ChannelId::new(id)?;
            let channel = self.open_any(id)?.channel;
            Ok(both!(&channel, channel => ChannelState {
                id,
                put_ports: channel.dynamic_config().number_of_publishers(),
                get_ports: channel.dynamic_config().number_of_subscribers(),
            }))
        })
        .collect()
    }

    /// Returns the processes of this host that have put-ports of a channel, by number; empty for [`Domain::Process`].
    ///
    /// # Errors
    /// No hub; no such channel.
    pub fn putting_processes(&self, id: ChannelId) -> Result<Vec<u32>, ChannelError> {
        let mut pids = Vec::new();
        if let Either::Host(channel) = self.open_any(id)?.channel {
            channel.dynamic_config().list_publishers(|port| {
                let pid = port.node_id.pid::<ipc_threadsafe::Service>().ok();
                pids.extend(pid.and_then(|pid| u32::try_from(pid.value()).ok()));
                CallbackProgression::Continue
            });
        }
        Ok(pids)
    }

    fn open_any(&self, id: ChannelId) -> Result<Opened, ChannelError> {
        let config = self.inner.table.channel(id.as_str()?)?;
        let (channel, wake_event) = match &self.inner.node {
            Either::Process(node) => (
                Either::Process(create(node, id, config)?),
                self.local_wake_event(id),
            ),
            Either::Host(node) => {
                let channel = open(node, id, &self.inner.table.bus)?;
                check_attributes(&channel, id, config)?;
                let wake_event =
                    Arc::new(WakeEvent::open(&wake_event_file(&self.inner.folder, id)?)?);
                (Either::Host(channel), wake_event)
            }
        };
        Ok(Opened {
            id,
            config: config.clone(),
            unit: config.item_bytes,
            channel,
            wake_event,
            crowd: self.inner.crowd.clone(),
            files: matches!(self.inner.node, Either::Host(_)).then(|| {
                let prefix = format!("{}_", self.inner.table.local_name());
                (self.inner.folder.clone(), prefix)
            }),
        })
    }

    fn local_wake_event(&self, id: ChannelId) -> Arc<WakeEvent> {
        let mut wake_events = self
            .inner
            .wake_events
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        wake_events
            .entry(id)
            .or_insert_with(|| Arc::new(WakeEvent::local()))
            .clone()
    }
}

/// A name of a channel: text or a [`ChannelId`] that came in a packet.
pub trait AsChannelId {
    /// The id.
    ///
    /// # Errors
    /// Text that is no id.
    fn channel_id(self) -> Result<ChannelId, ChannelError>;
}

impl AsChannelId for &str {
    fn channel_id(self) -> Result<ChannelId, ChannelError> {
        ChannelId::new(self)
    }
}

impl AsChannelId for ChannelId {
    fn channel_id(self) -> Result<ChannelId, ChannelError> {
        Ok(self)
    }
}

/// Iceoryx2's own settings, never those of a file of this machine.
///
/// - `folder`: of its files; an empty one for memory of the process
pub(crate) fn iceoryx_config(folder: &FilePath, prefix: &str) -> Result<Config, ChannelError> {
    let mut config = Config::default();
    if !folder.as_os_str().is_empty() {
        let root = Path::new(folder.as_os_str().as_encoded_bytes())
            .map_err(|error| ChannelError::transport(folder.display(), format!("{error:?}")))?;
        config.global.set_root_path(&root);
    }
    config.global.prefix = FileName::new(format!("{prefix}_").as_bytes())
        .map_err(|error| ChannelError::transport(prefix, format!("{error:?}")))?;
    // The hub clears up; a client must not be held up by what others have left.
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    Ok(config)
}

pub(crate) fn node<S: Service>(config: &Config) -> Result<Node<S>, ChannelError> {
    NodeBuilder::new()
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .config(config)
        .create::<S>()
        .map_err(|error| ChannelError::transport("node", format!("{error:?}")))
}

pub(crate) type Channel<S> =
    iceoryx2::service::port_factory::publish_subscribe::PortFactory<S, [Block], Header>;

pub(crate) fn service_name(id: ChannelId) -> Result<ServiceName, ChannelError> {
    ServiceName::new(id.as_str()?)
        .map_err(|error| ChannelError::transport(id, format!("{error:?}")))
}

/// Opens a channel of the hub.
fn open<S: Service>(node: &Node<S>, id: ChannelId, bus: &str) -> Result<Channel<S>, ChannelError> {
    let begun = Instant::now();
    loop {
        let opened = node
            .service_builder(&service_name(id)?)
            .publish_subscribe::<[Block]>()
            .user_header::<Header>()
            .open();
        match opened {
            Ok(channel) => return Ok(channel),
            // The places of clients that died are free again only after the hub has cleared up.
            Err(PublishSubscribeOpenError::ExceedsMaxNumberOfNodes)
                if begun.elapsed() < CLEARING_UP =>
            {
                std::thread::sleep(Duration::from_millis(10));
            }
            Err(PublishSubscribeOpenError::ExceedsMaxNumberOfNodes) => {
                return Err(ChannelError::transport(
                    id,
                    "more clients than its ports allow",
                ));
            }
            Err(PublishSubscribeOpenError::DoesNotExist) => {
                return Err(ChannelError::NoHub { bus: bus.into() });
            }
            Err(error) => return Err(ChannelError::transport(id, format!("{error:?}"))),
        }
    }
}

/// Creates a channel, or opens it where it is as the table says.
pub(crate) fn create<S: Service>(
    node: &Node<S>,
    id: ChannelId,
    config: &ChannelConfig,
) -> Result<Channel<S>, ChannelError> {
    let define = |attributes: AttributeSpecifier, (key, value): (&str, String)| {
        let key = key
            .try_into()
            .unwrap_or_else(|error| panic!("{key} is a key: {error:?}"));
        let value = value
            .as_str()
            .try_into()
            .map_err(|error| ChannelError::transport(id, format!("{error:?}")))?;
        attributes
            .define(&key, &value)
            .map_err(|error| ChannelError::transport(id, format!("{error:?}")))
    };
    let attributes = attributes(config)
        .into_iter()
        .try_fold(AttributeSpecifier::new(), define)?;
    let (puts, gets) = (config.total_put_ports(), config.total_get_ports());
    let builder = || -> Result<_, ChannelError> {
        Ok(node
            .service_builder(&service_name(id)?)
            .publish_subscribe::<[Block]>()
            .user_header::<Header>()
            .enable_safe_overflow(true)
            .history_size(config.history)
            .subscriber_max_buffer_size(config.depth)
            .subscriber_max_borrowed_samples(config.held)
            .max_publishers(puts)
            .max_subscribers(gets)
            // Clients, the hub, and people who look.
            .max_nodes(puts + gets + 8))
    };
    let created = builder()?.create_with_attributes(&attributes);
    let channel = match created {
        Ok(channel) => channel,
        Err(iceoryx2::service::builder::publish_subscribe::PublishSubscribeCreateError::AlreadyExists) => open(node, id, "")?,
        Err(error) => return Err(ChannelError::transport(id, format!("{error:?}"))),
    };
    check_attributes(&channel, id, config)?;
    Ok(channel)
}

/// Size and alignment that a port checks when it opens.
fn attributes(config: &ChannelConfig) -> [(&'static str, String); 2] {
    let ChannelConfig {
        items,
        depth,
        put_ports,
        get_ports,
        history,
        held,
        distributed,
        ..
    } = config;
    [
        ("packet", config.describe()),
        (
            "resources",
            format!(
                "{items} items, depth {depth}, {put_ports} put-ports, {get_ports} get-ports, history {history}, {held} held{}",
                if *distributed { ", other hosts" } else { "" }
            ),
        ),
    ]
}

fn check_attributes<S: Service>(
    channel: &Channel<S>,
    id: ChannelId,
    config: &ChannelConfig,
) -> Result<(), ChannelError> {
    for (key, found) in attributes(config) {
        let name = key
            .try_into()
            .unwrap_or_else(|error| panic!("{key} is a key: {error:?}"));
        let expected = channel
            .attributes()
            .key_value(&name, 0)
            .map(ToString::to_string);
        if expected.as_deref() != Some(found.as_str()) {
            return Err(ChannelError::Type {
                id,
                expected: expected.unwrap_or_else(|| "something else".into()),
                found: format!("{found} (another table?)"),
            });
        }
    }
    Ok(())
}

/// The file of a channel's wake_event.
pub(crate) fn wake_event_file(folder: &FilePath, id: ChannelId) -> Result<PathBuf, ChannelError> {
    Ok(folder.join(format!("wake_{}", id.as_str()?.replace('/', "+"))))
}

/// The file of the wake_event for large groups; it is there while a hub is or was.
pub(crate) fn crowd_file(folder: &FilePath) -> PathBuf {
    folder.join("wake+")
}
