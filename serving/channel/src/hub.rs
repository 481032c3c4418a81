//! The hub: one process per host that holds every channel of the table, clears up after dead clients and meets other hosts.
//!
//! It is not in the way of a packet: clients exchange them directly, so they lose nothing when the hub dies, and a new hub takes over.

use std::fs::File;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::publish_subscribe;

use crate::bell::Bell;
use crate::bus::{
    SHARED_MEMORY, bell_file, create, crowd_file, iceoryx_config, node, service_name,
};
use crate::packet::{Block, Header};
use crate::transport::Ipc;
use crate::{ChannelError, ChannelId, Table};

/// How long another process may clean up before the hub does it.
const PATIENCE: Duration = Duration::from_millis(100);
const CLEAN_EVERY: Duration = Duration::from_secs(1);

type Channel = publish_subscribe::PortFactory<Ipc, [Block], Header>;

/// Holds the channels of one bus on this host.
#[derive(Debug)]
pub struct Hub {
    bus: String,
    node: Node<Ipc>,
    channels: Vec<(ChannelId, Channel)>,
    bells: Vec<PathBuf>,
    cleaned: Instant,
    /// The system lets go of it when the process ends, however it ends.
    _lock: File,
    #[cfg(feature = "zenoh")]
    bridge: crate::bridge::Bridge,
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
        let lock = lock(&table.local_name())?;
        let node: Node<Ipc> = node(&iceoryx_config(&table.local_name())?)?;
        node.blocking_cleanup_dead_nodes(PATIENCE);
        let mut channels = Vec::new();
        let mut bells = Vec::new();
        for (id, config) in &table.channels {
            let id = ChannelId::new(id)?;
            let channel = create(&node, id, config).or_else(|error| match error {
                ChannelError::Transport { .. } => {
                    // SAFETY: a service that can be neither created nor opened is used by nobody: its creator died in the middle.
                    unsafe {
                        node.force_remove_service(
                            &service_name(id)?,
                            MessagingPattern::PublishSubscribe,
                        )
                    }
                    .map_err(|error| ChannelError::transport(id, format!("{error:?}")))?;
                    create(&node, id, config)
                }
                error => Err(error),
            })?;
            let bell = bell_file(&table.local_name(), id)?;
            Bell::create(&bell)?;
            bells.push(bell);
            channels.push((id, channel));
        }
        bells.push(crowd_file(&table.local_name()));
        Bell::create(&crowd_file(&table.local_name()))?;
        Ok(Self {
            #[cfg(feature = "zenoh")]
            bridge: crate::bridge::Bridge::start(table)?,
            bus: table.bus.clone(),
            node,
            channels,
            bells,
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
    /// Gives the number of dead clients found.
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
        Ok(self.node.blocking_cleanup_dead_nodes(PATIENCE).cleanups as usize)
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

impl Drop for Hub {
    fn drop(&mut self) {
        // Clients that still run must find the same bells again under the next hub.
        let used = |state: &ChannelState| state.put_ports + state.get_ports > 0;
        if !self.states().iter().any(used) {
            for bell in &self.bells {
                let _ = std::fs::remove_file(bell);
            }
        }
    }
}

fn lock(bus: &str) -> Result<File, ChannelError> {
    let path = PathBuf::from(format!("{SHARED_MEMORY}/{bus}_hub"));
    let failed = |source| ChannelError::Io {
        path: path.clone(),
        action: "lock",
        source,
    };
    let file = File::create(&path).map_err(failed)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(std::fs::TryLockError::WouldBlock) => Err(ChannelError::HubRuns { bus: bus.into() }),
        Err(std::fs::TryLockError::Error(source)) => Err(failed(source)),
    }
}
