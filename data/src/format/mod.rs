//! File formats of data sets, one module per format.
//!
//! ```
//! use tactnet_data::format::{self, Format};
//! use tactnet_data::twin;
//!
//! let dataset = twin::small(2, 2, 100)?;
//! let path = std::env::temp_dir().join(format!("tactnet-doc-{}.npz", std::process::id()));
//! Format::from_extension(&path)?.write(&path, &dataset)?;
//! let read = format::read(&path)?;
//! assert_eq!(read.sha256(), dataset.sha256());
//! std::fs::remove_file(&path).unwrap();
//! # Ok::<(), tactnet_data::DataError>(())
//! ```
//!
//! | format | extension | read | written | shape |
//! |---|---|---|---|---|
//! | [`tactmat`] (HDF5) | `.h5`, `.hdf5` | yes | yes | `[materials][sweeps][steps][rows][cols]` |
//! | HDF5 with other names and groups | `.h5`, `.hdf5` | yes | no | as npz; the options name samples and labels |
//! | [`npz`] (numpy) | `.npz` | yes | yes | the same, or `[sweeps][steps][rows][cols]` with labels |
//! | `mat` (MATLAB, version 5 and later) | `.mat` | yes | no | `[sweeps][steps][taxels]` or as npz, with labels |
//! | [`ts`] (aeon, sktime, UEA archive) | `.ts` | no | yes | one line a sweep, one dimension a taxel |
//! | `csv` (text tables) | `.csv` | yes | no | one row per frame |
//! | `folder` (files of sweeps) | a folder of `.csv` or `.npy` | yes | no | one file per sweep; folders, or a table of labels, name materials |
//! | `parquet`, with that feature | `.parquet` | yes | no | one row per frame; lists of numbers are taxels |
//! | `lerobot`, with the feature `parquet` | a folder with `meta/info.json` | yes | no | episodes as sweeps, tasks as materials |
//!
//! The first bytes identify a file of arrays, the extension a table, and the content a folder. The extension of the
//! output file decides the format that is written.

mod arrays;
mod chunk_grid;
mod chunks;
mod clock;
mod csv;
mod dialect;
mod file_kind;
mod file_layout;
mod folder;
mod frame_table;
mod guarded;
mod hdf5_arrays;
mod hdf5_episodes;
mod hdf5_values;
mod intervals;
mod lengths;
#[cfg(feature = "parquet")]
mod lerobot;
mod mat;
mod mismatch;
mod name_pattern;
mod named_sweeps;
mod narrow;
mod npy;
pub mod npz;
mod npz_write;
#[cfg(feature = "parquet")]
pub mod parquet;
#[cfg(feature = "parquet")]
mod parquet_footer;
mod pieces;
mod read_options;
mod recording;
mod resample;
mod resolution;
mod series;
mod split_folders;
mod stamp;
mod sweep_file;
pub mod tactmat;
mod tactmat_write;
mod taxel_names;
mod tile;
mod time_names;
mod time_stamps;
mod timing;
mod to_classify;
pub mod ts;
mod windows;

pub use file_layout::{Axes, FileLayout};
pub use folder::{data_sets_in, is_folder_of_sweeps};
pub use guarded::{caught, is_reading};
pub use lengths::{Keep, OddLength};
pub use name_pattern::NamePattern;
pub use read_options::ReadOptions;
pub use series::FrameSeries;
pub use windows::{Span, Windows};

use crate::{DataError, Dataset, Remedy, Samples};
use file_kind::FileKind;
use named_sweeps::Labels;
pub(crate) use named_sweeps::{NamedSweeps, UNLABELLED, records, some_names};
use std::io::Read;
use std::path::Path;
pub(crate) use timing::named_rate;

/// Maximum compression ratio of deflate; a file that claims more is damaged.
const DEFLATE_LIMIT: u64 = 1032;

/// True in a build that reads Parquet.
pub const READS_PARQUET: bool = cfg!(feature = "parquet");

/// File format that data sets can be written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// TactMat's HDF5 layout.
    TactMat,
    /// Archive of numpy arrays.
    Npz,
    /// The text format of aeon and the UEA archive.
    Ts,
}

impl Format {
    /// Returns the format of an extension: `.h5`, `.hdf5`, `.npz` or `.ts`.
    ///
    /// # Errors
    /// Another or no extension.
    ///
    /// ```
    /// use tactnet_data::format::Format;
    ///
    /// assert_eq!(Format::from_extension("sweeps.h5".as_ref())?, Format::TactMat);
    /// assert!(Format::from_extension("sweeps.mat".as_ref()).is_err());
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn from_extension(path: &Path) -> Result<Self, DataError> {
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        match extension.to_ascii_lowercase().as_str() {
            "h5" | "hdf5" => Ok(Self::TactMat),
            "npz" => Ok(Self::Npz),
            "ts" => Ok(Self::Ts),
            "" => Err(DataError::format(
                path,
                "file name",
                EXTENSIONS,
                "no extension",
            )),
            other => Err(DataError::format(
                path,
                "file name",
                EXTENSIONS,
                format!(".{other}"),
            )),
        }
    }

    /// Writes `dataset` to `path`; the file appears only when it is complete.
    ///
    /// # Errors
    /// A data set that does not fit the format, or a file that cannot be written.
    pub fn write(self, path: &Path, dataset: &Dataset) -> Result<(), DataError> {
        match self {
            Self::TactMat => tactmat::write(path, dataset),
            Self::Npz => npz::write(path, dataset),
            Self::Ts => ts::write(path, dataset),
        }
    }
}

pub use to_classify::{
    SweepsToClassify, read_to_classify, read_to_classify_with, read_to_classify_with_gaps,
};

/// Extensions of the formats that can be written, for messages.
const EXTENSIONS: &str = "the extension .h5, .hdf5, .npz or .ts";

/// Reads a file or folder of any format whose values are all finite.
///
/// # Errors
/// A file of another kind, or a file that its format refuses.
pub fn read(path: &Path) -> Result<Dataset, DataError> {
    read_with(path, &ReadOptions::default())
}

/// Reads a file or folder of any format; values may be NaN or infinite, so that a check can list them.
///
/// # Errors
/// As [`read`], except for values that are not finite.
pub fn read_with_gaps(path: &Path) -> Result<Dataset, DataError> {
    read_labelled(path, &ReadOptions::default())
}

/// Reads a file or folder of any format as [`read`], with options.
///
/// # Errors
/// As [`read`], and options that the file does not allow.
pub fn read_with(path: &Path, options: &ReadOptions) -> Result<Dataset, DataError> {
    refuse_non_finite(path, read_labelled(path, options)?, true)
}

fn read_labelled(path: &Path, options: &ReadOptions) -> Result<Dataset, DataError> {
    if let Some(sweeps) = table_with_gaps(path, options, Labels::Needed) {
        let sweeps = sweeps?;
        if sweeps.materials.is_none() {
            let error = DataError::format(path, "labels", "the material of each frame", "none");
            return Err(error.with_remedy(Remedy::NameLabels));
        }
        return sweeps.into_dataset().map_err(|error| in_file(path, error));
    }
    let (dataset, _) = read_arrays(path, Labels::Needed, options)?;
    options.apply_to(path, dataset)
}

/// Reads a table or folder; `None` for a file of another kind.
fn table_with_gaps(
    path: &Path,
    options: &ReadOptions,
    labels: Labels,
) -> Option<Result<NamedSweeps, DataError>> {
    if path.join("config.json").is_file() && path.join("split.json").is_file() {
        let found = "a run directory, which holds a classifier";
        return Some(Err(DataError::format(
            path,
            "folder",
            folder::LAYOUT,
            found,
        )));
    }
    #[cfg(feature = "parquet")]
    if lerobot::is_data_set(path) {
        return Some(lerobot::read_with_gaps(path, options));
    }
    if path.is_dir() {
        return Some(folder_with_gaps(path, options, labels));
    }
    if !path.exists() {
        return None;
    }
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    match file_kind::of(path) {
        Err(error) => Some(Err(error)),
        Ok(FileKind::Pretended(found)) => {
            Some(Err(DataError::format(path, "file", READABLE, found)))
        }
        Ok(FileKind::Hdf5) if hdf5_episodes::are_named(options) => {
            Some(hdf5_episodes::read_with_gaps(path, options))
        }
        #[cfg(feature = "parquet")]
        Ok(FileKind::Parquet) => {
            let table = options.refuse_arrays(path, "a table");
            Some(table.and_then(|()| parquet::read_with_gaps(path, options, labels)))
        }
        #[cfg(not(feature = "parquet"))]
        Ok(FileKind::Parquet) => Some(Err(DataError::format(
            path,
            "file",
            "a program built with Parquet (in a checkout of the source, `cargo install --path . --features parquet`), or .npz or .csv",
            "Parquet",
        ))),
        Ok(FileKind::Other) if TABLES.iter().any(|table| extension == *table) => {
            let table = options.refuse_arrays(path, "a table");
            Some(table.and_then(|()| csv::read_with_gaps(path, options, labels)))
        }
        Ok(_) => None,
    }
}

/// Reads a folder of sweeps.
fn folder_with_gaps(
    path: &Path,
    options: &ReadOptions,
    labels: Labels,
) -> Result<NamedSweeps, DataError> {
    options.refuse_arrays(path, "a folder")?;
    if let Some(names) = &options.layout.names {
        return folder::read_named(path, names, options);
    }
    if folder::is_folder_of_sweeps(path) {
        return folder::read_with_gaps(path, options);
    }
    if (labels == Labels::Optional || options.windows.is_some())
        && let Some(sweeps) = folder::read_flat_folder(path, options)?
    {
        return Ok(sweeps);
    }
    let found = match (folder::holds_arrays(path), folder::data_set_in(path)) {
        (true, _) => {
            "arrays (.npy) without materials; sort them into one folder per material, or stack them into one file: np.savez_compressed(\"sweeps.npz\", X=X, y=y) with X [n][steps][taxels] and y [n]".to_owned()
        }
        (false, Some(file)) => {
            format!("{}, which is a complete data set: pass that file", file.display())
        }
        (false, None) => folder::nested_sweep(path).unwrap_or_else(|| "neither".to_owned()),
    };
    Err(DataError::format(path, "folder", folder::LAYOUT, found))
}

/// Extensions of text tables.
const TABLES: [&str; 5] = ["csv", "tsv", "txt", "dat", "asc"];
/// Files that are read, for messages.
const READABLE: &str =
    "HDF5 (.h5), numpy (.npz), MATLAB (.mat), tables (.csv, .parquet) or a folder of .csv or .npy";

/// First bytes of MCAP files.
const MCAP: &[u8] = b"\x89MCAP";

/// Reads HDF5 or npz, identified by the first bytes; also returns true if the file names the materials.
fn read_arrays(
    path: &Path,
    labels: Labels,
    options: &ReadOptions,
) -> Result<(Dataset, bool), DataError> {
    let kind = file_kind::of(path)?;
    let found = match kind {
        FileKind::Npz => return npz::read_arrays(path, labels, options),
        FileKind::Npy if labels == Labels::Optional => {
            return npz::read_arrays(path, labels, options);
        }
        FileKind::Hdf5 => return hdf5_arrays::read_arrays(path, labels, options),
        FileKind::Npy => {
            "a single numpy array; save it with its labels: np.savez_compressed(\"sweeps.npz\", X=X, y=y)"
        }
        FileKind::Mcap => "a recording",
        FileKind::Matlab => return mat::read_arrays(path, labels, options),
        FileKind::Parquet => "Parquet",
        FileKind::Pretended(found) => found,
        FileKind::Other
            if path
                .extension()
                .is_some_and(|of| of.eq_ignore_ascii_case("mat")) =>
        {
            let found = "a MATLAB file of version 4, or no MATLAB file; `save(FILE, \"-v7\")` writes one that is read";
            return Err(DataError::format(path, "file", READABLE, found));
        }
        FileKind::Other => "a file of another kind",
    };
    let error = match kind {
        FileKind::Other => {
            let head = first_bytes(path)?;
            let found = format!("a file that begins with `{}`", head.escape_ascii());
            DataError::format(path, "file", READABLE, found)
        }
        _ => DataError::format(path, "file", READABLE, found),
    };
    Err(match kind {
        FileKind::Mcap => error.with_remedy(Remedy::ConvertRecording),
        _ => error,
    })
}

/// Returns the first eight bytes of a file, or fewer if it is shorter.
fn first_bytes(path: &Path) -> Result<Vec<u8>, DataError> {
    let mut head = Vec::new();
    let file = crate::open_file(path).map_err(|error| DataError::io(path, "open", error))?;
    file.take(8)
        .read_to_end(&mut head)
        .map_err(|error| DataError::io(path, "read", error))?;
    Ok(head)
}

/// Returns an error if `dataset` has a NaN or an infinity.
fn refuse_non_finite(path: &Path, dataset: Dataset, labelled: bool) -> Result<Dataset, DataError> {
    let Samples::F32(values) = dataset.samples() else {
        return Ok(dataset);
    };
    let Some(first) = values.iter().position(|value| !value.is_finite()) else {
        return Ok(dataset);
    };
    let count = values[first..]
        .iter()
        .filter(|value| !value.is_finite())
        .count();
    let shape = dataset.shape();
    let (sweep, rest) = (first / shape.values(), first % shape.values());
    let (step, taxel) = (rest / shape.taxels(), rest % shape.taxels());
    let found = format!(
        "{count} that are not, the first {} in {} at step {step}, taxel ({}, {})",
        values[first],
        dataset.describe(sweep),
        taxel / shape.cols,
        taxel % shape.cols,
    );
    let error = DataError::format(path, "sweeps", "finite numbers", found);
    let data = path.display().to_string();
    Err(match labelled {
        true => error.with_remedy(Remedy::ListFindings { data }),
        false => error,
    })
}

/// Returns the indices of the sweeps, sorted by material and number.
fn by_material(dataset: &Dataset) -> Result<Vec<usize>, DataError> {
    let counts = dataset.sweeps_per_label();
    if let Some(odd) = counts.iter().position(|&count| count != counts[0]) {
        return Err(DataError::inconsistent(
            "data set `samples`",
            format!(
                "as many sweeps of every material as of `{}`, {} (.npz holds any number)",
                dataset.labels().name(0),
                counts[0]
            ),
            format!("{} of `{}`", counts[odd], dataset.labels().name(odd)),
        ));
    }
    let mut order: Vec<usize> = (0..dataset.len()).collect();
    order.sort_by_key(|&index| {
        let record = &dataset.records()[index];
        (record.label, record.sweep)
    });
    Ok(order)
}

/// Adds the file to an error of the data set.
fn in_file(path: &Path, error: DataError) -> DataError {
    match error {
        DataError::Inconsistent {
            item,
            expected,
            found,
            remedy,
        } => {
            let item = match item.as_str() {
                "samples" | "materials" | "blocks" | "test_flag" => format!("data set `{item}`"),
                _ => item,
            };
            DataError::Format {
                path: path.into(),
                item,
                expected,
                found,
                remedy,
            }
        }
        other => other,
    }
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}
