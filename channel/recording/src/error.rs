//! Errors of recordings.

use std::path::PathBuf;

use crate::Topic;

/// Errors of recordings.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// Error of the channels.
    #[error(transparent)]
    Channel(#[from] tactnet_channel::ChannelError),
    /// Error in the table's section of the classifier.
    #[error(transparent)]
    Skin(#[from] tactnet_skin::SkinError),
    /// The table of channels cannot be written as text.
    #[error("the table of channels: {0}")]
    Table(#[from] toml::ser::Error),
    /// Error of the data set to be created.
    #[error(transparent)]
    Data(#[from] tactnet_data::DataError),
    /// The operating system refused an operation.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("{}: cannot continue the recording: {source}", path.display())]
    Write {
        /// Path of the file.
        path: PathBuf,
        /// Error of the MCAP library.
        source: mcap::McapError,
    },
    /// The folder has no weights of a trained network.
    #[error("{}: expected the run directory of a trained network", path.display())]
    NotARun {
        /// Path of the folder.
        path: PathBuf,
    },
    /// The recording has a channel that the table lacks.
    #[error("the table has no channel `{channel}`")]
    NoChannel {
        /// Id of the channel.
        channel: String,
    },
    /// No channel has packets with a description: all are bytes or packets of other programs.
    #[error("no channel of this table has packets of a type that can be recorded")]
    NothingDescribed,
    /// No classifier puts its status.
    #[error("no classifier serves on these channels")]
    NoClassifier,
    /// The classifier stopped putting its status.
    #[error("the classifier has ended")]
    ClassifierGone,
    /// The data set lacks a material.
    #[error("no material `{material}` in this data set; its materials are {known}")]
    NoMaterial {
        /// Requested material.
        material: String,
        /// Materials of the data set, separated by commas.
        known: String,
    },
    /// The viewer's program is not installed.
    #[error("the program `rerun` was not found; install it with `pip install rerun-sdk==0.36.3`")]
    NoViewer,
    /// No viewer answers at this address.
    #[error("{url}: no Rerun viewer ({reason})")]
    NoViewerAt {
        /// Address of the viewer.
        url: String,
        /// Error of the viewer's library.
        reason: String,
    },
    /// The viewer or its library reports an error.
    #[error("the Rerun viewer: {0}")]
    Viewer(String),
    /// The viewer was closed or does not reply.
    #[error("the Rerun viewer has gone ({0})")]
    ViewerGone(String),
    /// A file for the viewer cannot be written.
    #[error("{}: {reason}", path.display())]
    Unwritten {
        /// Path of the file.
        path: PathBuf,
        /// Error of the viewer's library.
        reason: String,
    },
    /// The frames have another number of taxels than rows times columns.
    #[error("{}: frames of {taxels} taxels, expected {rows} x {cols}", path.display())]
    WrongShape {
        /// Path of the file.
        path: PathBuf,
        /// Taxels of a frame.
        taxels: usize,
        /// Expected rows.
        rows: usize,
        /// Expected columns.
        cols: usize,
    },
    /// The recording does not contain the frame rate, and it cannot be estimated.
    #[error("{}: unknown frame rate: no model in the recording, and too few frames to estimate it", path.display())]
    UnknownRate {
        /// Path of the file.
        path: PathBuf,
    },
    /// The file has no table of channels: it is a recording of another program.
    #[error("{}: a recording of another program; its topics: {}", path.display(), listed(topics))]
    Foreign {
        /// Path of the file.
        path: PathBuf,
        /// Topics of the file.
        topics: Vec<Topic>,
    },
    /// The file has no such topic, or no message of it.
    #[error("{}: no message of topic `{topic}`; the topics are: {}", path.display(), listed(topics))]
    NoTopic {
        /// Path of the file.
        path: PathBuf,
        /// Requested topic.
        topic: String,
        /// Topics of the file.
        topics: Vec<Topic>,
    },
    /// The file is not a recording, or is not one of channels.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Expected and found, or the cause.
        reason: String,
    },
}

/// Returns the topics, separated by semicolons.
fn listed(topics: &[Topic]) -> String {
    let texts: Vec<String> = topics.iter().map(Topic::to_string).collect();
    match topics {
        [] => "none".into(),
        _ => texts.join("; "),
    }
}

/// Action that cures an error. Front ends name the command, flag or argument for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordingRemedy {
    /// Use packets of a type with a description.
    UseDescribedPackets,
    /// Write a file for the viewer instead.
    WriteFile,
    /// Give rows and columns of the taxels.
    NameShape,
    /// Give the frames per second.
    NameRate,
    /// Give the topic and the field to read.
    NameTopic,
}

impl RecordingError {
    /// Returns the action that cures the error, where one is known. [`RecordingError::Channel`] has its own.
    pub fn remedy(&self) -> Option<RecordingRemedy> {
        match self {
            Self::NothingDescribed => Some(RecordingRemedy::UseDescribedPackets),
            Self::NoViewer => Some(RecordingRemedy::WriteFile),
            Self::WrongShape { .. } => Some(RecordingRemedy::NameShape),
            Self::UnknownRate { .. } => Some(RecordingRemedy::NameRate),
            Self::Foreign { .. } | Self::NoTopic { .. } => Some(RecordingRemedy::NameTopic),
            _ => None,
        }
    }

    /// Returns true if the caller must correct the call (exit code 2), false for a failure at run time (exit code 1).
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
            | Self::WrongShape { .. }
            | Self::UnknownRate { .. }
            | Self::Foreign { .. }
            | Self::NoTopic { .. }
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
