//! Hub: one process per host that holds every channel of the table, cleans up after dead clients and connects to other
//! hosts.
//!
//! Clients exchange packets directly, so they lose nothing when the hub dies, and a new hub takes over. Wake events
//! stay when a hub ends: running clients must find the same ones under the next hub.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path as FilePath, PathBuf};
use std::time::{Duration, Instant};

use iceoryx2::node::NodeView;
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::publish_subscribe;

use crate::child_process::{Work, in_child};
use crate::history::History;
use crate::hub_runs::HUB_LOCK;
use crate::kept_packets::KeptPackets;
use crate::memory_failure::{MemoryFailure, file_error};
use crate::memory_folder::{bus_folder, own_folder};
use crate::own_file::own_file;
use crate::packet::{Block, Header};
use crate::service::{create, crowd_file, iceoryx_config, node, wake_event_file};
use crate::transport::Ipc;
use crate::wake_event::WakeEvent;
use crate::{ChannelError, ChannelId, Table};

/// Time that another process gets to clean up before the hub does it.
const PATIENCE: Duration = Duration::from_millis(100);
const CLEAN_EVERY: Duration = Duration::from_secs(1);
/// Maximum time that a client needs between creating a connection's file and giving it a size.
const UNFINISHED_AFTER: Duration = Duration::from_millis(100);
/// Maximum time that a starting hub spends on cleaning up.
const CLEARING_UP: Duration = Duration::from_secs(3);
/// Maximum number of attempts to clean up after a client whose shared memory crashes the clean-up.
const CRASHES: u32 = 2;
/// Maximum time that a client needs to start.
const STILLBORN_AFTER: Duration = Duration::from_secs(10);

type Channel = publish_subscribe::PortFactory<Ipc, [Block], Header>;

/// Holds the channels of one bus on this host.
///
/// ```
/// use tactnet_channel::{Bus, ChannelConfig, Domain, Hub, Priority, Table, TemporaryBus, temporary_bus_name};
///
/// let table = Table::new(&temporary_bus_name("doc-hub")).with("force", ChannelConfig::of::<f32>(3));
/// let _remove_at_the_end = TemporaryBus(&table);
/// let mut hub = Hub::start(&table)?;
/// // Other processes open the bus in the same way.
/// let bus = Bus::open(Domain::Host, &table)?;
/// let _put = bus.put_port::<f32>("force", Priority::Normal)?;
/// hub.tick()?; // about 20 times a second
/// assert_eq!(hub.states()[0].put_ports, 1);
/// # Ok::<_, tactnet_channel::ChannelError>(())
/// ```
#[derive(Debug)]
pub struct Hub {
    bus: String,
    local_name: String,
    folder: PathBuf,
    node: Node<Ipc>,
    channels: Vec<(ChannelId, Channel)>,
    cleaned: Instant,
    /// Number of times that the clean-up after a dead client has crashed, by client.
    crashes: BTreeMap<String, u32>,
    #[cfg(feature = "zenoh")]
    bridge: crate::bridge::Bridge,
    /// Lock of the bus. The system releases it when the process ends. Last field, so that everything else is dropped
    /// before.
    _lock: File,
}

impl Drop for Hub {
    fn drop(&mut self) {
        if !self.crashes.is_empty() {
            // A client has overwritten the lists that closing a channel would change: end like a killed hub.
            std::mem::forget(std::mem::take(&mut self.channels));
        }
    }
}

/// Number of connected ports of a channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelState {
    /// Id of the channel.
    pub id: ChannelId,
    /// Put-ports, including the hub's.
    pub put_ports: usize,
    /// Get-ports, including the hub's.
    pub get_ports: usize,
}

impl Hub {
    /// Creates all channels of `table`, or takes over those of an earlier hub.
    ///
    /// # Errors
    /// A hub of this bus already runs; clients still use channels of another table; not enough shared memory.
    pub fn start(table: &Table) -> Result<Self, ChannelError> {
        table.check().map_err(|reason| ChannelError::Table {
            path: "table".into(),
            reason,
        })?;
        set_log_level(LogLevel::Fatal);
        let folder = bus_folder(table)?;
        own_folder(&folder)?;
        let lock = lock(&folder, &table.bus)?;
        let config = iceoryx_config(&folder, &table.local_name())?;
        MemoryFailure::forget();
        remove_unfinished(&folder, &config)?;
        remove_stillborn(&config)?;
        let node: Node<Ipc> = node(&config, &folder)?;
        let begun = Instant::now();
        let prefix = format!("{}_", table.local_name());
        while !remove_unfinished_connections(&folder, &prefix)? {
            if begun.elapsed() > CLEARING_UP {
                return Err(ChannelError::Io {
                    path: folder.join(format!("{prefix}*.connection")),
                    action: "clear up",
                    source: std::io::Error::other(
                        "one of these files is empty and cannot be removed; remove it as its owner, or name another `bus` in the table",
                    ),
                });
            }
            std::thread::sleep(UNFINISHED_AFTER);
        }
        // What it leaves is tried again by `tick`.
        let _ = in_child(CLEARING_UP, || {
            node.blocking_cleanup_dead_nodes(PATIENCE);
            true
        });
        let mut channels = Vec::new();
        for (id, config) in &table.channels {
            let id = ChannelId::new(id)?;
            let channel = create(&node, id, config, &folder)?;
            WakeEvent::create(&wake_event_file(&folder, id)?)?;
            channels.push((id, channel));
        }
        WakeEvent::create(&crowd_file(&folder))?;
        Ok(Self {
            #[cfg(feature = "zenoh")]
            bridge: crate::bridge::Bridge::start(table)?,
            bus: table.bus.clone(),
            local_name: table.local_name(),
            folder,
            node,
            channels,
            cleaned: Instant::now(),
            crashes: BTreeMap::new(),
            _lock: lock,
        })
    }

    /// Returns the name of the bus.
    pub fn bus(&self) -> &str {
        &self.bus
    }

    /// Cleans up after dead clients, about once a second, and follows the get-ports of all hosts.
    ///
    /// Call it about 20 times a second. Returns the number of dead clients found.
    ///
    /// # Errors
    /// The network refuses a channel.
    pub fn tick(&mut self) -> Result<usize, ChannelError> {
        #[cfg(feature = "zenoh")]
        self.bridge.follow(|| Self::states_of(&self.channels))?;
        if self.cleaned.elapsed() < CLEAN_EVERY {
            return Ok(0);
        }
        self.cleaned = Instant::now();
        self.remove_unread();
        let found = self.clear_up()?;
        if found == 0 {
            return Ok(0);
        }
        let stillborn = remove_stillborn(self.node.config())?;
        Ok(found.saturating_sub(stillborn))
    }

    /// Removes kept packets of get-ports, and histories of put-ports, that have ended.
    fn remove_unread(&self) {
        for (id, channel) in &self.channels {
            History::in_folder(self.folder.clone(), *id).remove_ended(|| {
                let mut living = BTreeSet::new();
                channel.dynamic_config().list_publishers(|port| {
                    living.insert(port.publisher_id.value());
                    CallbackProgression::Continue
                });
                living
            });
            let kept = KeptPackets::in_folder(self.folder.clone(), *id);
            let unread = kept.getters();
            if unread.is_empty() {
                continue;
            }
            let mut living = BTreeSet::new();
            channel.dynamic_config().list_subscribers(|port| {
                living.insert(port.subscriber_id.value());
                CallbackProgression::Continue
            });
            for getter in unread.difference(&living) {
                drop(kept.take(*getter));
            }
        }
    }

    /// Cleans up after dead clients. Clients with unfinished connections are left for the next call.
    ///
    /// A client that overwrote its shared memory can crash this, so a child process does it.
    fn clear_up(&mut self) -> Result<usize, ChannelError> {
        let prefix = format!("{}_", self.local_name);
        let mut found = 0;
        let mut outcome = Ok(());
        let _ = Node::<Ipc>::list(self.node.config(), |state| {
            let NodeState::Dead(client) = state else {
                return CallbackProgression::Continue;
            };
            let id = format!("{:?}", client.id());
            let crashes = self.crashes.get(&id).copied().unwrap_or(0);
            match remove_unfinished_connections(&self.folder, &prefix) {
                Ok(true) if crashes < CRASHES => {
                    let remove = || client.blocking_remove_stale_resources(PATIENCE).is_ok();
                    match in_child(CLEARING_UP, remove) {
                        Work::Done => found += 1,
                        Work::Failed => {}
                        Work::Crashed => drop(self.crashes.insert(id, crashes + 1)),
                    }
                }
                Ok(_) => {}
                Err(error) => outcome = Err(error),
            }
            CallbackProgression::Continue
        });
        outcome.map(|()| found)
    }

    /// Returns the number of connected ports of every channel.
    pub fn states(&self) -> Vec<ChannelState> {
        Self::states_of(&self.channels)
    }

    fn states_of(channels: &[(ChannelId, Channel)]) -> Vec<ChannelState> {
        channels
            .iter()
            .map(|(id, channel)| ChannelState {
                id: *id,
                put_ports: channel.dynamic_config().number_of_publishers(),
                get_ports: channel.dynamic_config().number_of_subscribers(),
            })
            .collect()
    }
}

fn lock(folder: &FilePath, bus: &str) -> Result<File, ChannelError> {
    let path = folder.join(HUB_LOCK);
    let failed = |source| file_error(&path, "lock", 0, source);
    let file = own_file(&path).map_err(failed)?;
    let begun = Instant::now();
    let mut outcome = file.try_lock();
    // The system needs a moment to release the lock of a killed hub.
    while matches!(outcome, Err(std::fs::TryLockError::WouldBlock)) && begun.elapsed() < CLEAN_EVERY
    {
        std::thread::sleep(Duration::from_millis(20));
        outcome = file.try_lock();
    }
    match outcome {
        Ok(()) => Ok(file),
        Err(std::fs::TryLockError::WouldBlock) => Err(ChannelError::HubRuns { bus: bus.into() }),
        Err(std::fs::TryLockError::Error(source)) => Err(failed(source)),
    }
}

/// Removes services that a killed hub left half created.
///
/// Such a service has a description that is still writable, or a state (or the bus has one) that is not yet readable.
/// Iceoryx2 can neither open, create nor clean up such a service. Only the hub creates channels, and this is the only
/// hub.
fn remove_unfinished(memory: &FilePath, config: &Config) -> Result<(), ChannelError> {
    let services = PathBuf::from(config.global.service_dir().to_string());
    let prefix = config.global.prefix.to_string();
    let states = [
        config.global.service.dynamic_config_storage_suffix,
        config.global.node.global_mgmt_suffix,
    ]
    .map(|suffix| suffix.to_string());
    for folder in [services.as_path(), memory] {
        let failed = |source| ChannelError::Io {
            path: folder.into(),
            action: "clear up",
            source,
        };
        let Ok(entries) = std::fs::read_dir(folder) else {
            continue;
        };
        for entry in entries {
            let entry = entry.map_err(failed)?;
            let name = entry.file_name().to_string_lossy().into_owned();
            // Another bus may have removed its file meanwhile.
            let Ok(file) = entry.metadata() else { continue };
            let unfinished = if folder == memory {
                states.iter().any(|state| name.ends_with(state))
                    && file.permissions().mode() & 0o400 == 0
            } else {
                !file.permissions().readonly()
            };
            if name.starts_with(&prefix) && unfinished {
                std::fs::remove_file(entry.path()).map_err(failed)?;
            }
        }
    }
    Ok(())
}

/// Removes connections whose file is empty because their client was killed before it set the size.
///
/// Cleaning up after that client would otherwise wait for ever (iceoryx2 0.10 ignores its timeout there). Returns
/// false while young empty files exist, which a living client may still complete.
fn remove_unfinished_connections(folder: &FilePath, prefix: &str) -> Result<bool, ChannelError> {
    let failed = |source| ChannelError::Io {
        path: folder.into(),
        action: "clear up",
        source,
    };
    let mut clear = true;
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if !name.starts_with(prefix) || !name.ends_with(".connection") {
            continue;
        }
        // The file may have been removed meanwhile.
        let Ok(file) = entry.metadata() else { continue };
        if file.len() > 0 {
            continue;
        }
        // A time in the future counts like the past: clocks are set back, and any user can set a file's time.
        let age = file.modified().map(|time| time.elapsed());
        let age = age.map(|age| age.unwrap_or_else(|ahead| ahead.duration()));
        let old = age.is_ok_and(|age| age > UNFINISHED_AFTER);
        clear &= old && std::fs::remove_file(entry.path()).is_ok();
    }
    Ok(clear)
}

/// Removes the files of clients that were killed while they started, some seconds ago. Returns the number of such
/// clients.
///
/// Iceoryx2 looks for them under the prefix of its global configuration only.
fn remove_stillborn(config: &Config) -> Result<usize, ChannelError> {
    let folder = PathBuf::from(config.global.node_dir().to_string());
    let failed = |source| ChannelError::Io {
        path: folder.clone(),
        action: "clear up",
        source,
    };
    let prefix = config.global.prefix.to_string();
    let details = format!("{prefix}node{}", config.global.node.static_config_suffix);
    let Ok(entries) = std::fs::read_dir(&folder) else {
        return Ok(0);
    };
    let mut found = 0;
    for entry in entries {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        // `PREFIX NUMBER .node_monitor…`
        let Some((number, kind)) = name
            .strip_prefix(&prefix)
            .and_then(|name| name.split_once('.'))
        else {
            continue;
        };
        if folder.join(number).join(&details).exists() {
            continue;
        }
        found += usize::from(kind.ends_with("_context"));
        let age = entry
            .metadata()
            .and_then(|file| file.modified())
            .map(|time| time.elapsed());
        let age = age.map(|age| age.unwrap_or_else(|ahead| ahead.duration()));
        if age.is_ok_and(|age| age > STILLBORN_AFTER) {
            // Iceoryx2 may have removed them first.
            let _ = std::fs::remove_file(entry.path());
            let _ = std::fs::remove_dir_all(folder.join(number));
        }
    }
    Ok(found)
}
