//! Arrays of one numpy archive.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use super::super::DEFLATE_LIMIT;
use super::super::in_file;
use super::super::named_sweeps::{NAMED, some_names, some_of, sorted_names};
use super::super::npy::{Array, Header};
use super::super::tactmat::{RATE_ATTRIBUTE, SYNTHETIC_ATTRIBUTE};
use super::NPY;
use crate::{DataError, Finding, LabelSet, Remedy, normal_name};

/// Arrays that are read.
const KNOWN: [&str; 9] = [
    "samples",
    "X",
    "labels",
    "y",
    "materials",
    "blocks",
    "test_flag",
    RATE_ATTRIBUTE,
    SYNTHETIC_ATTRIBUTE,
];
/// Names of the array of sweeps.
const SAMPLES: &[&str] = &["samples", "X"];
/// Names of the array of materials.
const LABELS: &[&str] = &["labels", "y"];
/// Names, in lower case, of arrays that probably hold the sweeps under a wrong name.
const MEANT_AS_SAMPLES: &[&str] = &[
    "arr_0",
    "data",
    "input",
    "inputs",
    "recordings",
    "sample",
    "signal",
    "signals",
    "sweeps",
    "values",
    "x",
    "x_train",
];
/// Names, in lower case, of arrays that probably hold the materials under a wrong name.
const MEANT_AS_LABELS: &[&str] = &[
    "arr_1", "class", "classes", "label", "material", "target", "targets", "y", "y_train",
];
/// Names, in lower case, of arrays that may hold block numbers.
const MEANT_AS_BLOCKS: &[&str] = &[
    "block",
    "block_id",
    "block_ids",
    "blocks",
    "session",
    "session_id",
    "session_ids",
    "sessions",
];
/// Names, in lower case, of arrays that probably hold the sample rate under a wrong name.
const RATES: &[&str] = &[
    "fps",
    "fs",
    "hz",
    "rate",
    "rate_hz",
    "sample_rate",
    "samplerate",
    "sampling_rate",
    "sampling_rate_hz",
];

/// Arrays of one archive: the known ones by name, read whole.
pub(super) struct Arrays<'a> {
    path: &'a Path,
    by_name: BTreeMap<String, Result<Array, String>>,
    /// Names of the other members in order, and the shapes of the first of them.
    others: Vec<(String, Option<Vec<usize>>)>,
    /// Name and shape of the array of sweeps, once it was taken.
    taken: Option<(String, Vec<usize>)>,
}

impl<'a> Arrays<'a> {
    /// Opens an archive, or a single array, which then holds the sweeps.
    pub(super) fn open(path: &'a Path) -> Result<Self, DataError> {
        let mut arrays = Self {
            path,
            by_name: BTreeMap::new(),
            others: Vec::new(),
            taken: None,
        };
        if super::super::first_bytes(path)?.starts_with(NPY) {
            let io = |error| DataError::io(path, "read", error);
            let file = crate::open_file(path).map_err(io)?;
            let room = file.metadata().map_err(io)?.len();
            let array = Array::read_samples(BufReader::new(file), room);
            arrays.by_name.insert("X".into(), array);
            return Ok(arrays);
        }
        let file = crate::open_file(path).map_err(|error| DataError::io(path, "read", error))?;
        let mut archive = zip::ZipArchive::new(BufReader::new(file)).map_err(|error| {
            let item = "npz archive with array `X`";
            DataError::format(path, item, "a zip archive", error.to_string())
        })?;
        for index in 0..archive.len() {
            let name = match archive.name_for_index(index) {
                Some(Ok(name)) => name.strip_suffix(".npy").unwrap_or(&name).to_owned(),
                _ => format!("member {index}"),
            };
            if !KNOWN.contains(&name.as_str()) {
                let mut shape = None;
                if arrays.others.len() < NAMED
                    && let Ok(mut member) = archive.by_index(index)
                {
                    shape = Header::read(&mut member).ok().map(|header| header.shape);
                }
                arrays.others.push((name, shape));
                continue;
            }
            if arrays.by_name.contains_key(&name) {
                return Err(arrays.error(&name, "one member of that name", "two"));
            }
            let array = unpack(&mut archive, index, SAMPLES.contains(&name.as_str()));
            arrays.by_name.insert(name, array);
        }
        Ok(arrays)
    }

    /// Returns true if there is an array of labels or of materials.
    pub(super) fn name_materials(&self) -> bool {
        let mut names = LABELS.iter().chain(&["materials"]);
        names.any(|name| self.by_name.contains_key(*name))
    }

    /// Returns true if there is an array of this name.
    pub(super) fn contains(&self, name: &str) -> bool {
        self.by_name.contains_key(name)
    }

    /// Removes and returns the array of sweeps, which is large and read once.
    pub(super) fn take_samples(&mut self) -> Result<(&'static str, Array), DataError> {
        let (name, _) = self.required(SAMPLES)?;
        match self.by_name.remove(name) {
            Some(Ok(array)) => {
                self.taken = Some((name.to_owned(), array.shape.clone()));
                Ok((name, array))
            }
            _ => panic!("`{name}` was found"),
        }
    }

    pub(super) fn error(
        &self,
        name: &str,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> DataError {
        DataError::format(self.path, format!("array `{name}`"), expected, found)
    }

    pub(super) fn optional(&self, name: &str) -> Result<Option<&Array>, DataError> {
        match self.by_name.get(name) {
            None => Ok(None),
            Some(Ok(array)) => Ok(Some(array)),
            Some(Err(found)) => {
                Err(self.error(name, "numbers or text saved without pickle", found.as_str()))
            }
        }
    }

    /// Returns the array that has one of `names`, and its name.
    fn required(&self, names: &[&'static str]) -> Result<(&'static str, &Array), DataError> {
        for &name in names {
            if let Some(array) = self.optional(name)? {
                return Ok((name, array));
            }
        }
        Err({
            let shown = |name: &str, shape: Option<&Vec<usize>>| match shape {
                Some(shape) if !shape.is_empty() => format!("`{name}` {shape:?}"),
                _ => format!("`{name}`"),
            };
            let taken = self.taken.iter();
            let taken = taken.map(|(name, shape)| shown(name, Some(shape)));
            let known = self.by_name.iter();
            let known = known
                .map(|(name, array)| shown(name, array.as_ref().ok().map(|array| &array.shape)));
            let others = self.others.iter();
            let others = others.map(|(name, shape)| shown(name, shape.as_ref()));
            let there: Vec<String> = taken.chain(known).chain(others).collect();
            let found = match there.is_empty() {
                true => "no array".into(),
                false => some_of(there),
            };
            let expected = match names {
                SAMPLES => "to be in the archive: np.savez_compressed(\"sweeps.npz\", X=X, y=y) \
                    with X [n][steps][taxels] and y [n]"
                    .to_owned(),
                [other, _] => format!("to be in the archive (or `{other}`)"),
                _ => "to be in the archive".to_owned(),
            };
            // The documentation uses the last of the names.
            let name = names.last().unwrap_or(&names[0]);
            // Sweeps and labels under wrong names are reported together.
            let has_labels = LABELS.iter().any(|name| self.by_name.contains_key(*name));
            let labels = match names {
                SAMPLES if !has_labels => self.meant(LABELS),
                _ => None,
            };
            let meant = match (self.meant(names), labels) {
                (Some(meant), Some(labels)) => {
                    format!(
                        "; rename `{meant}` to `{name}` and `{labels}` to `y`, if that is what they hold"
                    )
                }
                (Some(meant), None) => {
                    format!("; rename `{meant}` to `{name}`, if that is what it holds")
                }
                (None, _) if names == SAMPLES => self.one_for_each_material().unwrap_or_default(),
                (None, _) => String::new(),
            };
            self.error(name, expected, format!("only {found}{meant}"))
        })
    }

    /// Returns the array that probably holds the values under a wrong name.
    fn meant(&self, names: &[&'static str]) -> Option<&str> {
        let usual = match names {
            SAMPLES => MEANT_AS_SAMPLES,
            LABELS => MEANT_AS_LABELS,
            _ => &[],
        };
        let mut others = self.others.iter().map(|(name, _)| name.as_str());
        others.find(|other| usual.contains(&other.to_lowercase().as_str()))
    }

    /// Returns a hint to concatenate several arrays of sweeps of one shape, for example one per material.
    fn one_for_each_material(&self) -> Option<String> {
        let mut shapes = self.others.iter().map(|(_, shape)| shape.as_deref());
        let of_sweep = shapes.next()??.get(1..)?.to_vec();
        let alike = |shape: Option<&[usize]>| shape.and_then(|s| s.get(1..)) == Some(&of_sweep);
        let many = self.others.len() > 1 && of_sweep.len() > 1 && shapes.all(alike);
        many.then(|| {
            "; one array for each material? `d = dict(np.load(FILE)); np.savez_compressed(\"sweeps.npz\", X=np.concatenate(list(d.values())), \
             y=np.repeat(list(d), [len(x) for x in d.values()]))`"
                .into()
        })
    }

    /// Returns findings about the members of the archive that are not read.
    pub(super) fn left_out(&self) -> Vec<Finding> {
        let has_blocks = self.by_name.contains_key("blocks");
        let is_block =
            |name: &str| !has_blocks && MEANT_AS_BLOCKS.contains(&name.to_lowercase().as_str());
        let names = self.others.iter().map(|(name, _)| name.as_str());
        let (blocks, others): (Vec<&str>, Vec<&str>) = names.partition(|name| is_block(name));
        let mut findings = Vec::new();
        if !blocks.is_empty() {
            findings.push(Finding::not_read(format!(
                "arrays that are ignored: {}; block numbers are read from an array `blocks`",
                some_names(blocks)
            )));
        }
        if !others.is_empty() {
            let names = some_names(others);
            let message = format!("arrays that are ignored: {names}");
            findings.push(Finding::not_read(message));
        }
        findings
    }

    pub(super) fn names(&self, name: &'static str) -> Result<Vec<String>, DataError> {
        let (name, array) = self.required(&[name])?;
        if array.shape.len() != 1 {
            return Err(self.error(name, "one dimension", format!("{:?}", array.shape)));
        }
        normal_texts(array)
            .or_else(|| Some(array.whole_numbers()?.iter().map(i64::to_string).collect()))
            .ok_or_else(|| self.error(name, "names or whole numbers", array.type_name()))
    }

    pub(super) fn label_set(&self, names: Vec<String>) -> Result<LabelSet, DataError> {
        LabelSet::new(names).map_err(|error| in_file(self.path, error))
    }

    /// Returns the labels of the sweeps of the array `samples`, which has this shape.
    pub(super) fn labels(
        &self,
        shape: &[usize],
        samples: &str,
    ) -> Result<(LabelSet, Vec<usize>), DataError> {
        let count = shape[0];
        let has_labels = LABELS.iter().any(|name| self.by_name.contains_key(*name));
        // If there are other arrays, the error of `required` names them, because one of them may be meant.
        if !has_labels && self.others.is_empty() {
            return Err(self
                .error(
                    "y",
                    format!("the material of each of the {count} sweeps of `{samples}`"),
                    "none",
                )
                .with_remedy(Remedy::NameLabels));
        }
        let (name, labels) = self.required(LABELS)?;
        // Column vectors of scikit-learn are accepted, too.
        if labels.shape != [count] && labels.shape != [count, 1] {
            return Err(self.mismatched_labels(name, labels, samples, shape));
        }
        let materials = match self.optional("materials")? {
            Some(_) => Some(self.names("materials")?),
            None => None,
        };
        let numbers = labels.whole_numbers();
        if let (Some(materials), Some(numbers)) = (&materials, &numbers) {
            let index = |label: &i64| {
                let index = usize::try_from(*label).ok();
                index.filter(|index| *index < materials.len())
            };
            if let Some(odd) = numbers.iter().find(|label| index(label).is_none()) {
                let expected = format!("indices of the {} materials", materials.len());
                return Err(self.error(name, expected, odd.to_string()));
            }
            let of_sweep = numbers.iter().filter_map(index).collect();
            return Ok((self.label_set(materials.clone())?, of_sweep));
        }
        let texts = normal_texts(labels)
            .or_else(|| Some(numbers?.iter().map(i64::to_string).collect()))
            .ok_or_else(|| self.error(name, "names or whole numbers", labels.type_name()))?;
        if let Some(nameless) = texts.iter().position(|text| text.trim().is_empty()) {
            return Err(self.error(
                name,
                "a name for every sweep",
                format!("an empty one, `{name}[{nameless}]`"),
            ));
        }
        let names = materials.unwrap_or_else(|| sorted_names(&texts));
        let of_sweep: Result<Vec<usize>, DataError> = texts
            .iter()
            .map(|text| {
                let place = names.iter().position(|name| name == text);
                place.ok_or_else(|| {
                    self.error(name, "names that `materials` holds", format!("`{text}`"))
                })
            })
            .collect();
        Ok((self.label_set(names)?, of_sweep?))
    }

    /// Returns the error of labels whose shape does not match that of `samples`.
    fn mismatched_labels(
        &self,
        name: &str,
        labels: &Array,
        samples: &str,
        shape: &[usize],
    ) -> DataError {
        let count = shape[0];
        let mut found = format!("shape {:?}", labels.shape);
        // A matrix of zeros and ones contains no names.
        let is_number = labels.is_number();
        if is_number && labels.shape.len() == 2 && labels.shape[0] == count {
            found.push_str(&format!(
                "; one column for each material? `{name}.argmax(1)` makes labels of them"
            ));
        } else if let [own, ..] = labels.shape[..]
            && let Some(axis) = shape.iter().position(|extent| *extent == own)
        {
            found.push_str(&format!(
                "; `{samples}` has shape {shape:?}: are its sweeps along axis {axis}? np.moveaxis({samples}, {axis}, 0) puts them first"
            ));
        }
        self.error(name, format!("shape [{count}], as `{samples}`"), found)
    }

    pub(super) fn per_sweep(
        &self,
        name: &str,
        shape: &[usize],
    ) -> Result<Option<Vec<u32>>, DataError> {
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

    pub(super) fn rate(&self) -> Result<Option<f64>, DataError> {
        let Some(array) = self.optional(RATE_ATTRIBUTE)? else {
            let meant = |name: &&String| RATES.contains(&name.to_lowercase().as_str());
            return match self.others.iter().map(|(name, _)| name).find(meant) {
                None => Ok(None),
                Some(name) => Err(self.error(
                    name,
                    format!("the frames per second under the name `{RATE_ATTRIBUTE}`"),
                    format!(
                        "`{name}`: rename it to `{RATE_ATTRIBUTE}`, or to another name if it is not a sample rate"
                    ),
                )),
            };
        };
        match array.floats().as_deref() {
            Some(&[rate]) if rate.is_finite() && rate > 0.0 => Ok(Some(rate)),
            other => {
                let found = match other {
                    Some(&[rate]) => rate.to_string(),
                    Some(rates) => format!("{} numbers", rates.len()),
                    None => array.type_name(),
                };
                Err(self.error(RATE_ATTRIBUTE, "a single positive number of Hz", found))
            }
        }
    }
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
/// Returns the texts of an array in Unicode's composed form, in which names are compared.
fn normal_texts(array: &Array) -> Option<Vec<String>> {
    let texts = array.texts()?;
    Some(texts.iter().map(|text| normal_name(text)).collect())
}
