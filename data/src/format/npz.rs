//! numpy archives (`numpy.savez`, `numpy.savez_compressed`).
//!
//! | array | shape | holds |
//! |---|---|---|
//! | `samples` | `[materials][sweeps][steps][rows][cols]` or `[n][steps][rows][cols]` | digits, any integer or float type |
//! | `materials` | `[materials]` | names, bytes or text |
//! | `labels`, with four dimensions | `[n]` | index into `materials`, or the name itself |
//! | `blocks`, `test_flag`, optional | `[materials][sweeps]` or `[n]` | as in [`tactmat`](super::tactmat) |
//! | `sample_rate_hz`, optional | a single number | frames per second; [`SAMPLE_RATE_HZ`] without it |
//! | `synthetic`, optional | a single number | not 0 where the sweeps were generated |
//!
//! Either byte order and either index order ("Fortran" too) are read. Pickled arrays are refused. What [`write()`] writes
//! loads with `numpy.load` without pickle.

use super::DEFLATE_LIMIT;
use super::npy::{self, Array};
use super::tactmat::{RATE_ATTRIBUTE, SAMPLE_RATE_HZ, SYNTHETIC_ATTRIBUTE};
use crate::{DataError, Dataset, LabelSet, Samples, SweepRecord, SweepShape, write_whole};
use std::collections::BTreeMap;
use std::io::{Cursor, Read, Write};
use std::path::Path;
use zip::CompressionMethod;
use zip::write::{SimpleFileOptions, ZipWriter};

/// Reads a data set whose values are all finite.
///
/// # Errors
/// A file that is no zip archive; an array that is missing, pickled or of the wrong shape or type; a NaN or an infinity,
/// with its sweep.
pub fn read(path: &Path) -> Result<Dataset, DataError> {
    super::refuse_non_finite(path, read_with_gaps(path)?)
}

/// Reads a data set that may hold NaN or infinities, for a check that lists them all.
///
/// # Errors
/// As [`read`], except for values that are not finite.
pub fn read_with_gaps(path: &Path) -> Result<Dataset, DataError> {
    let arrays = Arrays::open(path)?;
    let samples = arrays.required("samples")?;
    let (sweeps, shape) = match *samples.shape {
        [_, sweeps, steps, rows, cols] => (Some(sweeps), SweepShape { steps, rows, cols }),
        [_, steps, rows, cols] => (None, SweepShape { steps, rows, cols }),
        _ => {
            return Err(arrays.error(
                "samples",
                "5 dimensions [materials][sweeps][steps][rows][cols] or 4 [n][steps][rows][cols]",
                format!("{} dimensions {:?}", samples.shape.len(), samples.shape),
            ));
        }
    };
    let (labels, of_sweep) = match sweeps {
        Some(sweeps) => {
            let materials = samples.shape[0];
            let names = arrays.names("materials")?;
            if names.len() != materials {
                let expected = format!("{materials} names, one per material of `samples`");
                return Err(arrays.error("materials", expected, format!("{} names", names.len())));
            }
            let of_sweep = (0..materials)
                .flat_map(|m| std::iter::repeat_n(m, sweeps))
                .collect();
            (arrays.label_set(names)?, of_sweep)
        }
        None => arrays.labels(samples.shape[0])?,
    };
    let leading = &samples.shape[..samples.shape.len() - 3];
    let blocks = arrays.per_sweep("blocks", leading)?;
    let flags = arrays.per_sweep("test_flag", leading)?;
    if let Some(odd) = flags.iter().flatten().find(|&&flag| flag > 1) {
        return Err(arrays.error("test_flag", "0 or 1", odd.to_string()));
    }
    let values = match samples.numbers() {
        Some(Ok(values)) => values,
        Some(Err(value)) => {
            return Err(arrays.error("samples", "values that a 32-bit float holds", value.0));
        }
        None => return Err(arrays.error("samples", "numbers", samples.type_name())),
    };
    let mut seen = vec![0; labels.len()];
    let records = of_sweep
        .into_iter()
        .enumerate()
        .map(|(index, label): (usize, usize)| {
            seen[label] += 1;
            SweepRecord {
                label,
                sweep: seen[label] - 1,
                block: blocks.as_ref().map(|b| b[index]),
                test: flags.as_ref().map(|f| f[index] == 1),
            }
        })
        .collect();
    let dataset = Dataset::new(
        super::stem(path),
        arrays.rate()?,
        shape,
        labels,
        records,
        values,
    )
    .map_err(|error| super::in_file(path, error))?;
    let mark = arrays
        .optional(SYNTHETIC_ATTRIBUTE)?
        .and_then(Array::floats);
    Ok(if mark.is_some_and(|mark| mark != [0.0]) {
        dataset.into_synthetic()
    } else {
        dataset
    })
}

/// The arrays of one archive by name.
struct Arrays<'a> {
    path: &'a Path,
    by_name: BTreeMap<String, Result<Array, String>>,
}

impl<'a> Arrays<'a> {
    fn open(path: &'a Path) -> Result<Self, DataError> {
        let bytes = std::fs::read(path).map_err(|error| DataError::io(path, "read", error))?;
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes.as_slice())).map_err(|error| {
            let item = "npz archive with array `samples`";
            DataError::format(path, item, "a zip archive", error.to_string())
        })?;
        let by_name = (0..archive.len())
            .map(|index| unpack(&mut archive, index))
            .collect();
        Ok(Self { path, by_name })
    }

    fn error(
        &self,
        name: &str,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> DataError {
        DataError::format(self.path, format!("array `{name}`"), expected, found)
    }

    fn optional(&self, name: &str) -> Result<Option<&Array>, DataError> {
        match self.by_name.get(name) {
            None => Ok(None),
            Some(Ok(array)) => Ok(Some(array)),
            Some(Err(found)) => {
                Err(self.error(name, "numbers or text saved without pickle", found.as_str()))
            }
        }
    }

    fn required(&self, name: &str) -> Result<&Array, DataError> {
        self.optional(name)?.ok_or_else(|| {
            let there: Vec<String> = self
                .by_name
                .iter()
                .map(|(name, array)| match array {
                    Ok(array) => format!("`{name}` {:?}", array.shape),
                    Err(_) => format!("`{name}`"),
                })
                .collect();
            let found = if there.is_empty() {
                "no array".into()
            } else {
                there.join(", ")
            };
            self.error(name, "to be in the archive", format!("only {found}"))
        })
    }

    fn names(&self, name: &str) -> Result<Vec<String>, DataError> {
        let array = self.required(name)?;
        if array.shape.len() != 1 {
            return Err(self.error(name, "one dimension", format!("{:?}", array.shape)));
        }
        array
            .texts()
            .ok_or_else(|| self.error(name, "bytes or text", array.type_name()))
    }

    fn label_set(&self, names: Vec<String>) -> Result<LabelSet, DataError> {
        LabelSet::new(names).map_err(|error| super::in_file(self.path, error))
    }

    /// The material of each of `count` sweeps.
    fn labels(&self, count: usize) -> Result<(LabelSet, Vec<usize>), DataError> {
        let labels = self.required("labels")?;
        if labels.shape != [count] {
            let found = format!("shape {:?}", labels.shape);
            return Err(self.error("labels", format!("shape [{count}], as `samples`"), found));
        }
        if let Some(texts) = labels.texts() {
            let names = match self.optional("materials")? {
                Some(_) => self.names("materials")?,
                None => {
                    let mut names = texts.clone();
                    names.sort();
                    names.dedup();
                    names
                }
            };
            let of_sweep: Result<Vec<usize>, DataError> = texts
                .iter()
                .map(|text| {
                    names.iter().position(|name| name == text).ok_or_else(|| {
                        self.error(
                            "labels",
                            "names that `materials` holds",
                            format!("`{text}`"),
                        )
                    })
                })
                .collect();
            return Ok((self.label_set(names)?, of_sweep?));
        }
        let Some(indices) = labels.indices() else {
            return Err(self.error("labels", "whole numbers or names", labels.type_name()));
        };
        let names = self.names("materials")?;
        if let Some(odd) = indices.iter().find(|&&label| label as usize >= names.len()) {
            let expected = format!("indices of the {} materials", names.len());
            return Err(self.error("labels", expected, odd.to_string()));
        }
        Ok((
            self.label_set(names)?,
            indices.into_iter().map(|label| label as usize).collect(),
        ))
    }

    fn per_sweep(&self, name: &str, shape: &[usize]) -> Result<Option<Vec<u32>>, DataError> {
        let Some(array) = self.optional(name)? else {
            return Ok(None);
        };
        if array.shape != shape {
            let found = format!("shape {:?}", array.shape);
            return Err(self.error(name, format!("shape {shape:?}"), found));
        }
        match array.indices() {
            Some(values) => Ok(Some(values)),
            None => Err(self.error(name, "whole numbers from 0", array.type_name())),
        }
    }

    fn rate(&self) -> Result<f64, DataError> {
        let Some(array) = self.optional(RATE_ATTRIBUTE)? else {
            return Ok(SAMPLE_RATE_HZ);
        };
        match array.floats().as_deref() {
            Some(&[rate]) if rate.is_finite() && rate > 0.0 => Ok(rate),
            other => {
                let found = other.map_or_else(|| array.type_name(), |rates| format!("{rates:?}"));
                Err(self.error(RATE_ATTRIBUTE, "a single positive number of Hz", found))
            }
        }
    }
}

/// Name and content of an archive's member, or what is wrong with it.
fn unpack(
    archive: &mut zip::ZipArchive<Cursor<&[u8]>>,
    index: usize,
) -> (String, Result<Array, String>) {
    let name = match archive.name_for_index(index) {
        Some(Ok(name)) => name.strip_suffix(".npy").unwrap_or(&name).to_owned(),
        _ => format!("member {index}"),
    };
    let content = archive
        .by_index(index)
        .map_err(|error| error.to_string())
        .and_then(|member| {
            let (size, packed) = (member.size(), member.compressed_size());
            let room = packed.saturating_mul(DEFLATE_LIMIT);
            if size > room {
                return Err(format!("{packed} bytes that unpack to {size}"));
            }
            let mut content = Vec::with_capacity(size as usize);
            match member.take(room).read_to_end(&mut content) {
                Ok(_) => Array::parse(content),
                Err(error) => Err(error.to_string()),
            }
        });
    (name, content)
}

/// Writes `dataset`: five dimensions if it is ordered by material with equally many sweeps of each, else four with
/// `labels`.
///
/// # Errors
/// A file that cannot be written.
pub fn write(path: &Path, dataset: &Dataset) -> Result<(), DataError> {
    let bytes = archive(dataset).map_err(|error| DataError::io(path, "write", error.into()))?;
    write_whole(path, &bytes)
}

fn archive(dataset: &Dataset) -> zip::result::ZipResult<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .large_file(true);
    let mut add = |name: &str, descr: &str, shape: &[usize], values: &[u8]| {
        zip.start_file(format!("{name}.npy"), options)?;
        zip.write_all(&npy::encode(descr, shape, values))
            .map_err(zip::result::ZipError::from)
    };
    let records = dataset.records();
    let materials = dataset.labels().len();
    let sweeps = dataset.len() / materials;
    let in_order = dataset.len() == materials * sweeps
        && records
            .iter()
            .enumerate()
            .all(|(i, r)| r.label == i / sweeps && r.sweep == i % sweeps);
    let leading = if in_order {
        vec![materials, sweeps]
    } else {
        vec![dataset.len()]
    };
    let sweep = dataset.shape();
    let shape = [leading.as_slice(), &[sweep.steps, sweep.rows, sweep.cols]].concat();
    let descr = match dataset.samples() {
        Samples::U8(_) => "|u1",
        Samples::U16(_) => "<u2",
        Samples::F32(_) => "<f4",
    };
    let mut values = Vec::with_capacity(dataset.samples().bytes());
    dataset
        .samples()
        .for_each_le_chunk(|chunk| values.extend_from_slice(chunk));
    add("samples", descr, &shape, &values)?;
    let names: Vec<Vec<char>> = dataset
        .labels()
        .names()
        .map(|n| n.chars().collect())
        .collect();
    let width = names.iter().map(Vec::len).max().unwrap_or(1);
    let text: Vec<u8> = names
        .iter()
        .flat_map(|name| (0..width).map(|i| name.get(i).map_or(0, |&letter| letter as u32)))
        .flat_map(u32::to_le_bytes)
        .collect();
    add("materials", &format!("<U{width}"), &[materials], &text)?;
    if !in_order {
        let labels: Vec<u8> = records
            .iter()
            .flat_map(|r| (r.label as u32).to_le_bytes())
            .collect();
        add("labels", "<u4", &leading, &labels)?;
    }
    if dataset.has_blocks() {
        let blocks: Vec<u8> = records
            .iter()
            .filter_map(|r| r.block)
            .flat_map(u32::to_le_bytes)
            .collect();
        add("blocks", "<u4", &leading, &blocks)?;
    }
    if dataset.has_test_flag() {
        let flags: Vec<u8> = records
            .iter()
            .filter_map(|r| r.test)
            .map(u8::from)
            .collect();
        add("test_flag", "|b1", &leading, &flags)?;
    }
    if dataset.origin().is_synthetic() {
        add(SYNTHETIC_ATTRIBUTE, "<f8", &[], &1.0_f64.to_le_bytes())?;
    }
    add(
        RATE_ATTRIBUTE,
        "<f8",
        &[],
        &dataset.sample_rate_hz().to_le_bytes(),
    )?;
    Ok(zip.finish()?.into_inner())
}
