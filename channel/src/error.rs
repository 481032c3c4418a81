//! Errors of the channel layer.

use std::path::PathBuf;

use crate::ChannelId;

/// Errors of the channel layer.
#[derive(Debug, thiserror::Error)]
pub enum ChannelError {
    /// Text that is not a channel id.
    #[error(
        "`{found}` is not a channel id: expected 1 to 47 letters, digits, `/`, `_`, `-` or `.`"
    )]
    Id {
        /// Rejected text.
        found: String,
    },
    /// Table with a missing, unknown or out-of-range value.
    #[error("{path}: {reason}")]
    Table {
        /// Path of the file, or `table`.
        path: String,
        /// Expected and found values.
        reason: String,
    },
    /// Channel that the table does not contain.
    #[error("channel `{id}` is not in the table; the table contains {known}")]
    NoSuchChannel {
        /// Requested id.
        id: String,
        /// Ids of the table, separated by commas.
        known: String,
    },
    /// No hub holds this bus on this host.
    #[error("no hub of bus `{bus}` runs on this host")]
    NoHub {
        /// Name of the bus.
        bus: String,
    },
    /// A hub of the same bus already runs.
    #[error("a hub of bus `{bus}` already runs on this host")]
    HubRuns {
        /// Name of the bus.
        bus: String,
    },
    /// Port and channel have different packet types.
    #[error("channel `{id}`: expected packets of {expected}, found {found}")]
    Type {
        /// The channel.
        id: ChannelId,
        /// Packet type of the channel.
        expected: String,
        /// Packet type of the port.
        found: String,
    },
    /// New channel with the id of an existing one.
    #[error("channel `{id}` exists already")]
    ChannelExists {
        /// The channel.
        id: ChannelId,
    },
    /// All places for ports are taken.
    #[error("channel `{id}`: all {most} {side}-ports are taken")]
    TooManyPorts {
        /// The channel.
        id: ChannelId,
        /// `put` or `get`.
        side: &'static str,
        /// Number of ports that the table allows.
        most: usize,
    },
    /// Packet with too many items.
    #[error("channel `{id}`: expected at most {most} items in a packet, found {found}")]
    TooLarge {
        /// The channel.
        id: ChannelId,
        /// Number of items that the table allows.
        most: usize,
        /// Requested number of items.
        found: usize,
    },
    /// More history than the channel keeps.
    #[error("channel `{id}`: expected a history of at most {most} packets, found {found}")]
    History {
        /// The channel.
        id: ChannelId,
        /// Number of packets that the table allows.
        most: usize,
        /// Requested number of packets.
        found: usize,
    },
    /// Too many packets are loaned or held at once.
    #[error("channel `{id}`: {most} packets are {state} at this port; put or drop one first")]
    Held {
        /// The channel.
        id: ChannelId,
        /// `loaned` or `held`.
        state: &'static str,
        /// Number of packets that the table allows.
        most: usize,
    },
    /// Not enough shared memory.
    #[error(
        "{what}: {needed} bytes of shared memory are needed in {folder}, but only {free} are free; \
         free some there, or make it larger (a container's by `--shm-size`)"
    )]
    Memory {
        /// Channel or file.
        what: String,
        /// Folder of the bus's files.
        folder: PathBuf,
        /// Memory of the file that could not be created, in bytes.
        needed: u64,
        /// Free memory in the folder, in bytes.
        free: u64,
    },
    /// Sync group without ports.
    #[error("a sync group needs at least one get-port")]
    EmptyGroup,
    /// Large sync group with ports of several buses.
    #[error("a sync group of more than {most} get-ports must take all of them from one bus")]
    MixedGroup {
        /// Maximum size of a group with ports of several buses.
        most: usize,
    },
    /// The operating system refused an operation.
    #[error("{path}: cannot {action}: {source}")]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Verb phrase that names the action.
        action: &'static str,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The transport refused an operation.
    #[error("{what}: {reason}")]
    Transport {
        /// Channel, node or setting.
        what: String,
        /// Error of the transport.
        reason: String,
    },
}

/// Action that cures an error. Front ends name the command, flag or function for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Remedy {
    /// Start a hub with the same table on this host.
    StartHub,
}

impl ChannelError {
    /// Returns the action that cures the error, where one is known.
    ///
    /// ```
    /// use tactnet_channel::{Bus, Domain, Remedy, Table};
    ///
    /// let no_hub = Bus::open(Domain::Host, &Table::new("without-a-hub")).unwrap_err();
    /// assert_eq!(no_hub.remedy(), Some(Remedy::StartHub));
    /// ```
    pub fn remedy(&self) -> Option<Remedy> {
        matches!(self, Self::NoHub { .. }).then_some(Remedy::StartHub)
    }

    /// Returns true if the caller must correct the call (exit code 2), false for a failure at run time (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Id { .. }
            | Self::Table { .. }
            | Self::NoSuchChannel { .. }
            | Self::NoHub { .. }
            | Self::HubRuns { .. }
            | Self::Type { .. }
            | Self::ChannelExists { .. }
            | Self::TooManyPorts { .. }
            | Self::TooLarge { .. }
            | Self::History { .. }
            | Self::Memory { .. }
            | Self::EmptyGroup
            | Self::MixedGroup { .. } => true,
            Self::Io { source, .. } => is_wrong_path(source),
            Self::Held { .. } | Self::Transport { .. } => false,
        }
    }

    pub(crate) fn transport(what: impl ToString, reason: impl ToString) -> Self {
        Self::Transport {
            what: what.to_string(),
            reason: reason.to_string(),
        }
    }
}

/// Returns true if another path would help (missing file, no permission, a folder instead of a file), false for a
/// failure of the disk.
pub fn is_wrong_path(error: &std::io::Error) -> bool {
    use std::io::ErrorKind;
    matches!(
        error.kind(),
        ErrorKind::NotFound
            | ErrorKind::PermissionDenied
            | ErrorKind::AlreadyExists
            | ErrorKind::IsADirectory
            | ErrorKind::NotADirectory
            | ErrorKind::InvalidInput
            | ErrorKind::InvalidFilename
            // A file that is not valid text.
            | ErrorKind::InvalidData
    )
}

#[cfg(test)]
mod tests {
    use std::io::ErrorKind;

    use super::*;

    #[test]
    fn a_missing_hub_is_usage_and_one_that_vanishes_is_not() {
        let no_hub = ChannelError::NoHub { bus: "a".into() };
        assert!(no_hub.is_usage());
        assert!(!ChannelError::transport("skin/right", "the hub has gone").is_usage());
        let io = |kind: ErrorKind| ChannelError::Io {
            path: "robot.toml".into(),
            action: "read",
            source: kind.into(),
        };
        assert!(io(ErrorKind::NotFound).is_usage());
        assert!(!io(ErrorKind::StorageFull).is_usage());
    }
}
