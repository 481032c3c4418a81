//! Channels that clients create at run time: each has a file with its configuration in the bus's folder.

use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use crate::memory_failure::file_error;
use crate::service::wake_event_file;
use crate::{ChannelConfig, ChannelError, ChannelId, Table};

fn file(folder: &Path, id: ChannelId) -> PathBuf {
    folder.join(format!("channel_{}", id.to_string().replace('/', "+")))
}

/// Checks the configuration of a new channel.
pub(crate) fn check(
    table: &Table,
    id: ChannelId,
    config: &ChannelConfig,
) -> Result<(), ChannelError> {
    if table.channels.contains_key(id.as_str()?) {
        return Err(ChannelError::ChannelExists { id });
    }
    let wrong = |reason: String| ChannelError::Table {
        path: "new channel".into(),
        reason,
    };
    if config.distributed {
        return Err(wrong(format!(
            "channel `{id}`: distributed: only channels of the table are shared with other hosts"
        )));
    }
    config.check(id.as_str()?).map_err(wrong)
}

/// Publishes the configuration for other clients.
pub(crate) fn write(
    folder: &Path,
    id: ChannelId,
    config: &ChannelConfig,
) -> Result<(), ChannelError> {
    let path = file(folder, id);
    let unfinished = path.with_extension("unfinished");
    let text = toml::to_string(config).unwrap_or_else(|error| panic!("it is TOML: {error}"));
    let written = || -> std::io::Result<()> {
        let mut file = std::fs::OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(true)
            .mode(0o600)
            .custom_flags(libc::O_NOFOLLOW)
            .open(&unfinished)?;
        file.write_all(text.as_bytes())?;
        std::fs::rename(&unfinished, &path)
    };
    written().map_err(|source| file_error(&path, "write", text.len() as u64, source))
}

/// Returns the configuration of a channel that a client has created.
pub(crate) fn read(folder: &Path, id: ChannelId) -> Option<ChannelConfig> {
    if folder.as_os_str().is_empty() {
        return None;
    }
    let text = std::fs::read_to_string(file(folder, id)).ok()?;
    toml::from_str(&text).ok()
}

/// Removes the configuration of a channel, which no client can open afterwards.
pub(crate) fn remove(folder: &Path, id: ChannelId) {
    if !folder.as_os_str().is_empty() {
        // The hub may have removed the folder.
        let _ = std::fs::remove_file(file(folder, id));
        let _ = wake_event_file(folder, id).map(std::fs::remove_file);
    }
}
