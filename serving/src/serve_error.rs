//! Errors of the service.

use std::net::SocketAddr;
use std::path::PathBuf;

use tactnet_channel::{Bus, ChannelError};
use tactnet_models::ModelError;
use tactnet_pipeline::PipelineError;

use crate::web::Holder;

/// Errors of the service; each is one line for people.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The channels.
    #[error(transparent)]
    Channel(#[from] tactnet_channel::ChannelError),
    /// The classifier.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The device.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The table's section of the classifier.
    #[error(transparent)]
    Skin(#[from] tactnet_skin::SkinError),
    /// Something else puts beliefs on the bus.
    #[error(
        "bus `{bus}`: {} puts beliefs already; end it first, or name another `bus` in the table",
        server(*pid)
    )]
    ServedAlready {
        /// Name of the bus.
        bus: String,
        /// The process, where it is known.
        pid: Option<u32>,
    },
    /// More materials than packets hold.
    #[error("`{material}` would be material {number}, packets hold {most}")]
    TooManyMaterials {
        /// The material that was to be learnt.
        material: String,
        /// Its number, from 1.
        number: usize,
        /// Materials of a packet.
        most: usize,
    },
    /// A model that cannot serve.
    #[error("{}: cannot serve: {reason}", path.display())]
    Unfit {
        /// Its run directory.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A folder without models.
    #[error("{}: no model; expected run directories with numbers for names", folder.display())]
    NoVersion {
        /// The folder.
        folder: PathBuf,
    },
    /// Nothing can listen at an address.
    #[error("cannot listen at {address}: {source}")]
    Listen {
        /// Where browsers or Prometheus were to be answered.
        address: SocketAddr,
        /// Answer of the system.
        source: std::io::Error,
    },
    /// Another program listens at an address.
    #[error("cannot listen at {address}: {holder} has that port{}", alternative(*free))]
    Taken {
        /// Where browsers or Prometheus were to be answered.
        address: SocketAddr,
        /// Who listens there.
        holder: Holder,
        /// The next port that nobody has.
        free: Option<SocketAddr>,
    },
    /// The system tells nothing of a socket that listens.
    #[error("a socket that listens: {0}")]
    Web(#[source] std::io::Error),
    /// The system refused something.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Answer of the system.
        source: std::io::Error,
    },
}

impl ServeError {
    /// Returns true where the call must be corrected (exit code 2), false where something broke (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Channel(error) => error.is_usage(),
            Self::Skin(error) => error.is_usage(),
            Self::Pipeline(error) => error.is_usage(),
            Self::Model(error) => !matches!(error, ModelError::Fit { .. }),
            Self::ServedAlready { .. }
            | Self::TooManyMaterials { .. }
            | Self::Unfit { .. }
            | Self::NoVersion { .. }
            | Self::Listen { .. }
            | Self::Taken { .. } => true,
            Self::Web(_) => false,
            Self::Io { source, .. } => tactnet_channel::is_wrong_path(source),
        }
    }
}

impl ServeError {
    /// Returns what is wrong where the port for beliefs cannot be opened.
    pub(crate) fn of_belief_port(error: ChannelError, bus: &Bus) -> Self {
        match error {
            ChannelError::TooManyPorts { id, .. } => Self::ServedAlready {
                bus: bus.table().bus.clone(),
                pid: bus
                    .putting_processes(id)
                    .ok()
                    .and_then(|all| all.first().copied()),
            },
            error => Self::Channel(error),
        }
    }
}

/// Returns who puts beliefs, most likely.
fn server(pid: Option<u32>) -> String {
    match pid {
        Some(pid) => format!("process {pid}, most likely another `tactnet serve`,"),
        None => "another program, most likely a second `tactnet serve`,".into(),
    }
}

fn alternative(free: Option<SocketAddr>) -> String {
    free.map_or(String::new(), |free| format!("; {free} is free"))
}

#[cfg(test)]
mod tests {
    use std::io::ErrorKind;

    use tactnet_data::DataError;

    use super::*;

    #[test]
    fn wrong_calls_are_usage_and_a_full_disk_or_a_broken_transport_is_not() {
        let io = |kind: ErrorKind| ServeError::Io {
            path: "models".into(),
            source: kind.into(),
        };
        let usage = [
            io(ErrorKind::NotFound),
            ServeError::NoVersion {
                folder: "models".into(),
            },
            ServeError::Channel(tactnet_channel::ChannelError::NoHub {
                bus: "justin".into(),
            }),
            ServeError::Skin(tactnet_skin::SkinError::Section("`finger`".into())),
        ];
        assert!(usage.iter().all(ServeError::is_usage));
        let broke = [
            io(ErrorKind::StorageFull),
            ServeError::Channel(tactnet_channel::ChannelError::Transport {
                what: "skin/right".into(),
                reason: "gone".into(),
            }),
            ServeError::Pipeline(PipelineError::Optimizer("diverged".into())),
            ServeError::Pipeline(PipelineError::Data(DataError::Io {
                path: "sweeps.h5".into(),
                action: "write",
                source: ErrorKind::StorageFull.into(),
            })),
        ];
        assert!(!broke.iter().any(ServeError::is_usage));
    }
}
