//! Errors of the channel layer.

use std::path::PathBuf;

use crate::ChannelId;

/// Errors of the channel layer; each is one line for people.
#[derive(Debug, thiserror::Error)]
pub enum ChannelError {
    /// A name that is none.
    #[error("`{found}` is no channel id: expected 1 to 47 letters, digits, `/`, `_`, `-` or `.`")]
    Id {
        /// The text.
        found: String,
    },
    /// A table that cannot be used.
    #[error("{path}: {reason}")]
    Table {
        /// The file, or `table`.
        path: String,
        /// Expected and found.
        reason: String,
    },
    /// A channel that the table does not name.
    #[error("channel `{id}` is not in the table; it names {known}")]
    NoSuchChannel {
        /// As asked for.
        id: String,
        /// The table's channels.
        known: String,
    },
    /// Nothing holds the channels of this host.
    #[error(
        "no hub of bus `{bus}` runs on this host; start `tactnet channel hub --table FILE` with the same table"
    )]
    NoHub {
        /// Name of the bus.
        bus: String,
    },
    /// A hub of the same bus runs already.
    #[error("a hub of bus `{bus}` runs on this host already")]
    HubRuns {
        /// Name of the bus.
        bus: String,
    },
    /// The two ends do not speak of the same packet.
    #[error("channel `{id}`: it carries {expected}, asked for was {found}")]
    Type {
        /// The channel.
        id: ChannelId,
        /// The channel's packet.
        expected: String,
        /// The port's packet.
        found: String,
    },
    /// No place left for a port.
    #[error("channel `{id}`: all {most} {side}-ports are taken")]
    TooManyPorts {
        /// The channel.
        id: ChannelId,
        /// `put` or `get`.
        side: &'static str,
        /// As the table allows.
        most: usize,
    },
    /// Too long a packet.
    #[error("channel `{id}`: a packet holds at most {most} items, asked for were {found}")]
    TooLarge {
        /// The channel.
        id: ChannelId,
        /// As the table allows.
        most: usize,
        /// As asked for.
        found: usize,
    },
    /// More history than the channel keeps.
    #[error(
        "channel `{id}`: it keeps {most} packets for those who come late, asked for were {found}"
    )]
    History {
        /// The channel.
        id: ChannelId,
        /// As the table allows.
        most: usize,
        /// As asked for.
        found: usize,
    },
    /// A client holds on to too many packets.
    #[error("channel `{id}`: {most} packets are {state} at this port; put or drop one first")]
    Held {
        /// The channel.
        id: ChannelId,
        /// `loaned` or `held`.
        state: &'static str,
        /// As the table allows.
        most: usize,
    },
    /// Not enough shared memory.
    #[error("channel `{id}`: a put-port needs {needed} bytes of shared memory, {free} are free")]
    Memory {
        /// The channel.
        id: ChannelId,
        /// Memory of the port.
        needed: u64,
        /// Memory that is left where the bus has its files.
        free: u64,
    },
    /// A sync group of nothing.
    #[error("a sync group needs at least one get-port")]
    EmptyGroup,
    /// A large sync group with ports of several buses.
    #[error("a sync group of more than {most} get-ports takes them from one bus")]
    MixedGroup {
        /// The most of any buses.
        most: usize,
    },
    /// The system refused something.
    #[error("{path}: cannot {action}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The action, as a verb phrase.
        action: &'static str,
        /// Answer of the system.
        source: std::io::Error,
    },
    /// The transport refused something.
    #[error("{what}: {reason}")]
    Transport {
        /// The channel or node.
        what: String,
        /// Answer of the transport.
        reason: String,
    },
}

impl ChannelError {
    /// Returns true where the call must be corrected (exit code 2), false where something broke (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Id { .. }
            | Self::Table { .. }
            | Self::NoSuchChannel { .. }
            | Self::NoHub { .. }
            | Self::HubRuns { .. }
            | Self::Type { .. }
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

/// Returns true where a path is wrong (nothing there, not allowed, a folder for a file), which another call mends; false where the disk fails.
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
            // A file that is no text.
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
