//! The hub: one process per host that holds every channel of the table, clears up after dead clients and meets other hosts.
//!
//! Bells stay when it ends: clients that still run must find the same ones again under the next hub.
//!
//! It is not in the way of a packet: clients exchange them directly, so they lose nothing when the hub dies, and a new hub takes over.

use std::fs::File;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path as FilePath, PathBuf};
use std::time::{Duration, Instant};

use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::publish_subscribe;

use crate::bus::{create, crowd_file, iceoryx_config, node, wake_event_file};
use crate::memory_folder::{bus_folder, own_folder};
use crate::own_file::own_file;
use crate::packet::{Block, Header};
use crate::transport::Ipc;
use crate::wake_event::WakeEvent;
use crate::{ChannelError, ChannelId, Table};

/// How long another process may clean up before the hub does it.
const PATIENCE: Duration = Duration::from_millis(100);
const CLEAN_EVERY: Duration = Duration::from_secs(1);
/// No client takes so long from making a connection's file to giving it a size.
const UNFINISHED_AFTER: Duration = Duration::from_millis(100);
/// How long a hub that starts tries to clear up.
const CLEARING_UP: Duration = Duration::from_secs(3);
/// No client takes so long to begin.
const STILLBORN_AFTER: Duration = Duration::from_secs(10);

type Channel = publish_subscribe::PortFactory<Ipc, [Block], Header>;

/// Holds the channels of one bus on this host.
#[derive(Debug)]
pub struct Hub {
    bus: String,
    local_name: String,
    folder: PathBuf,
    node: Node<Ipc>,
    channels: Vec<(ChannelId, Channel)>,
    cleaned: Instant,
    #[cfg(feature = "zenoh")]
    bridge: crate::bridge::Bridge,
    /// The system lets go of it when the process ends, however it ends; last, so that the next hub finds nothing in its way.
    _lock: File,
}

/// Who is connected to a channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelState {
    /// The channel.
    pub id: ChannelId,
    /// Put-ports, the hub's own included.
    pub put_ports: usize,
    /// Get-ports, the hub's own included.
    pub get_ports: usize,
}

impl Hub {
    /// Creates all channels of `table`, or takes over those that a former hub has left.
    ///
    /// # Errors
    /// A hub of this bus runs already; clients still use channels of another table; no shared memory.
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
        remove_unfinished(&folder, &config)?;
        remove_stillborn(&config)?;
        let node: Node<Ipc> = node(&config)?;
        let begun = Instant::now();
        let prefix = format!("{}_", table.local_name());
        while !remove_unfinished_connections(&folder, &prefix)? {
            if begun.elapsed() > CLEARING_UP {
                return Err(ChannelError::Io {
                    path: folder.join(format!("{prefix}*.connection")),
                    action: "clear up",
                    source: std::io::Error::other(
                        "one of these is empty and cannot be removed; its owner must, or name another `bus` in the table",
                    ),
                });
            }
            std::thread::sleep(UNFINISHED_AFTER);
        }
        node.blocking_cleanup_dead_nodes(PATIENCE);
        let mut channels = Vec::new();
        for (id, config) in &table.channels {
            let id = ChannelId::new(id)?;
            let channel = create(&node, id, config)?;
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
            _lock: lock,
        })
    }

    /// Name of the bus.
    pub fn bus(&self) -> &str {
        &self.bus
    }

    /// Clears up after clients that died, about once a second, and follows who listens where. To be called some 20 times a second.
    ///
    /// Returns the number of dead clients found.
    ///
    /// # Errors
    /// The network refuses a channel.
    pub fn tick(&mut self) -> Result<usize, ChannelError> {
        #[cfg(feature = "zenoh")]
        self.bridge.follow(&Self::states_of(&self.channels))?;
        if self.cleaned.elapsed() < CLEAN_EVERY {
            return Ok(0);
        }
        self.cleaned = Instant::now();
        let found = self.clear_up()?;
        if found == 0 {
            return Ok(0);
        }
        let stillborn = remove_stillborn(self.node.config())?;
        Ok(found.saturating_sub(stillborn))
    }

    /// Clears up after dead clients. One whose connections are unfinished waits for the next time.
    fn clear_up(&self) -> Result<usize, ChannelError> {
        let prefix = format!("{}_", self.local_name);
        let mut found = 0;
        let mut outcome = Ok(());
        let _ = Node::<Ipc>::list(self.node.config(), |state| {
            if let NodeState::Dead(client) = state {
                match remove_unfinished_connections(&self.folder, &prefix) {
                    Ok(true) => {
                        found +=
                            usize::from(client.blocking_remove_stale_resources(PATIENCE).is_ok());
                    }
                    Ok(false) => {}
                    Err(error) => outcome = Err(error),
                }
            }
            CallbackProgression::Continue
        });
        outcome.map(|()| found)
    }

    /// Who is connected.
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
    let path = folder.join("hub");
    let failed = |source| ChannelError::Io {
        path: path.clone(),
        action: "lock",
        source,
    };
    let file = own_file(&path).map_err(failed)?;
    let begun = Instant::now();
    let mut outcome = file.try_lock();
    // The system takes a moment to let go of what a killed hub held.
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

/// Removes what a hub left that was killed while it created a channel: a service's description that is not yet closed to writing, or its
/// state (or the bus's) that is not yet open to reading. Iceoryx2 can neither open nor create nor clean up such a service. Only a hub creates channels, and
/// there is no other.
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
            // Another bus may remove its own meanwhile.
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

/// Removes connections whose file has no size, because the client that made them was killed before: whoever clears up after it would wait for
/// them for ever (iceoryx2 0.10 forgets its timeout there). Gives false while there are some that a living client may just be making.
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
        // It may be gone by now.
        let Ok(file) = entry.metadata() else { continue };
        if file.len() > 0 {
            continue;
        }
        // A time to come is as old as one long past: clocks are set back, and anybody can set a file's.
        let age = file.modified().map(|time| time.elapsed());
        let age = age.map(|age| age.unwrap_or_else(|ahead| ahead.duration()));
        let old = age.is_ok_and(|age| age > UNFINISHED_AFTER);
        clear &= old && std::fs::remove_file(entry.path()).is_ok();
    }
    Ok(clear)
}

/// Removes the files of clients that were killed before they were wholly there, some seconds ago; iceoryx2 looks for them under the prefix
/// of its global configuration only. Gives how many are or were there.
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
            // Iceoryx2 may have been faster.
            let _ = std::fs::remove_file(entry.path());
            let _ = std::fs::remove_dir_all(folder.join(number));
        }
    }
    Ok(found)
}
