//! Errors of the service.

use std::net::SocketAddr;
use std::path::PathBuf;

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
            Self::TooManyMaterials { .. }
            | Self::Unfit { .. }
            | Self::NoVersion { .. }
            | Self::Listen { .. }
            | Self::Taken { .. } => true,
            Self::Web(_) => false,
            Self::Io { source, .. } => tactnet_channel::is_wrong_path(source),
        }
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
