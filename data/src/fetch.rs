//! Download of a published data set, verified by its identity.
//!
//! ```text
//! url ──> OUT.part (resumed with Range) ── git blob id ──> OUT
//! ```

mod blob;
mod part;
mod transfer;

pub use blob::git_blob_id;

use crate::{DataError, Remedy};
use part::Part;
use std::path::{Path, PathBuf};
use transfer::{Patience, transfer};

/// A published file: where it is and which content it has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Address of the file.
    pub url: String,
    /// Address of the page that offers it to people.
    pub page: String,
    /// Identity of the content, see [`git_blob_id`].
    pub git_blob_id: String,
}

impl Source {
    /// TactMat: 36 materials, 100 sweeps each (Tulbure & Bäuml, Humanoids 2018).
    pub fn tactmat() -> Self {
        Self {
            url: "https://dlr-alr.github.io/dlr-tactmat/data/tactmat.h5".into(),
            page: "https://dlr-alr.github.io/dlr-tactmat".into(),
            git_blob_id: "e4c8394277da3afc341d8b34aa8e8852ed45c9f5".into(),
        }
    }
}

/// How far a download is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Bytes on disk, those of earlier attempts included.
    pub done_bytes: u64,
    /// Size of the file, where the server tells.
    pub total_bytes: Option<u64>,
    /// Bytes that were on disk before this attempt.
    pub resumed_from: u64,
}

/// A file that is there and has the right content.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fetched {
    /// The file.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// How it came there.
    pub origin: Origin,
}

/// How a file came to be where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// It was there with the right content; nothing was downloaded.
    AlreadyThere,
    /// It was downloaded.
    Downloaded {
        /// Bytes that an earlier, broken attempt had left.
        resumed_from: u64,
    },
}

/// Why a file could not be fetched; every message is one line and says what to do.
#[derive(Debug, thiserror::Error)]
pub enum FetchError {
    /// No answer: no network, no such host, nobody listening, no trust.
    #[error("cannot reach {url} ({reason}): download the file by hand from {page}")]
    Unreachable {
        /// Address of the file.
        url: String,
        /// What the connection failed on.
        reason: String,
        /// Address of the page that offers it.
        page: String,
    },
    /// The server answered, and not with the file.
    #[error("{url}: the server answered {status}: find the file on {page} and download it by hand")]
    Refused {
        /// Address of the file.
        url: String,
        /// HTTP status ("404 Not Found").
        status: String,
        /// Address of the page that offers it.
        page: String,
    },
    /// The connection broke off within the file.
    #[error(
        "{url}: broke off after {done_bytes} of {} bytes ({reason}); they are kept in {}: run the \
         same command again to resume",
        total_bytes.map_or("an unknown number of".into(), |n| n.to_string()), part.display()
    )]
    Cut {
        /// Address of the file.
        url: String,
        /// Bytes on disk.
        done_bytes: u64,
        /// Size of the file, where the server told.
        total_bytes: Option<u64>,
        /// How it broke off.
        reason: String,
        /// The file that keeps the bytes.
        part: PathBuf,
    },
    /// The file that the server sent is not the published one.
    #[error(
        "{url}: expected content with git blob id {expected}, found {found} ({bytes} bytes); \
         removed it: run the same command again to start anew, or look at {page}"
    )]
    WrongContent {
        /// Address of the file.
        url: String,
        /// The published file's identity.
        expected: String,
        /// Identity of what came.
        found: String,
        /// Size of what came.
        bytes: u64,
        /// Address of the page that offers the file.
        page: String,
    },
    /// Something else stands where the file belongs; it is left alone.
    #[error(
        "{}: expected git blob id {expected}, found another file with {found}: move it away or \
         choose another place",
        out.display()
    )]
    Occupied {
        /// Where the file belongs.
        out: PathBuf,
        /// The published file's identity.
        expected: String,
        /// Identity of what is there.
        found: String,
    },
    /// The disk is full, a directory is read-only, or the like. What was downloaded so far is kept.
    #[error(transparent)]
    Disk(#[from] DataError),
}

impl FetchError {
    /// Returns the cure that the caller can apply, if there is one; the message does not contain it.
    pub fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::Unreachable { .. } | Self::Refused { .. } => Some(Remedy::PassDownloadedFile),
            Self::Disk(error) => error.remedy(),
            _ => None,
        }
    }

    /// Returns true if another call would succeed; false for network, server and disk, where the same call may succeed later.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Disk(error) => error.is_usage(),
            Self::Unreachable { .. }
            | Self::Refused { .. }
            | Self::Cut { .. }
            | Self::WrongContent { .. } => false,
            Self::Occupied { .. } => true,
        }
    }
}

/// Brings the published file to `out`, unless it is there already.
///
/// The bytes gather in `<out>.part` and become `out` only when they are the whole file and have the
/// right content. What a broken attempt left there is continued, whatever `source` it came from:
/// the content decides. Directories are made as needed. `progress` hears of the first byte and of
/// every piece (at most 64 KiB) from then on.
///
/// # Errors
/// See [`FetchError`]: the part is kept where a next call can go on with it, and removed where it
/// has proved wrong.
pub fn fetch(
    source: &Source,
    out: &Path,
    progress: &mut dyn FnMut(Progress),
) -> Result<Fetched, FetchError> {
    fetch_with(
        &Patience::default().config().build().new_agent(),
        source,
        out,
        progress,
    )
}

fn fetch_with(
    agent: &ureq::Agent,
    source: &Source,
    out: &Path,
    progress: &mut dyn FnMut(Progress),
) -> Result<Fetched, FetchError> {
    if out
        .try_exists()
        .map_err(|error| DataError::io(out, "read", error))?
    {
        return recognise(source, out);
    }
    if let Some(directory) = out.parent() {
        std::fs::create_dir_all(directory)
            .map_err(|error| DataError::io(directory, "create", error))?;
    }
    let part = Part::of(out);
    let resumed_from = transfer(agent, source, &part, progress)?;
    let bytes = part.len()?;
    let found = git_blob_id(part.path())?;
    if found != source.git_blob_id {
        part.remove()?;
        return Err(FetchError::WrongContent {
            url: source.url.clone(),
            expected: source.git_blob_id.clone(),
            found,
            bytes,
            page: source.page.clone(),
        });
    }
    part.rename_to(out)?;
    Ok(Fetched {
        path: out.to_path_buf(),
        bytes,
        origin: Origin::Downloaded { resumed_from },
    })
}

fn recognise(source: &Source, out: &Path) -> Result<Fetched, FetchError> {
    let found = git_blob_id(out)?;
    if found != source.git_blob_id {
        return Err(FetchError::Occupied {
            out: out.to_path_buf(),
            expected: source.git_blob_id.clone(),
            found,
        });
    }
    let bytes = out
        .metadata()
        .map_err(|error| DataError::io(out, "read", error))?
        .len();
    Ok(Fetched {
        path: out.to_path_buf(),
        bytes,
        origin: Origin::AlreadyThere,
    })
}

#[cfg(test)]
mod tests;
