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
    Serve(#[from] tactnet_serving::ServeError),
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
    /// No recording, or not one of ours.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}
