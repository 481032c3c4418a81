//! Archives of numpy arrays (`numpy.savez`, `numpy.savez_compressed`).
//!
//! | array | shape | holds |
//! |---|---|---|
//! | `samples`, or `X` | `[n][steps][taxels]`, `[n][steps][rows][cols]` or `[materials][sweeps][steps][rows][cols]` | digits, any integer or float type |
//! | `labels`, or `y`; not with five dimensions | `[n]` | the material's name or number, or its index into `materials` |
//! | `materials`; required only with five dimensions | `[materials]` | names or whole numbers |
//! | `blocks`, `test_flag`, optional | `[n]` or `[materials][sweeps]` | as in [`tactmat`](super::tactmat) |
//! | `sample_rate_hz`, optional | a single number | frames per second; otherwise [`ASSUMED_RATE_HZ`](crate::ASSUMED_RATE_HZ) is assumed |
//! | `synthetic`, optional | a single number | version of the twin that generated the sweeps; 0 for recorded ones |
//!
//! Both byte orders and both index orders ("Fortran" too) are read. Pickled arrays are refused. `numpy.load` reads the
//! files of [`write()`] without pickle.

mod arrays;

use super::named_sweeps::{Labels, UNLABELLED, records};
use super::narrow::HELD;
use super::npy::Array;
use super::tactmat::SYNTHETIC_ATTRIBUTE;
use crate::twin::TwinVersion;
use crate::{DataError, Dataset, LabelSet, SweepShape};
use arrays::Arrays;
use std::path::Path;

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
    read_arrays(path, Labels::Needed).map(|(dataset, _)| dataset)
}

/// Reads sweeps, and returns true if the file names their materials.
///
/// # Errors
/// As [`read_with_gaps`].
pub(super) fn read_arrays(path: &Path, labels: Labels) -> Result<(Dataset, bool), DataError> {
    let mut arrays = Arrays::open(path)?;
    let labelled = labels == Labels::Needed || arrays.name_materials();
    let (samples_name, mut samples) = arrays.take_samples()?;
    if !labelled && samples.shape.len() == 2 {
        // Two dimensions are a single sweep.
        samples.shape.insert(0, 1);
    }
    // Three dimensions do not define the arrangement of the taxels.
    let is_row = samples.shape.len() == 3;
    let layout = Layout::of(&arrays, samples_name, &samples.shape)?;
    let (labels, of_sweep) = match layout.sweeps {
        Some(sweeps) => label_blocks(&arrays, samples_name, samples.shape[0], sweeps)?,
        None if labelled => arrays.labels(&samples.shape, samples_name)?,
        None => (
            arrays.label_set(vec![UNLABELLED.into()])?,
            vec![0; samples.shape[0]],
        ),
    };
    let leading = match layout.sweeps {
        Some(_) => &samples.shape[..2],
        None => &samples.shape[..1],
    };
    let blocks = arrays.per_sweep("blocks", leading)?;
    let flags = arrays.per_sweep("test_flag", leading)?;
    if let Some(odd) = flags.iter().flatten().find(|&&flag| flag > 1) {
        return Err(arrays.error("test_flag", "0 or 1", odd.to_string()));
    }
    if let Some(some) = samples.some_sweeps() {
        some.check(path, layout.shape)?;
    }
    let type_name = samples.type_name();
    let values = match samples.into_numbers() {
        Some(Ok(values)) => values,
        Some(Err(value)) => {
            return Err(arrays.error(samples_name, HELD, value.0));
        }
        None => return Err(arrays.error(samples_name, "numbers", type_name)),
    };
    let flags = flags.map(|flags| flags.into_iter().map(|flag| flag == 1).collect());
    let records = records(&of_sweep, labels.len(), blocks, flags);
    let dataset = Dataset::at_rate(
        super::stem(path),
        arrays.rate()?,
        layout.shape,
        labels,
        records,
        values,
    )
    .map_err(|error| super::in_file(path, error))?;
    let mark = arrays
        .optional(SYNTHETIC_ATTRIBUTE)?
        .and_then(Array::floats);
    let version = mark
        .and_then(|mark| mark.first().copied())
        .and_then(TwinVersion::of_mark);
    let dataset = match version {
        Some(version) => dataset.into_twin(version),
        None => dataset,
    };
    let mut dataset = dataset.with_reading_findings(arrays.left_out());
    if is_row {
        dataset = dataset.with_assumed_patch();
    }
    Ok((dataset, labelled))
}

/// Meaning of the dimensions of the array of sweeps.
struct Layout {
    /// Number of sweeps per material, if the array has a dimension of materials.
    sweeps: Option<usize>,
    /// Shape of every sweep.
    shape: SweepShape,
}

impl Layout {
    /// Returns the layout of the array `name` with these extents.
    fn of(arrays: &Arrays<'_>, name: &str, extents: &[usize]) -> Result<Self, DataError> {
        let of = |sweeps, steps, rows, cols| Self {
            sweeps,
            shape: SweepShape { steps, rows, cols },
        };
        match *extents {
            [.., 1] if extents.len() == 5 && !arrays.contains("materials") => Err(arrays.error(
                name,
                "4 dimensions [n][steps][rows][cols]",
                format!("{extents:?}; an axis of channels at the end? `{name}[..., 0]` drops it"),
            )),
            [_, sweeps, steps, rows, cols] => Ok(of(Some(sweeps), steps, rows, cols)),
            [_, steps, rows, cols] => Ok(of(None, steps, rows, cols)),
            [_, steps, cols] => Ok(of(None, steps, 1, cols)),
            _ => Err(arrays.error(
                name,
                "3 dimensions [n][steps][taxels], 4 [n][steps][rows][cols] or 5 [materials][sweeps][steps][rows][cols]",
                format!("{} dimensions {extents:?}", extents.len()),
            )),
        }
    }
}

/// Returns the labels of sweeps that are ordered by material.
///
/// - `name`: array of the sweeps
/// - `materials`, `sweeps`: its first two extents
fn label_blocks(
    arrays: &Arrays<'_>,
    name: &str,
    materials: usize,
    sweeps: usize,
) -> Result<(LabelSet, Vec<usize>), DataError> {
    let names = arrays.names("materials")?;
    if names.len() != materials {
        let expected = format!("{materials} names, one per material of `{name}`");
        return Err(arrays.error("materials", expected, format!("{} names", names.len())));
    }
    let of_sweep = (0..materials)
        .flat_map(|m| std::iter::repeat_n(m, sweeps))
        .collect();
    Ok((arrays.label_set(names)?, of_sweep))
}
