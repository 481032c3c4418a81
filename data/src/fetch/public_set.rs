//! Public data sets of other labs: files of a pinned commit, verified one by one, then converted into a data set of sweeps.
//!
//! ```text
//! GitHub ── git blob id ──> .NAME-source/COMMIT/… ── layout ──> Dataset ── SHA-256 ──> OUT
//! ```

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use ureq::Agent;

use super::transfer::Patience;
use super::{FetchError, Progress, Source, fetch_with};
use crate::format::{self, FileLayout, Format, ReadOptions, Span, Windows};
use crate::{DataError, Dataset};

/// The table of all sets.
const TABLE: &str = include_str!("public_sets.toml");

/// Public data set of another lab.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublicSet {
    /// Name.
    pub name: String,
    /// One-line description.
    pub title: String,
    /// Owner and name of the repository on GitHub.
    pub repository: String,
    /// Full hash of the commit.
    pub commit: String,
    /// Licence in the owner's words; absent if the owner states none.
    pub licence: Option<String>,
    /// Publication to cite.
    pub citation: String,
    /// Sensor and its taxels.
    pub sensor: String,
    /// Groups that can be held out; absent if none are known.
    pub groups: Option<String>,
    /// Properties to know before using results.
    pub caveats: String,
    /// SHA-256 of the converted data set's content.
    pub sha256: String,
    /// Git blob id and path of each file, one a line.
    #[serde(skip_serializing)]
    files: String,
    #[serde(skip_serializing)]
    layout: Layout,
}

/// The way from the files to sweeps; the fields are those of [`ReadOptions`] and [`FileLayout`].
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Layout {
    /// Zip archive that is unpacked first.
    unpack: Option<String>,
    /// File or folder that is read.
    read: String,
    rate_hz: Option<f64>,
    #[serde(default)]
    columns: Vec<String>,
    /// Number of frames of a window that is cut from continuous recordings.
    window: Option<usize>,
    names: Option<String>,
    axes: Option<String>,
    lines_per_frame: Option<usize>,
    stretch: Option<usize>,
    /// Rows and columns of taxels.
    shape: Option<[usize; 2]>,
}

/// Progress of the download of a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SetProgress {
    /// Number of the file, from 1.
    pub file: usize,
    /// Number of all files.
    pub files: usize,
    /// Progress of the file.
    pub of_file: Progress,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    set: Vec<PublicSet>,
}

impl PublicSet {
    /// Returns all sets.
    ///
    /// ```
    /// use tactnet_data::PublicSet;
    ///
    /// let names: Vec<String> = PublicSet::all().into_iter().map(|set| set.name).collect();
    /// assert!(names.contains(&"walking-terrain".into()));
    /// ```
    pub fn all() -> Vec<Self> {
        let table: Table =
            toml::from_str(TABLE).unwrap_or_else(|error| panic!("the table is valid: {error}"));
        table.set
    }

    /// Returns the set with this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|set| set.name == name)
    }

    /// Returns the address of the folder that holds the files.
    pub fn address(&self) -> String {
        format!(
            "https://raw.githubusercontent.com/{}/{}",
            self.repository, self.commit
        )
    }

    /// Returns the address of the web page of the commit.
    pub fn page(&self) -> String {
        format!(
            "https://github.com/{}/tree/{}",
            self.repository, self.commit
        )
    }

    /// Downloads the files, verifies each of them, and writes the converted data set to `out`, unless `out` already holds it.
    ///
    /// An interrupted download is resumed by the next call: files wait in a hidden folder next to `out` until the data set is written.
    ///
    /// - `address`: folder of the files on a mirror; `None` for GitHub
    /// - `out`: file whose extension decides the format
    ///
    /// # Errors
    /// See [`FetchError`]; files that do not give the data set of the table.
    pub fn fetch(
        &self,
        address: Option<&str>,
        out: &Path,
        progress: &mut dyn FnMut(SetProgress),
    ) -> Result<Dataset, FetchError> {
        let agent = Patience::default().config().build().new_agent();
        self.fetch_with(&agent, address, out, progress)
    }

    pub(super) fn fetch_with(
        &self,
        agent: &Agent,
        address: Option<&str>,
        out: &Path,
        progress: &mut dyn FnMut(SetProgress),
    ) -> Result<Dataset, FetchError> {
        let format = Format::from_extension(out)?;
        if out.exists() {
            return self.recognise(out);
        }
        let source = out.with_file_name(format!(".{}-source", self.name));
        let folder = source.join(&self.commit);
        let address = address.map_or_else(|| self.address(), String::from);
        let files: Vec<(&str, &str)> = self.blobs().collect();
        for (number, (git_blob_id, path)) in files.iter().enumerate() {
            let file = Source {
                url: format!("{}/{path}", address.trim_end_matches('/')),
                page: self.page(),
                git_blob_id: (*git_blob_id).into(),
            };
            fetch_with(agent, &file, &folder.join(path), &mut |of_file| {
                progress(SetProgress {
                    file: number + 1,
                    files: files.len(),
                    of_file,
                });
            })?;
        }
        let dataset = self.converted(&folder)?;
        if dataset.sha256() != self.sha256 {
            return Err(FetchError::OtherConversion {
                name: self.name.clone(),
                expected: self.sha256.clone(),
                found: dataset.sha256().into(),
            });
        }
        format.write(out, &dataset)?;
        fs::remove_dir_all(&source).map_err(|error| DataError::io(&source, "remove", error))?;
        Ok(dataset)
    }

    /// Returns git blob id and path of each file.
    pub(super) fn blobs(&self) -> impl Iterator<Item = (&str, &str)> {
        let lines = self.files.lines().map(str::trim);
        lines.filter_map(|line| line.split_once(' '))
    }

    /// Returns the data set in `out` if it is this one.
    fn recognise(&self, out: &Path) -> Result<Dataset, FetchError> {
        let found = format::read(out)?;
        if found.sha256() == self.sha256 {
            return Ok(found);
        }
        Err(FetchError::OtherSet {
            out: out.into(),
            name: self.name.clone(),
            expected: self.sha256.clone(),
            found: found.sha256().into(),
        })
    }

    /// Returns the sweeps of the owner's files.
    fn converted(&self, folder: &Path) -> Result<Dataset, DataError> {
        let layout = &self.layout;
        if let Some(archive) = &layout.unpack {
            unpack(&folder.join(archive), folder)?;
        }
        let dataset = format::read_with(&folder.join(&layout.read), &layout.options()?)?;
        match layout.shape {
            Some([rows, cols]) => dataset.with_patch(rows, cols),
            None => Ok(dataset),
        }
    }
}

impl Layout {
    fn options(&self) -> Result<ReadOptions, DataError> {
        let windows = self.window.map(|steps| Windows::of(Span::Steps(steps)));
        Ok(ReadOptions {
            rate_hz: self.rate_hz,
            columns: self.columns.clone(),
            windows,
            layout: FileLayout {
                names: self.names.as_deref().map(str::parse).transpose()?,
                axes: self.axes.as_deref().map(str::parse).transpose()?,
                lines_per_frame: self.lines_per_frame,
                stretch: self.stretch,
                drop_materials: Vec::new(),
            },
            ..ReadOptions::default()
        })
    }
}

/// Unpacks a verified zip archive into a folder.
fn unpack(archive: &Path, folder: &Path) -> Result<(), DataError> {
    let io = |path: &Path, error| DataError::io(path, "unpack", error);
    let file = File::open(archive).map_err(|error| io(archive, error))?;
    let damaged = |error: zip::result::ZipError| {
        DataError::format(archive, "archive", "a zip archive", error.to_string())
    };
    let mut zip = zip::ZipArchive::new(file).map_err(damaged)?;
    for index in 0..zip.len() {
        let mut entry = zip.by_index(index).map_err(damaged)?;
        // Names that leave the folder are skipped.
        let Some(name) = entry.enclosed_name().filter(|_| entry.is_file()) else {
            continue;
        };
        let path: PathBuf = folder.join(name);
        let parent = path.parent().unwrap_or(folder);
        fs::create_dir_all(parent).map_err(|error| io(parent, error))?;
        let mut out = File::create(&path).map_err(|error| io(&path, error))?;
        std::io::copy(&mut entry, &mut out).map_err(|error| io(&path, error))?;
    }
    Ok(())
}
