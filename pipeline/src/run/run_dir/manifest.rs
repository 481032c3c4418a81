//! `manifest.json`: SHA-256 of every file that a run's results depend on, written last. It detects corruption, not tampering.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use tactnet_data::{read_file, sha256_hex};

use super::RunDir;
use crate::PipelineError;

pub(super) const MANIFEST: &str = "manifest.json";
/// Files left out of the manifest, since no result depends on them after the run has ended. Hidden files are left out, too.
const LEFT_OUT: [&str; 2] = [MANIFEST, "checkpoint.safetensors"];

/// Digests of the files of a finished run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    /// Version of this layout.
    schema_version: u32,
    /// SHA-256 in hexadecimal digits, by file name.
    files: BTreeMap<String, String>,
}

impl Manifest {
    const SCHEMA_VERSION: u32 = 1;

    /// Returns the digests of the files of a folder.
    fn of(folder: &Path) -> std::io::Result<Self> {
        let mut files = BTreeMap::new();
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().into_owned();
            let rests = !name.starts_with('.') && !LEFT_OUT.contains(&name.as_str());
            if rests && entry.file_type()?.is_file() {
                files.insert(name, sha256_hex(fs::read(entry.path())?));
            }
        }
        Ok(Self {
            schema_version: Self::SCHEMA_VERSION,
            files,
        })
    }
}

impl RunDir {
    /// Writes the digests of all files. This is the last write to a run.
    ///
    /// # Errors
    /// A file that cannot be read or written.
    pub fn write_manifest(&self) -> Result<(), PipelineError> {
        let manifest = Manifest::of(self.path())
            .map_err(|error| PipelineError::io(self.path(), "read", error))?;
        self.write_json(MANIFEST, &manifest)
    }

    /// Returns the content of a file, checked against the manifest. Runs of earlier versions have no manifest.
    ///
    /// # Errors
    /// A missing file; a digest that differs from the manifest's; a manifest that cannot be read.
    pub(super) fn read(&self, name: &str) -> Result<Vec<u8>, PipelineError> {
        let path = self.file(name);
        let bytes = read_file(&path).map_err(|error| PipelineError::io(&path, "read", error))?;
        let known = self
            .manifest()?
            .and_then(|manifest| manifest.files.get(name));
        match known {
            Some(digest) if *digest != sha256_hex(&bytes) => Err(PipelineError::run(
                path,
                format!(
                    "the file has changed since the run ended (its SHA-256 differs from that in {MANIFEST}): it is damaged or was edited"
                ),
            )),
            _ => Ok(bytes),
        }
    }

    fn manifest(&self) -> Result<Option<&Manifest>, PipelineError> {
        if let Some(known) = self.manifest.get() {
            return Ok(known.as_ref());
        }
        let path = self.file(MANIFEST);
        let failed = |reason: String| PipelineError::run(path.clone(), reason);
        let read = match read_file(&path) {
            Ok(bytes) => {
                let manifest: Manifest =
                    serde_json::from_slice(&bytes).map_err(|error| failed(error.to_string()))?;
                if manifest.schema_version != Manifest::SCHEMA_VERSION {
                    return Err(failed(format!(
                        "expected schema version {}, found {}",
                        Manifest::SCHEMA_VERSION,
                        manifest.schema_version
                    )));
                }
                Some(manifest)
            }
            // The run has not ended, or an earlier version wrote it.
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(PipelineError::io(&path, "read", error)),
        };
        Ok(self.manifest.get_or_init(|| read).as_ref())
    }
}
