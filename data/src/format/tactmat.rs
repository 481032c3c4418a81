//! TactMat's HDF5 layout, with any dimensions.
//!
//! | name | shape | holds |
//! |---|---|---|
//! | `samples` | `[materials][sweeps][steps][rows][cols]` | digits, any integer or float type |
//! | `materials` (also `maerials`, a typo of the published page) | `[materials]` | names, fixed or variable length, or whole numbers |
//! | `blocks`, optional | `[materials][sweeps]` | number of the recording block |
//! | `test_flag`, optional | `[materials][sweeps]` | 1 or true for the author's test sweeps |
//! | `lengths`, optional | `[materials][sweeps]` | number of frames of each sweep; the values after them are padding |
//! | `speed`, `force`, optional | `[materials][sweeps]` | conditions, numbers that the robot knows; attribute `unit` |
//! | attribute `sample_rate_hz`, optional | scalar, on the file or on `samples` | frames per second |
//! | attribute `synthetic`, optional | scalar, on the file | version of the twin that generated the sweeps; 0 for recorded ones |
//!
//! Without the attribute [`ASSUMED_RATE_HZ`](crate::ASSUMED_RATE_HZ) is assumed, the rate of TactMat's sensor. Values are
//! stored in the smallest of `u8`, `u16` and `f32` that keeps them; an `f64` is rounded to the nearest `f32`.
//!
//! Source of the layout: the page of the DLR TactMat data set and Tulbure and Bäuml, Humanoids 2018.

pub use super::tactmat_write::write;

use super::DEFLATE_LIMIT;
use super::arrays::LENGTHS;
use super::chunk_grid::RANK;
use super::chunks::{read_samples, some_sweeps};
use super::guarded::guarded;
use super::hdf5_values::{self, matlab_class};
use super::mismatch::{Mismatch, type_name};
use super::narrow::HELD;
use crate::twin::TwinVersion;
use crate::{
    Condition, ConditionValues, DataError, Dataset, LabelSet, Quantity, Samples, SweepRecord,
    SweepShape,
};
use hdf5_reader::error::Error;
use hdf5_reader::{Datatype, Hdf5File, OpenOptions};
use std::path::Path;

/// Name of the attribute that is not zero if the sweeps were generated instead of recorded.
pub(super) const SYNTHETIC_ATTRIBUTE: &str = "synthetic";
/// Name of the attribute with the sample rate, in Hz.
pub(super) const RATE_ATTRIBUTE: &str = "sample_rate_hz";

/// Reads a data set whose values are all finite.
///
/// # Errors
/// A file that cannot be opened, is not HDF5 or is truncated; a data set that is missing or of the wrong shape or type;
/// an unsupported filter (LZF, Blosc, ...); a NaN or an infinity, with its sweep.
pub fn read(path: &Path) -> Result<Dataset, DataError> {
    super::refuse_non_finite(path, read_with_gaps(path)?, true)
}

/// Reads a data set that may contain NaN or infinities, so that a check can list them.
///
/// # Errors
/// As [`read`], except for values that are not finite.
pub fn read_with_gaps(path: &Path) -> Result<Dataset, DataError> {
    guarded(path, "HDF5", || read_file(&open(path)?, path))
}

/// Returns true if the file has a data set `samples`, readable or not, that MATLAB did not write.
pub(super) fn is_layout(file: &Hdf5File) -> bool {
    match file.dataset("samples").map_err(root) {
        Ok(samples) => matlab_class(&samples).is_none(),
        Err(Error::DatasetNotFound(_)) => false,
        Err(_) => true,
    }
}

/// Reads an open file, see [`read_with_gaps`].
pub(super) fn read_file(file: &Hdf5File, path: &Path) -> Result<Dataset, DataError> {
    let samples = required(file, path, &["samples"])?;
    let item = "data set `samples`";
    let shape = shape_of(path, item, samples.shape())?;
    let [materials, sweeps, steps, rows, cols] = shape;
    let labels = material_names(file, path, materials)?;
    let blocks = per_sweep(file, path, "blocks", [materials, sweeps], u32::try_from)?;
    let flags = per_sweep(
        file,
        path,
        "test_flag",
        [materials, sweeps],
        |flag| match flag {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(()),
        },
    )?;
    let lengths = per_sweep(file, path, LENGTHS, [materials, sweeps], usize::try_from)?;
    let rate = sample_rate_hz(file, &samples, path)?;
    let mismatch = |m: Mismatch| DataError::format(path, item, m.expected, m.found);
    let values = read_samples(file, &samples, shape);
    let sweep_shape = SweepShape { steps, rows, cols };
    let may_lose = match &values {
        Ok(values) => matches!(values, Samples::F32(_)),
        Err(mismatch) => mismatch.expected == HELD,
    };
    if may_lose && let Some(some) = some_sweeps(&samples, shape).map_err(mismatch)? {
        some.check(path, sweep_shape)?;
    }
    let values = values.map_err(mismatch)?;
    let records = (0..materials * sweeps)
        .map(|index| SweepRecord {
            label: index / sweeps,
            sweep: index % sweeps,
            block: blocks.as_ref().map(|b| b[index]),
            test: flags.as_ref().map(|f| f[index]),
        })
        .collect();
    let name = super::stem(path);
    let dataset = Dataset::at_rate(name, rate, sweep_shape, labels, records, values)
        .and_then(|dataset| dataset.with_known_lengths(lengths))
        .map_err(|error| super::in_file(path, error))?;
    let dataset = match twin_version(file) {
        Some(version) => dataset.into_twin(version),
        None => dataset,
    };
    let conditions = conditions(file, path, [materials, sweeps])?;
    dataset
        .with_conditions(&conditions)
        .map_err(|error| super::in_file(path, error))
}

/// Returns the conditions of the file.
fn conditions(
    file: &Hdf5File,
    path: &Path,
    shape: [usize; 2],
) -> Result<Vec<ConditionValues>, DataError> {
    let mut found = Vec::new();
    for quantity in Quantity::ALL {
        let Some(dataset) = optional(file, path, &[quantity.name()])? else {
            continue;
        };
        let array = hdf5_values::read(file, &dataset).ok();
        let numbers = array.filter(|array| array.shape == shape);
        let numbers = numbers.and_then(|array| array.floats());
        let is_finite = |value: &f64| (*value as f32).is_finite();
        if let Some(numbers) = numbers.filter(|all| all.iter().all(is_finite)) {
            found.push(ConditionValues {
                condition: Condition {
                    quantity,
                    unit: hdf5_values::unit(&dataset),
                },
                values: numbers.into_iter().map(|value| value as f32).collect(),
            });
        }
    }
    Ok(found)
}

/// Returns the extents of the data set `samples`.
fn shape_of(path: &Path, item: &str, extents: &[u64]) -> Result<[usize; RANK], DataError> {
    let Ok(shape) = <[u64; RANK]>::try_from(extents) else {
        return Err(DataError::format(
            path,
            item,
            "5 dimensions [materials][sweeps][steps][rows][cols]",
            format!("{} dimensions {extents:?}", extents.len()),
        ));
    };
    let shape = shape.map(|extent| usize::try_from(extent).unwrap_or(usize::MAX));
    match shape.contains(&0) {
        false => Ok(shape),
        true => Err(DataError::format(
            path,
            item,
            "no dimension of length 0",
            format!("{shape:?}"),
        )),
    }
}

/// Returns the version of the twin that generated the sweeps, if the file is marked.
fn twin_version(file: &Hdf5File) -> Option<TwinVersion> {
    let mark = file
        .root_group()
        .and_then(|group| group.attribute(SYNTHETIC_ATTRIBUTE))
        .and_then(|mark| mark.read_as_f64())
        .ok()?;
    TwinVersion::of_mark(mark)
}

pub(super) fn open(path: &Path) -> Result<Hdf5File, DataError> {
    let item = "HDF5 file with data set `samples`";
    let length = std::fs::metadata(path)
        .map_err(|e| DataError::io(path, "open", e))?
        .len();
    let room = usize::try_from(length.saturating_mul(DEFLATE_LIMIT)).unwrap_or(usize::MAX);
    let options = OpenOptions::default()
        .with_chunk_cache_bytes(0)
        .with_max_read_bytes(room);
    let file = Hdf5File::open_with_options(path, options).map_err(|error| match root(error) {
        Error::Io(source) => DataError::io(path, "read", source),
        Error::InvalidMagic => {
            let head = crate::read_file(path).unwrap_or_default();
            DataError::format(
                path,
                item,
                "the signature of HDF5",
                format!("{} other bytes", head.len()),
            )
        }
        other => DataError::format(path, item, "readable HDF5", other.to_string()),
    })?;
    // The end of the file is an absolute address, but the storage begins behind a user block.
    let promised = file.superblock().eof_address;
    let found = length;
    if found < promised {
        return Err(DataError::format(
            path,
            item,
            format!("{promised} bytes, as its header says"),
            format!("{found} bytes: the file is cut short"),
        ));
    }
    Ok(file)
}

fn root(error: Error) -> Error {
    match error {
        Error::Context { source, .. } => root(*source),
        other => other,
    }
}

/// Returns the data set that has one of `names`, if there is one.
fn optional(
    file: &Hdf5File,
    path: &Path,
    names: &[&str],
) -> Result<Option<hdf5_reader::Dataset>, DataError> {
    for name in names {
        match file.dataset(name) {
            Ok(dataset) => return Ok(Some(dataset)),
            Err(error) => match root(error) {
                Error::DatasetNotFound(_) => {}
                other => {
                    let m = Mismatch::from_hdf5(&other);
                    let item = format!("data set `{name}`");
                    return Err(DataError::format(path, item, m.expected, m.found));
                }
            },
        }
    }
    Ok(None)
}

fn required(
    file: &Hdf5File,
    path: &Path,
    names: &[&str],
) -> Result<hdf5_reader::Dataset, DataError> {
    optional(file, path, names)?.ok_or_else(|| {
        let there = file.root_group().and_then(|group| group.member_names());
        let found = match there {
            Ok((_, datasets)) if datasets.is_empty() => "no data set".to_owned(),
            Ok((_, datasets)) => format!("only `{}`", datasets.join("`, `")),
            Err(error) => error.to_string(),
        };
        let item = format!("data set `{}`", names[0]);
        DataError::format(path, item, "to be in the file", found)
    })
}

fn material_names(file: &Hdf5File, path: &Path, count: usize) -> Result<LabelSet, DataError> {
    let dataset = required(file, path, &["materials", "maerials"])?;
    let item = "data set `materials`";
    if dataset.shape() != [count as u64] {
        return Err(DataError::format(
            path,
            item,
            format!("{count} names, one per material of `samples`"),
            match dataset.shape() {
                [found] => format!("{found} names"),
                shape => format!("shape {shape:?}"),
            },
        ));
    }
    let names = match dataset.read_strings() {
        Ok(names) => names,
        Err(error) => {
            let numbers = dataset.read_native_bytes().ok();
            let numbers = numbers.and_then(|bytes| whole_numbers(&bytes, dataset.dtype()));
            match (numbers, root(error)) {
                (Some(numbers), _) => numbers.iter().map(i64::to_string).collect(),
                (None, Error::TypeMismatch { .. }) => {
                    let found = type_name(dataset.dtype());
                    return Err(DataError::format(
                        path,
                        item,
                        "names or whole numbers",
                        found,
                    ));
                }
                (None, other) => {
                    return Err(DataError::format(
                        path,
                        item,
                        "names or whole numbers",
                        other.to_string(),
                    ));
                }
            }
        }
    };
    LabelSet::new(names.iter().map(|name| name.trim_end_matches(['\0', ' '])))
        .map_err(|error| super::in_file(path, error))
}

/// Returns the whole numbers or Booleans of an optional `[materials][sweeps]` data set.
fn per_sweep<T, E>(
    file: &Hdf5File,
    path: &Path,
    name: &str,
    shape: [usize; 2],
    accept: impl Fn(i64) -> Result<T, E>,
) -> Result<Option<Vec<T>>, DataError> {
    let Some(dataset) = optional(file, path, &[name])? else {
        return Ok(None);
    };
    let item = format!("data set `{name}`");
    if dataset.shape() != shape.map(|extent| extent as u64) {
        return Err(DataError::format(
            path,
            item,
            format!("shape {shape:?}, materials by sweeps"),
            format!("shape {:?}", dataset.shape()),
        ));
    }
    let bytes = dataset.read_native_bytes().map_err(|error| {
        let m = Mismatch::from_hdf5(&error);
        DataError::format(path, item.as_str(), m.expected, m.found)
    })?;
    let Some(numbers) = whole_numbers(&bytes, dataset.dtype()) else {
        let found = type_name(dataset.dtype());
        return Err(DataError::format(path, item, "integers or booleans", found));
    };
    let mut values = Vec::with_capacity(numbers.len());
    for number in numbers {
        match accept(number) {
            Ok(value) => values.push(value),
            Err(_) => {
                let expected = match name {
                    "blocks" => "numbers of 32 bits from 0",
                    LENGTHS => "numbers of frames",
                    _ => "0 or 1",
                };
                return Err(DataError::format(path, item, expected, number.to_string()));
            }
        }
    }
    Ok(Some(values))
}

/// Returns native-endian integers of up to 64 bits as `i64`; `None` for another type.
fn whole_numbers(bytes: &[u8], datatype: &Datatype) -> Option<Vec<i64>> {
    macro_rules! each {
        ($type:ty) => {{
            let (numbers, _) = bytes.as_chunks();
            numbers
                .iter()
                .map(|&b| i64::try_from(<$type>::from_ne_bytes(b)).unwrap_or(i64::MAX))
                .collect()
        }};
    }
    Some(match datatype {
        Datatype::Enum { base, .. } => return whole_numbers(bytes, base),
        Datatype::FixedPoint {
            size: 1,
            signed: false,
            ..
        } => each!(u8),
        Datatype::FixedPoint {
            size: 1,
            signed: true,
            ..
        } => each!(i8),
        Datatype::FixedPoint {
            size: 2,
            signed: false,
            ..
        } => each!(u16),
        Datatype::FixedPoint {
            size: 2,
            signed: true,
            ..
        } => each!(i16),
        Datatype::FixedPoint {
            size: 4,
            signed: false,
            ..
        } => each!(u32),
        Datatype::FixedPoint {
            size: 4,
            signed: true,
            ..
        } => each!(i32),
        Datatype::FixedPoint {
            size: 8,
            signed: false,
            ..
        } => each!(u64),
        Datatype::FixedPoint {
            size: 8,
            signed: true,
            ..
        } => each!(i64),
        _ => return None,
    })
}

fn sample_rate_hz(
    file: &Hdf5File,
    samples: &hdf5_reader::Dataset,
    path: &Path,
) -> Result<Option<f64>, DataError> {
    let name = RATE_ATTRIBUTE;
    let at_root = file.root_group().and_then(|group| group.attribute(name));
    let attribute = match at_root.or_else(|_| samples.attribute(name)) {
        Ok(attribute) => attribute,
        Err(error) => match root(error) {
            Error::AttributeNotFound(_) => return Ok(None),
            other => {
                let item = format!("attribute `{name}`");
                return Err(DataError::format(
                    path,
                    item,
                    "a number of Hz",
                    other.to_string(),
                ));
            }
        },
    };
    let rate = attribute.read_as_f64();
    match rate {
        Ok(rate) if rate.is_finite() && rate > 0.0 => Ok(Some(rate)),
        other => {
            let found = other.map_or_else(|error| error.to_string(), |rate| rate.to_string());
            let item = format!("attribute `{name}`");
            Err(DataError::format(
                path,
                item,
                "a positive number of Hz",
                found,
            ))
        }
    }
}
