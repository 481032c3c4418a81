//! Downloads of published data sets, verified by their checksum.
//!
//! ```text
//! url ──> OUT.part (resumed with Range) ── git blob id ──> OUT
//! ```

mod blob;
mod part;
mod public_set;
mod transfer;

pub use blob::git_blob_id;
pub use public_set::{PublicSet, SetProgress};

use crate::{DataError, Remedy};
use part::Part;
use std::path::{Path, PathBuf};
use transfer::{Patience, transfer};

/// Published file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Address of the file.
    pub url: String,
    /// Address of the web page that links to the file.
    pub page: String,
    /// Checksum of the content, see [`git_blob_id`].
    pub git_blob_id: String,
}

impl Source {
    /// Returns the source of TactMat: 36 materials, 100 sweeps each (Tulbure & Bäuml, Humanoids 2018).
    ///
    /// ```
    /// use tactnet_data::Source;
    ///
    /// assert!(Source::tactmat().url.ends_with("tactmat.h5"));
    /// ```
    pub fn tactmat() -> Self {
        Self {
            url: "https://dlr-alr.github.io/dlr-tactmat/data/tactmat.h5".into(),
            page: "https://dlr-alr.github.io/dlr-tactmat".into(),
            git_blob_id: "e4c8394277da3afc341d8b34aa8e8852ed45c9f5".into(),
        }
    }
}

/// Progress of a download.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Bytes on disk, including those of earlier attempts.
    pub done_bytes: u64,
    /// Size of the file in bytes, if the server names it.
    pub total_bytes: Option<u64>,
    /// Bytes that earlier attempts had left on disk.
    pub resumed_from: u64,
}

/// File with verified content.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fetched {
    /// Path of the file.
    pub path: PathBuf,
    /// Size of the file, in bytes.
    pub bytes: u64,
    /// Origin of the file.
    pub origin: Origin,
}

/// Origin of a fetched file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The file existed with the right content; nothing was downloaded.
    AlreadyThere,
    /// The file was downloaded.
    Downloaded {
        /// Bytes that an earlier, interrupted attempt had left on disk.
        resumed_from: u64,
    },
}

/// Error of a download; every message is one line and suggests the next step.
#[derive(Debug, thiserror::Error)]
pub enum FetchError {
    /// The server did not answer: no network, unknown host, connection refused or certificate not trusted.
    #[error("cannot reach {url} ({reason}): download the file by hand from {page}")]
    Unreachable {
        /// Address of the file.
        url: String,
        /// Error of the connection.
        reason: String,
        /// Address of the web page that links to the file.
        page: String,
    },
    /// The server answered with an HTTP error.
    #[error("{url}: the server answered {status}: find the file on {page} and download it by hand")]
    Refused {
        /// Address of the file.
        url: String,
        /// HTTP status ("404 Not Found").
        status: String,
        /// Address of the web page that links to the file.
        page: String,
    },
    /// The connection was lost during the download.
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
        /// Size of the file in bytes, if the server named it.
        total_bytes: Option<u64>,
        /// Error of the connection.
        reason: String,
        /// File that keeps the bytes.
        part: PathBuf,
    },
    /// The downloaded content is not the published one.
    #[error(
        "{url}: expected content with git blob id {expected}, found {found} ({bytes} bytes); \
         removed it: run the same command again to start anew, or look at {page}"
    )]
    WrongContent {
        /// Address of the file.
        url: String,
        /// Checksum of the published file.
        expected: String,
        /// Checksum of the downloaded content.
        found: String,
        /// Size of the downloaded content, in bytes.
        bytes: u64,
        /// Address of the web page that links to the file.
        page: String,
    },
    /// Another file exists at the target path; it is not changed.
    #[error(
        "{}: expected git blob id {expected}, found another file with {found}: move it away or \
         choose another place",
        out.display()
    )]
    Occupied {
        /// Target path.
        out: PathBuf,
        /// Checksum of the published file.
        expected: String,
        /// Checksum of the existing file.
        found: String,
    },
    /// Another data set exists at the target path; it is not changed.
    #[error(
        "{}: expected {name} with SHA-256 {expected}, found another data set with {found}: move it away or choose another place",
        out.display()
    )]
    OtherSet {
        /// Target path.
        out: PathBuf,
        /// Name of the public set.
        name: String,
        /// SHA-256 of its content.
        expected: String,
        /// SHA-256 of the existing data set's content.
        found: String,
    },
    /// The files are the published ones, but their conversion gives another data set than before.
    #[error(
        "{name}: the files are the published ones, but their sweeps have SHA-256 {found}, expected {expected}: this build reads them \
         differently; please report it"
    )]
    OtherConversion {
        /// Name of the public set.
        name: String,
        /// SHA-256 of its content.
        expected: String,
        /// SHA-256 of the converted content.
        found: String,
    },
    /// Error of the disk: full, read-only or similar. The downloaded bytes are kept.
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

    /// Returns true if the caller can fix the error; false for network, server and disk, where the same call may succeed
    /// later.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Disk(error) => error.is_usage(),
            Self::Unreachable { .. }
            | Self::Refused { .. }
            | Self::Cut { .. }
            | Self::WrongContent { .. }
            | Self::OtherConversion { .. } => false,
            Self::Occupied { .. } | Self::OtherSet { .. } => true,
        }
    }
}

/// Downloads the published file to `out` unless it already exists.
///
/// The bytes are collected in `<out>.part`, which is renamed to `out` once its checksum is right. An interrupted download
/// is resumed. Missing folders are created. `progress` is called for the first byte and for every piece (at most 64 KiB).
///
/// # Errors
/// See [`FetchError`]. The part is kept if a later call can resume it, and removed if its content is wrong.
///
/// ```no_run
/// use std::path::Path;
///
/// use tactnet_data::{Source, fetch};
///
/// let file = fetch(&Source::tactmat(), Path::new("tactmat.h5"), &mut |progress| {
///     println!("{} bytes", progress.done_bytes);
/// })?;
/// println!("{}: {} bytes", file.path.display(), file.bytes);
/// # Ok::<(), tactnet_data::FetchError>(())
/// ```
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
