//! Archives of numpy arrays (`numpy.savez`, `numpy.savez_compressed`).
//!
//! | array | shape | holds |
//! |---|---|---|
//! | `samples`, or `X` | `[n][steps][taxels]`, `[n][steps][rows][cols]` or `[materials][sweeps][steps][rows][cols]` | digits, any integer or float type |
//! | `labels`, or `y`; not with five dimensions | `[n]` | the material's name or number, or its index into `materials` |
//! | `materials`; required only with five dimensions | `[materials]` | names or whole numbers |
//! | `blocks`, `test_flag`, optional | `[n]` or `[materials][sweeps]` | as in [`tactmat`](super::tactmat) |
//! | `lengths`, optional | `[n]` or `[materials][sweeps]` | number of frames of each sweep; the values after them are padding |
//! | `speed`, `force` (also with a unit: `speed [mm/s]`), optional | as `blocks` | conditions: numbers that the robot knows |
//! | `sample_rate_hz`, optional | a single number | frames per second; otherwise [`ASSUMED_RATE_HZ`](crate::ASSUMED_RATE_HZ) is assumed |
//! | `synthetic`, optional | a single number | version of the twin that generated the sweeps; 0 for recorded ones |
//!
//! Both byte orders and both index orders ("Fortran" too) are read. Pickled arrays are refused. `numpy.load` reads the
//! files of [`write()`] without pickle.

use std::borrow::Cow;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use super::DEFLATE_LIMIT;
use super::arrays::{Arrays, Container, Other, Roles};
use super::file_kind::{self, FileKind};
use super::named_sweeps::{Labels, NAMED, some_names};
use super::npy::{Array, Header};
use super::read_options::ReadOptions;
use crate::{DataError, Dataset};

pub use super::npz_write::write;

/// First bytes of the file of a single array.
pub(super) const NPY: &[u8] = b"\x93NUMPY";
/// Reads a data set whose values are all finite.
///
/// # Errors
/// A file that is not a zip archive; an array that is missing, pickled or of the wrong shape or type; a NaN or an
/// infinity, with its sweep.
pub fn read(path: &Path) -> Result<Dataset, DataError> {
    super::refuse_non_finite(path, read_with_gaps(path)?, true)
}

/// Reads a data set that may contain NaN or infinities, so that a check can list them.
///
/// # Errors
/// As [`read`], except for values that are not finite.
pub fn read_with_gaps(path: &Path) -> Result<Dataset, DataError> {
    let (dataset, _) = read_arrays(path, Labels::Needed, &ReadOptions::default())?;
    Ok(dataset)
}

/// Reads sweeps, and returns true if the file names their materials.
///
/// # Errors
/// As [`read_with_gaps`].
pub(super) fn read_arrays(
    path: &Path,
    labels: Labels,
    options: &ReadOptions,
) -> Result<(Dataset, bool), DataError> {
    arrays(path, options)?.into_sweeps(labels)
}

/// Reads an archive, or a single array, which then holds the sweeps.
fn arrays<'a>(path: &'a Path, options: &ReadOptions) -> Result<Arrays<'a>, DataError> {
    let io = |error| DataError::io(path, "read", error);
    if super::first_bytes(path)?.starts_with(NPY) {
        let mut arrays = Arrays::new(path, Container::Npz, Roles::own(&ReadOptions::default()));
        let file = crate::open_file(path).map_err(io)?;
        let room = file.metadata().map_err(io)?.len();
        let array = Array::read_samples(BufReader::new(file), room);
        arrays.insert("X".into(), array)?;
        return Ok(arrays);
    }
    let mut arrays = Arrays::new(path, Container::Npz, Roles::own(options));
    let file = crate::open_file(path).map_err(io)?;
    let mut archive = match zip::ZipArchive::new(BufReader::new(file)) {
        Ok(archive) => archive,
        Err(error) => return Err(no_archive(path, &error)?),
    };
    if let Some(found) = other_archive(&archive) {
        return Err(DataError::format(path, "file", super::READABLE, found));
    }
    for index in 0..archive.len() {
        let name = match archive.name_for_index(index) {
            Some(Ok(name)) => name.strip_suffix(".npy").unwrap_or(&name).to_owned(),
            _ => format!("member {index}"),
        };
        if arrays.is_known(&name) {
            let array = unpack(&mut archive, index, arrays.is_samples(&name));
            arrays.insert(name, array)?;
            continue;
        }
        let mut shape = None;
        if arrays.others() < NAMED
            && let Ok(mut member) = archive.by_index(index)
        {
            shape = Header::read(&mut member).ok().map(|header| header.shape);
        }
        arrays.add_other(Other {
            name,
            shape,
            type_name: None,
        });
    }
    Ok(arrays)
}

/// Returns the error for a file that is not a complete zip archive, with its actual kind.
///
/// # Errors
/// A file that cannot be read.
fn no_archive(path: &Path, error: &zip::result::ZipError) -> Result<DataError, DataError> {
    let found = match file_kind::of(path)? {
        FileKind::Npz => format!(
            "the beginning of one: the file is cut off or damaged ({error}); copy or download it again"
        ),
        FileKind::Hdf5 => "HDF5; name it .h5".into(),
        FileKind::Npy => "a single numpy array; name it .npy".into(),
        FileKind::Parquet => "Parquet; name it .parquet".into(),
        FileKind::Mcap => "a recording; name it .mcap".into(),
        FileKind::Matlab => "MATLAB; name it .mat".into(),
        FileKind::Pretended(found) => found.into(),
        FileKind::Other => {
            let head = super::first_bytes(path)?;
            format!("a file that begins with `{}`", head.escape_ascii())
        }
    };
    Ok(DataError::format(
        path,
        "file",
        "a zip archive of numpy arrays (.npz)",
        found,
    ))
}

/// Returns what a zip archive without a numpy array is, with the cure.
fn other_archive(archive: &zip::ZipArchive<BufReader<File>>) -> Option<String> {
    let names: Vec<Cow<'_, str>> = archive.file_names().filter_map(Result::ok).collect();
    let names: Vec<&str> = names.iter().map(Cow::as_ref).collect();
    if names.is_empty() || names.iter().any(|name| name.ends_with(".npy")) {
        return None;
    }
    if names.iter().any(|name| name.ends_with("data.pkl")) {
        return Some("a file of PyTorch; save its arrays with np.savez_compressed(\"sweeps.npz\", X=X.numpy(), y=y)".into());
    }
    Some(format!(
        "a zip archive with {}; unpack it with `unzip` and pass what is in it",
        some_names(names)
    ))
}

/// Reads a member of an archive, or returns a sentence about its error.
///
/// - `samples`: true if only the narrowed values are needed
fn unpack(
    archive: &mut zip::ZipArchive<BufReader<File>>,
    index: usize,
    samples: bool,
) -> Result<Array, String> {
    let member = archive.by_index(index).map_err(|error| error.to_string())?;
    let (size, packed) = (member.size(), member.compressed_size());
    let room = packed.saturating_mul(DEFLATE_LIMIT);
    if size > room {
        return Err(format!("{packed} bytes that unpack to {size}"));
    }
    if samples {
        Array::read_samples(member, room)
    } else {
        Array::read(member, room)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_no_archive_is_told_with_its_actual_kind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sweeps.npz");
        let read = |content: &[u8]| -> String {
            std::fs::write(&path, content).unwrap();
            read(&path).unwrap_err().to_string()
        };
        for (content, kind) in [
            (&b""[..], "an empty file"),
            (b"\x89HDF\r\n\x1a\n\0\0\0\0", "found HDF5; name it .h5"),
            (b"PK\x03\x04\x14\0\0\0", "cut off or damaged"),
            (b"PAR1abcd", "found Parquet"),
            (b"1,2,3\n", "begins with `1,2,3\\n`"),
        ] {
            let told = read(content);
            assert!(told.contains(kind), "{told}");
            assert!(
                told.contains("sweeps.npz: file: expected a zip archive"),
                "{told}"
            );
        }
    }
}
