//! Channels between the components of a robot: many senders, many receivers.
//!
//! The API is the same between threads of a process, processes of a host, and hosts. The design follows chapter 2 of
//! B. Bäuml's thesis (the aRDx communication layer); iceoryx2 and zenoh carry the packets.
//!
//! ```text
//! Table (TOML) ─> Bus::open ─┬─> put_port ─ loan ─ put ──> channel ──> get ─┬─ get_port
//!                            │                                     wait ────┴─ sync_group
//!                            └── Hub: one per host, holds the channels, bridges hosts
//! ```
#![doc = include_str!("../README.md")]

#[cfg(feature = "zenoh")]
mod bridge;
mod bus;
mod channel_store;
mod child_process;
mod connection;
mod create_port;
mod created_channels;
mod error;
mod failed_connections;
mod get;
mod history;
mod hub;
mod hub_runs;
mod hub_thread;
mod inbox;
mod kept_packets;
mod lanes;
mod latest_value;
mod listing;
mod loan;
mod memory_failure;
mod memory_folder;
mod milliseconds;
#[cfg(feature = "zenoh")]
mod network_settings;
mod own_file;
mod packet;
mod percentile;
mod put;
mod rate;
mod rate_limit;
mod received_summary;
mod service;
mod shared;
mod storage;
mod sync_group;
mod table;
mod temporary_bus;
mod ticker;
mod transport;
mod wake_event;

pub use bus::{Bus, Domain};
pub use error::{ChannelError, Remedy, is_wrong_path};
pub use get::{GetPort, GetSide, Received, Start, Wait};
pub use hub::{ChannelState, Hub};
pub use hub_runs::hub_runs;
pub use hub_thread::HubThread;
pub use latest_value::{LatestValue, NewPackets, drain};
pub use listing::{ListedChannel, list_channels};
pub use loan::Loan;
pub use memory_folder::{
    MEMORY_FOLDER_VARIABLE, free_memory, memory_folder, remove_abandoned_buses, remove_bus,
};
pub use milliseconds::Milliseconds;
pub use packet::{AsChannelId, ChannelId, Header, PacketType, Priority};
pub use percentile::percentile;
pub use put::{GetterLoss, PutPort, now_ns};
pub use rate::{PacketRate, measure_rate};
pub use rate_limit::RateLimit;
pub use received_summary::ReceivedSummary;
pub use sync_group::SyncGroup;
pub use table::{ChannelConfig, Congestion, Network, Table};
pub use tactnet_packet::{
    Choice, Described, Description, DescriptionError, Field, FieldType, Fields, IsField, Layout,
    Packet, Text, choices, packets,
};
pub use temporary_bus::{TemporaryBus, temporary_bus_name};
pub use ticker::Ticker;
