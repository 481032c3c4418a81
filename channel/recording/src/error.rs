//! Errors of recordings.

use std::path::PathBuf;

/// Errors of recordings; each is one line for people.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The channels.
    #[error(transparent)]
    Channel(#[from] tactnet_channel::ChannelError),
    /// The table's section of the classifier.
    #[error(transparent)]
    Skin(#[from] tactnet_skin::SkinError),
    /// The table of channels, as text.
    #[error("the table of channels: {0}")]
    Table(#[from] toml::ser::Error),
    /// The data set that was to be made.
    #[error(transparent)]
    Data(#[from] tactnet_data::DataError),
    /// The system refused something.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Answer of the system.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("{}: cannot go on recording: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Expected and found, or the cause.
        source: mcap::McapError,
    },
    /// No weights of a trained network.
    #[error("{}: no run directory of a trained network", path.display())]
    NotARun {
        /// The folder.
        path: PathBuf,
    },
    /// A channel of the recording that the table does not name.
    #[error("no channel `{channel}` in this table")]
    NoChannel {
        /// Its id.
        channel: String,
    },
    /// Only channels of bytes, or of packets of other programs.
    #[error(
        "no channel of this table has packets that can be recorded: their types are those of `tactnet channel packets`"
    )]
    NothingDescribed,
    /// Nobody puts status.
    #[error("no classifier serves on these channels")]
    NoClassifier,
    /// Nobody puts status any more.
    #[error("the classifier has ended")]
    ClassifierGone,
    /// A material that the data set does not have.
    #[error("--material: no `{material}` in this data set; it has {known}")]
    NoMaterial {
        /// The material asked for.
        material: String,
        /// Those of the data set.
        known: String,
    },
    /// There is no viewer to start.
    #[error(
        "no program `rerun` here; install it with `pip install rerun-sdk==0.36.3`, or write a file with `--save`"
    )]
    NoViewer,
    /// Nobody answers there.
    #[error("{url}: no Rerun viewer ({reason})")]
    NoViewerAt {
        /// Where it was looked for.
        url: String,
        /// Answer of the viewer's library.
        reason: String,
    },
    /// The viewer or its library refuses.
    #[error("the Rerun viewer: {0}")]
    Viewer(String),
    /// The viewer was closed, or does not answer.
    #[error("the Rerun viewer has gone ({0})")]
    ViewerGone(String),
    /// A file for the viewer cannot be written.
    #[error("{}: {reason}", path.display())]
    Unwritten {
        /// Its path.
        path: PathBuf,
        /// Answer of the viewer's library.
        reason: String,
    },
    /// No recording, or not one of ours.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Expected and found, or the cause.
        reason: String,
    },
}

impl RecordingError {
    /// Returns true where the call must be corrected (exit code 2), false where something broke (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Channel(error) => error.is_usage(),
            Self::Skin(error) => error.is_usage(),
            Self::Data(error) => error.is_usage(),
            Self::Io { source, .. } => tactnet_channel::is_wrong_path(source),
            Self::NotARun { .. }
            | Self::NoChannel { .. }
            | Self::NoClassifier
            | Self::NothingDescribed
            | Self::NoMaterial { .. }
            | Self::NoViewer
            | Self::Unreadable { .. } => true,
            Self::Table(_)
            | Self::Write { .. }
            | Self::ClassifierGone
            | Self::NoViewerAt { .. }
            | Self::Viewer(_)
            | Self::ViewerGone(_)
            | Self::Unwritten { .. } => false,
        }
    }
}

#[cfg(feature = "rerun")]
impl From<re_sdk::RecordingStreamError> for RecordingError {
    fn from(error: re_sdk::RecordingStreamError) -> Self {
        Self::Viewer(error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use std::io::ErrorKind;

    use super::*;

    #[test]
    fn wrong_files_are_usage_and_a_full_disk_or_a_viewer_that_has_gone_is_not() {
        let io = |kind: ErrorKind| RecordingError::Io {
            path: "today.mcap".into(),
            source: kind.into(),
        };
        let usage = [
            io(ErrorKind::NotFound),
            RecordingError::NoClassifier,
            RecordingError::Unreadable {
                path: "today.mcap".into(),
                reason: "not an MCAP file".into(),
            },
            RecordingError::Channel(tactnet_channel::ChannelError::NoHub { bus: "a".into() }),
        ];
        assert!(usage.iter().all(RecordingError::is_usage));
        let broke = [
            io(ErrorKind::StorageFull),
            RecordingError::ClassifierGone,
            RecordingError::ViewerGone("closed".into()),
            RecordingError::Write {
                path: "today.mcap".into(),
                source: mcap::McapError::Io(ErrorKind::StorageFull.into()),
            },
            RecordingError::Data(tactnet_data::DataError::Io {
                path: "today.h5".into(),
                action: "write",
                source: ErrorKind::StorageFull.into(),
            }),
        ];
        assert!(!broke.iter().any(RecordingError::is_usage));
    }
}
