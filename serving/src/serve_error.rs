//! Errors of the service.

use std::net::SocketAddr;
use std::path::PathBuf;

use tactnet_channel::{Bus, ChannelError};
use tactnet_models::ModelError;
use tactnet_pipeline::PipelineError;

use crate::web::Holder;

/// Error of the service; each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// Error of the channels.
    #[error(transparent)]
    Channel(#[from] tactnet_channel::ChannelError),
    /// Error of the classifier.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// Error of the compute device.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Error in the table's section of the classifier.
    #[error(transparent)]
    Skin(#[from] tactnet_skin::SkinError),
    /// Another process already sends beliefs on the bus.
    #[error(
        "bus `{bus}`: {} already sends beliefs; end it first, or name another `bus` in the table",
        sender(*pid)
    )]
    ServedAlready {
        /// Name of the bus.
        bus: String,
        /// Process id of the sender, if known.
        pid: Option<u32>,
    },
    /// The network would have more materials than a packet holds.
    #[error("`{material}` would be material {number}, packets hold {most}")]
    TooManyMaterials {
        /// Name of the material to enroll.
        material: String,
        /// Number of the material, from 1.
        number: usize,
        /// Maximum number of materials in a packet.
        most: usize,
    },
    /// The model cannot serve.
    #[error("{}: cannot serve: {reason}", path.display())]
    Unfit {
        /// Run directory of the model.
        path: PathBuf,
        /// Reason why it cannot serve.
        reason: String,
    },
    /// The folder contains no models.
    #[error("{}: contains no model; expected run directories named by numbers", folder.display())]
    NoVersion {
        /// Path of the folder.
        folder: PathBuf,
    },
    /// The server cannot listen at the address.
    #[error("cannot listen at {address}: {source}")]
    Listen {
        /// The requested address.
        address: SocketAddr,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Another program listens at the address.
    #[error("cannot listen at {address}: {holder} uses that port{}", alternative(*free))]
    Taken {
        /// The requested address.
        address: SocketAddr,
        /// Program that listens there.
        holder: Holder,
        /// The next free port.
        free: Option<SocketAddr>,
    },
    /// The operating system does not report the address of a listening socket.
    #[error("cannot read the address of the listening socket: {0}")]
    Web(#[source] std::io::Error),
    /// A file operation failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
}

impl ServeError {
    /// Returns true if the caller must correct the call (exit code 2), false for other failures (exit code 1).
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
    /// Converts the error of opening the belief port; a full port means that another service runs.
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

/// Returns a description of the process that sends beliefs.
fn sender(pid: Option<u32>) -> String {
    match pid {
        Some(pid) => format!("process {pid}, probably another classifier service,"),
        None => "another program, probably another classifier service,".into(),
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
