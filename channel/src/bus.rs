//! Bus: opens channels and creates ports.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use iceoryx2::prelude::*;

use crate::created_channels;
use crate::history::History;
use crate::kept_packets::KeptPackets;
use crate::memory_failure::MemoryFailure;
use crate::memory_folder::bus_folder;
use crate::put::Owner;
use crate::service::{
    check_attributes, create, create_new, crowd_file, iceoryx_config, node, open, wake_event_file,
};
use crate::table::describe;
use crate::transport::{AnyChannel, AnyNode, Either, both};
use crate::wake_event::WakeEvent;
use crate::{
    AsChannelId, ChannelConfig, ChannelError, ChannelId, ChannelState, GetPort, Packet, PacketType,
    Priority, PutPort, Start, SyncGroup, Table,
};

/// Set of components that a bus connects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// Threads of this process, through clones of one [`Bus`]. Needs no hub.
    Process,
    /// All processes of this host, and through the hub those of other hosts.
    Host,
}

/// A component's access to the channels of a table. Clones share one bus.
///
/// ```
/// use tactnet_channel::{Bus, ChannelConfig, Domain, Priority, Start, Table};
///
/// let table = Table::new("lab").with("force", ChannelConfig::of::<f32>(3));
/// let bus = Bus::open(Domain::Process, &table)?;
/// let get = bus.get_port::<f32>("force", Start::Now)?;
/// let put = bus.put_port::<f32>("force", Priority::Normal)?;
/// put.put_copy(&[0.0, 1.5, 9.8])?;
/// assert_eq!(get.try_get()?.unwrap()[1], 1.5);
/// # Ok::<_, tactnet_channel::ChannelError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Bus {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    node: AnyNode,
    table: Table,
    /// Wake events of the opened channels; used in the process domain only.
    wake_events: Mutex<BTreeMap<ChannelId, Arc<WakeEvent>>>,
    /// Kept packets of the opened channels; used in the process domain only.
    kept: Mutex<BTreeMap<ChannelId, Arc<KeptPackets>>>,
    /// Histories of the opened channels; used in the process domain only.
    histories: Mutex<BTreeMap<ChannelId, Arc<History>>>,
    /// Channels that this bus has created, which exist as long as it.
    created: Mutex<BTreeMap<ChannelId, (ChannelConfig, AnyChannel)>>,
    /// Wake event for sync groups that are too large for one kernel call.
    crowd: Arc<WakeEvent>,
    /// Folder of the bus's files; empty in the process domain.
    folder: PathBuf,
}

impl Drop for Inner {
    fn drop(&mut self) {
        let created = self.created.get_mut();
        let created = created.unwrap_or_else(PoisonError::into_inner);
        for id in created.keys() {
            created_channels::remove(&self.folder, *id);
        }
    }
}

/// An opened channel with everything that a port needs.
pub(crate) struct Opened {
    pub(crate) id: ChannelId,
    pub(crate) config: ChannelConfig,
    pub(crate) channel: AnyChannel,
    pub(crate) wake_event: Arc<WakeEvent>,
    pub(crate) crowd: Arc<WakeEvent>,
    pub(crate) kept: Arc<KeptPackets>,
    pub(crate) history: Arc<History>,
    /// Folder of the bus's files; empty in the process domain.
    pub(crate) folder: PathBuf,
    /// Bytes of one item of the channel's packet type, also where the port's items are bytes.
    pub(crate) unit: usize,
}

impl Opened {
    /// Returns the channel with bytes as items.
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
    /// [`ChannelError::NoHub`] if no hub runs on this host ([`Domain::Host`] only); [`ChannelError::Table`] if the
    /// table is out of range.
    ///
    /// ```
    /// use tactnet_channel::{Bus, ChannelConfig, Domain, Table};
    ///
    /// let table = Table::new("lab").with("force", ChannelConfig::of::<f32>(3));
    /// let bus = Bus::open(Domain::Process, &table)?;
    /// assert_eq!(bus.table().bus, "lab");
    /// # Ok::<_, tactnet_channel::ChannelError>(())
    /// ```
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
                (
                    Either::Process(node(&config, &folder)?),
                    WakeEvent::local(),
                    folder,
                )
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
                (Either::Host(node(&config, &folder)?), crowd, folder)
            }
        };
        Ok(Self {
            inner: Arc::new(Inner {
                node,
                table: table.clone(),
                wake_events: Mutex::default(),
                kept: Mutex::default(),
                histories: Mutex::default(),
                created: Mutex::default(),
                crowd: Arc::new(crowd),
                folder,
            }),
        })
    }

    /// Returns the table that the bus was opened with.
    pub fn table(&self) -> &Table {
        &self.inner.table
    }

    /// Creates a port that puts packets of `T` into channel `id`.
    ///
    /// # Errors
    /// No such channel, another packet type, all put-ports taken, not enough shared memory, no hub.
    ///
    /// ```
    /// # use tactnet_channel::{Bus, ChannelConfig, ChannelError, Domain, Priority, Table};
    /// # let table = Table::new("lab").with("force", ChannelConfig::of::<f32>(3));
    /// # let bus = Bus::open(Domain::Process, &table)?;
    /// let put = bus.put_port::<f32>("force", Priority::RealTime)?;
    /// put.put_copy(&[1.0, 2.0, 3.0])?;
    /// // By default a channel has one put-port.
    /// let second = bus.put_port::<f32>("force", Priority::RealTime);
    /// assert!(matches!(second, Err(ChannelError::TooManyPorts { .. })));
    /// # Ok::<_, ChannelError>(())
    /// ```
    pub fn put_port<T: Packet>(
        &self,
        id: impl AsChannelId,
        priority: Priority,
    ) -> Result<PutPort<T>, ChannelError> {
        let channel = self.open_channel::<T>(id.channel_id()?)?;
        PutPort::open(channel, priority, Owner::Client)
    }

    /// Creates a port that gets packets of `T` from channel `id`.
    ///
    /// # Errors
    /// No such channel, another packet type, all get-ports taken, more history than the channel keeps, no hub.
    ///
    /// ```
    /// # use tactnet_channel::{Bus, ChannelConfig, ChannelError, Domain, Priority, Start, Table};
    /// # let table = Table::new("lab").with("force", ChannelConfig::of::<f32>(3));
    /// # let bus = Bus::open(Domain::Process, &table)?;
    /// let get = bus.get_port::<f32>("force", Start::Now)?;
    /// assert!(get.try_get()?.is_none());
    /// let other_type = bus.get_port::<u8>("force", Start::Now);
    /// assert!(matches!(other_type, Err(ChannelError::Type { .. })));
    /// # Ok::<_, ChannelError>(())
    /// ```
    pub fn get_port<T: Packet>(
        &self,
        id: impl AsChannelId,
        start: Start,
    ) -> Result<GetPort<T>, ChannelError> {
        GetPort::open(self.open_channel::<T>(id.channel_id()?)?, start)
    }

    /// Creates a channel that is not in the table, for as long as this bus and its clones exist.
    ///
    /// Other components of the domain open it by its id, which they may get in a packet.
    ///
    /// # Errors
    /// The table or a client has a channel with this id; a configuration out of range or for other hosts; not enough
    /// shared memory.
    ///
    /// ```
    /// # use tactnet_channel::{Bus, ChannelConfig, Domain, Priority, Start, Table};
    /// # let bus = Bus::open(Domain::Process, &Table::new("lab"))?;
    /// let id = bus.create_channel("force", ChannelConfig::of::<f32>(3))?;
    /// let get = bus.get_port::<f32>(id, Start::Now)?;
    /// bus.put_port::<f32>(id, Priority::Normal)?.put_copy(&[1.5])?;
    /// assert_eq!(get.try_get()?.unwrap()[0], 1.5);
    /// # Ok::<_, tactnet_channel::ChannelError>(())
    /// ```
    pub fn create_channel(
        &self,
        id: impl AsChannelId,
        config: ChannelConfig,
    ) -> Result<ChannelId, ChannelError> {
        let id = id.channel_id()?;
        let Inner {
            node,
            table,
            created,
            folder,
            ..
        } = &*self.inner;
        created_channels::check(table, id, &config)?;
        let mut created = created.lock().unwrap_or_else(PoisonError::into_inner);
        if created.contains_key(&id) {
            return Err(ChannelError::ChannelExists { id });
        }
        MemoryFailure::forget();
        let channel = match node {
            Either::Process(node) => Either::Process(create(node, id, &config, folder)?),
            Either::Host(node) => {
                let channel = create_new(node, id, &config, folder)?;
                WakeEvent::create(&wake_event_file(folder, id)?)?;
                created_channels::write(folder, id, &config)?;
                Either::Host(channel)
            }
        };
        created.insert(id, (config, channel));
        Ok(id)
    }

    /// Creates a group of get-ports to wait for together.
    ///
    /// # Errors
    /// An empty list; more than 128 ports that are not all of this bus.
    ///
    /// ```
    /// # use tactnet_channel::{Bus, ChannelConfig, Domain, Priority, Start, Table, Wait};
    /// # let table = Table::new("lab").with("left", ChannelConfig::of::<f32>(1)).with("right",
    /// ChannelConfig::of::<f32>(1));
    /// # let bus = Bus::open(Domain::Process, &table)?;
    /// let left = bus.get_port::<f32>("left", Start::Now)?;
    /// let right = bus.get_port::<f32>("right", Start::Now)?;
    /// let mut group = bus.sync_group(&[&left, &right])?;
    /// let put = bus.put_port::<f32>("right", Priority::Normal)?;
    /// put.put_copy(&[0.5])?;
    /// assert_eq!(group.wait(Wait::Spin)?, Some(1));
    /// # Ok::<_, tactnet_channel::ChannelError>(())
    /// ```
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
        let config = self.config(id)?;
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

    /// Creates a port that gets packets as bytes and checks their type at run time, for bindings to other languages.
    ///
    /// # Errors
    /// The same as [`Bus::get_port`].
    pub fn get_port_of(
        &self,
        id: impl AsChannelId,
        packet: PacketType<'_>,
        start: Start,
    ) -> Result<GetPort<u8>, ChannelError> {
        GetPort::open(self.open_as(id.channel_id()?, packet)?.raw(), start)
    }

    /// Creates a port that puts packets as bytes and checks their type at run time, for bindings to other languages.
    ///
    /// # Errors
    /// The same as [`Bus::put_port`].
    pub fn put_port_of(
        &self,
        id: impl AsChannelId,
        packet: PacketType<'_>,
        priority: Priority,
    ) -> Result<PutPort<u8>, ChannelError> {
        let channel = self.open_as(id.channel_id()?, packet)?.raw();
        PutPort::open(channel, priority, Owner::Client)
    }

    /// Creates a port that gets the packets of any channel as bytes, for tools.
    ///
    /// # Errors
    /// The same as [`Bus::get_port`], except the type.
    pub fn raw_get_port(&self, id: ChannelId) -> Result<GetPort<u8>, ChannelError> {
        GetPort::open(self.open_any(id)?.raw(), Start::Now)
    }

    /// Creates a port that puts bytes into any channel, for tools.
    ///
    /// # Errors
    /// The same as [`Bus::put_port`], except the type.
    pub fn raw_put_port(
        &self,
        id: ChannelId,
        priority: Priority,
    ) -> Result<PutPort<u8>, ChannelError> {
        PutPort::open(self.open_any(id)?.raw(), priority, Owner::Client)
    }

    /// Creates a port of the hub, which has a place for each priority.
    #[cfg(feature = "zenoh")]
    pub(crate) fn hub_put_port(
        &self,
        id: ChannelId,
        priority: Priority,
    ) -> Result<PutPort<u8>, ChannelError> {
        PutPort::open(self.open_any(id)?.raw(), priority, Owner::Hub)
    }

    /// Returns the number of connected ports of every channel, in the order of the table.
    ///
    /// # Errors
    /// No hub runs on this host.
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

    /// Returns the ids of the processes of this host that have put-ports of a channel; empty for [`Domain::Process`].
    ///
    /// # Errors
    /// No hub runs on this host; no such channel.
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

    /// Returns the configuration of a channel of the table, or of one that a client has created.
    ///
    /// # Errors
    /// No such channel.
    pub fn config(&self, id: impl AsChannelId) -> Result<ChannelConfig, ChannelError> {
        let id = id.channel_id()?;
        let Inner {
            table,
            created,
            folder,
            ..
        } = &*self.inner;
        match table.channel(id.as_str()?) {
            Ok(config) => Ok(config.clone()),
            Err(error) => {
                let created = created.lock().unwrap_or_else(PoisonError::into_inner);
                let own = created.get(&id).map(|(config, _)| config.clone());
                own.or_else(|| created_channels::read(folder, id))
                    .ok_or(error)
            }
        }
    }

    fn open_any(&self, id: ChannelId) -> Result<Opened, ChannelError> {
        let config = self.config(id)?;
        let folder = &self.inner.folder;
        MemoryFailure::forget();
        let (channel, wake_event, kept, history) = match &self.inner.node {
            Either::Process(node) => (
                Either::Process(create(node, id, &config, folder)?),
                of_channel(&self.inner.wake_events, id, WakeEvent::local),
                of_channel(&self.inner.kept, id, KeptPackets::in_process),
                of_channel(&self.inner.histories, id, History::in_process),
            ),
            Either::Host(node) => {
                let opened = open(node, id, &self.inner.table.bus, folder);
                let channel = opened.map_err(|error| match error {
                    // The client that had created it has ended.
                    ChannelError::NoHub { .. } => match self.inner.table.channel(&id.to_string()) {
                        Err(unknown) => unknown,
                        Ok(_) => error,
                    },
                    error => error,
                })?;
                check_attributes(&channel, id, &config)?;
                (
                    Either::Host(channel),
                    Arc::new(WakeEvent::open(&wake_event_file(folder, id)?)?),
                    Arc::new(KeptPackets::in_folder(folder.clone(), id)),
                    Arc::new(History::in_folder(folder.clone(), id)),
                )
            }
        };
        Ok(Opened {
            id,
            unit: config.item_bytes,
            config,
            channel,
            wake_event,
            crowd: self.inner.crowd.clone(),
            kept,
            history,
            folder: folder.clone(),
        })
    }
}

/// Returns what belongs to a channel of the process domain, created at the first use.
fn of_channel<V>(
    all: &Mutex<BTreeMap<ChannelId, Arc<V>>>,
    id: ChannelId,
    create: impl FnOnce() -> V,
) -> Arc<V> {
    let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
    all.entry(id).or_insert_with(|| Arc::new(create())).clone()
}
