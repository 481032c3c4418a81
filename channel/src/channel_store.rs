//! Storage of packets that the ports of a channel leave for others: memory of the process, or files in the bus's folder.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use parking_lot::Mutex;

use crate::ChannelId;

/// Place of a channel's values of one kind.
#[derive(Debug)]
pub(crate) enum ChannelStore<T> {
    Process(Mutex<Vec<T>>),
    Host(ChannelFiles),
}

impl<T> ChannelStore<T> {
    pub(crate) fn in_process() -> Self {
        Self::Process(Mutex::default())
    }

    pub(crate) fn in_folder(folder: PathBuf, id: ChannelId) -> Self {
        Self::Host(ChannelFiles {
            folder,
            channel: id.to_string().replace('/', "+"),
        })
    }
}

/// Files of a channel. Their names are a prefix for their kind, the channel's id, `_`, and numbers of ports.
#[derive(Debug)]
pub(crate) struct ChannelFiles {
    folder: PathBuf,
    channel: String,
}

impl ChannelFiles {
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns the path of a file.
    pub(crate) fn path(&self, prefix: &str, ports: impl Display) -> PathBuf {
        self.folder
            .join(format!("{prefix}{}_{ports}", self.channel))
    }

    /// Returns the files of one kind: the part of their names with the numbers of ports, and their paths.
    pub(crate) fn list(&self, prefix: &str) -> Vec<(String, PathBuf)> {
        let begin = format!("{prefix}{}_", self.channel);
        let entries = std::fs::read_dir(&self.folder).into_iter().flatten();
        let files = entries.filter_map(|entry| {
            let entry = entry.ok()?;
            let name = entry.file_name().to_string_lossy().into_owned();
            Some((name.strip_prefix(&begin)?.to_owned(), entry.path()))
        });
        files.collect()
    }
}
