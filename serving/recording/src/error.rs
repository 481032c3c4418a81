//! What can go wrong with recordings.

use std::path::PathBuf;

/// One line for people.
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
        /// What it was about.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("{}: cannot go on recording: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: mcap::McapError,
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
        /// What the viewer's library says.
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
        /// What the viewer's library says.
        reason: String,
    },
    /// No recording, or not one of ours.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

#[cfg(feature = "rerun")]
impl From<re_sdk::RecordingStreamError> for RecordingError {
    fn from(error: re_sdk::RecordingStreamError) -> Self {
        Self::Viewer(error.to_string())
    }
}
