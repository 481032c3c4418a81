//! Arrays of one file by name: of a numpy archive, a MATLAB file or an HDF5 file.

mod missing;
mod roles;
mod sweeps;

use std::collections::BTreeMap;
use std::path::Path;

use super::in_file;
use super::named_sweeps::{some_names, sorted_names};
use super::npy::Array;
use super::tactmat::{RATE_ATTRIBUTE, SYNTHETIC_ATTRIBUTE};
use crate::{Condition, ConditionValues, DataError, Finding, LabelSet, Remedy, normal_name};
use missing::{MEANT_AS_BLOCKS, MEANT_AS_RATE};

pub(super) use roles::{RATES, Role, Roles};

/// Kind of file that holds arrays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Container {
    /// An archive of numpy.
    Npz,
    /// A file of MATLAB, of any version.
    Mat,
    /// An HDF5 file.
    Hdf5,
}

impl Container {
    /// Returns the word for one array of the file.
    fn word(self) -> &'static str {
        match self {
            Self::Npz => "array",
            Self::Mat => "variable",
            Self::Hdf5 => "data set",
        }
    }
}

/// Array that is not read.
pub(super) struct Other {
    pub(super) name: String,
    /// Extents, if they are known.
    pub(super) shape: Option<Vec<usize>>,
    /// Type in the words of the file, if it is known.
    pub(super) type_name: Option<String>,
}

/// Name of the array with the number of frames of each sweep.
pub(super) const LENGTHS: &str = "lengths";
/// Arrays that are read under these names from every file.
const KNOWN: [&str; 6] = [
    "materials",
    "blocks",
    LENGTHS,
    "test_flag",
    RATE_ATTRIBUTE,
    SYNTHETIC_ATTRIBUTE,
];

/// Arrays of one file: the known ones by name, read whole.
pub(super) struct Arrays<'a> {
    path: &'a Path,
    container: Container,
    roles: Roles,
    by_name: BTreeMap<String, Result<Array, String>>,
    /// Arrays that are not read, in order.
    others: Vec<Other>,
    /// Name and shape of the array of sweeps, once it was taken.
    taken: Option<(String, Vec<usize>)>,
    /// Findings that only the reader can make.
    findings: Vec<Finding>,
}

impl<'a> Arrays<'a> {
    /// Returns a file without arrays.
    pub(super) fn new(path: &'a Path, container: Container, roles: Roles) -> Self {
        Self {
            path,
            container,
            roles,
            by_name: BTreeMap::new(),
            others: Vec::new(),
            taken: None,
            findings: Vec::new(),
        }
    }

    /// Adds an array, or a sentence about the reason why it cannot be read.
    ///
    /// # Errors
    /// A second array of the same name.
    pub(super) fn insert(
        &mut self,
        name: String,
        array: Result<Array, String>,
    ) -> Result<(), DataError> {
        if self.by_name.contains_key(&name) {
            return Err(self.error(&name, "one member of that name", "two"));
        }
        self.by_name.insert(name, array);
        Ok(())
    }

    /// Adds an array that is not read.
    pub(super) fn add_other(&mut self, other: Other) {
        self.others.push(other);
    }

    /// Adds the sample rate from another place than an array.
    pub(super) fn name_rate(&mut self, name: String, rate: Array) {
        if !self.roles.rate.iter().any(|name| self.contains(name)) {
            self.by_name.insert(name.clone(), Ok(rate));
            self.roles.rate = vec![name];
        }
    }

    /// Returns the number of arrays that are not read.
    pub(super) fn others(&self) -> usize {
        self.others.len()
    }

    /// Returns true if an array of this name is read.
    pub(super) fn is_known(&self, name: &str) -> bool {
        KNOWN.contains(&name) || self.roles.contain(name) || Condition::of_name(name).is_some()
    }

    /// Returns true if this name is that of the array of sweeps.
    pub(super) fn is_samples(&self, name: &str) -> bool {
        self.roles.samples.iter().any(|known| known == name)
    }

    /// Returns true if there is an array of this role.
    fn has(&self, role: Role<'_>) -> bool {
        let names = self.roles.names(role);
        names.iter().any(|name| self.by_name.contains_key(*name))
    }

    /// Returns true if there is an array of labels or of materials.
    fn name_materials(&self) -> bool {
        self.has(Role::Labels) || self.contains("materials")
    }

    /// Returns true if there is an array of this name.
    fn contains(&self, name: &str) -> bool {
        self.by_name.contains_key(name)
    }

    /// Removes and returns the array of sweeps, which is large and read once.
    fn take_samples(&mut self) -> Result<(String, Array), DataError> {
        let (name, _) = self.required(Role::Samples)?;
        let name = name.to_owned();
        match self.by_name.remove(&name) {
            Some(Ok(array)) => {
                self.taken = Some((name.clone(), array.shape.clone()));
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
        let item = format!("{} `{name}`", self.container.word());
        DataError::format(self.path, item, expected, found)
    }

    fn optional(&self, name: &str) -> Result<Option<&Array>, DataError> {
        let expected = match self.container {
            Container::Npz => "numbers or text saved without pickle",
            Container::Mat | Container::Hdf5 => "numbers or text",
        };
        match self.by_name.get(name) {
            None => Ok(None),
            Some(Ok(array)) => Ok(Some(array)),
            Some(Err(found)) => Err(self.error(name, expected, found.as_str())),
        }
    }

    /// Returns the array of a role, and its name.
    fn required<'r>(&'r self, role: Role<'r>) -> Result<(&'r str, &'r Array), DataError> {
        for name in self.roles.names(role) {
            if let Some(array) = self.optional(name)? {
                return Ok((name, array));
            }
        }
        Err(self.missing(role))
    }

    /// Returns findings about the members of the archive that are not read.
    fn left_out(&self) -> Vec<Finding> {
        let has_blocks = self.by_name.contains_key("blocks");
        let is_block =
            |name: &str| !has_blocks && MEANT_AS_BLOCKS.contains(&name.to_lowercase().as_str());
        let names = self.others.iter().map(|of| of.name.as_str());
        let (blocks, others): (Vec<&str>, Vec<&str>) = names.partition(|name| is_block(name));
        let word = self.container.word();
        let article = if word.starts_with('a') { "an" } else { "a" };
        let mut findings = Vec::new();
        if !blocks.is_empty() {
            findings.push(Finding::not_read(format!(
                "{word}s that are ignored: {}; block numbers are read from {article} {word} `blocks`",
                some_names(blocks)
            )));
        }
        if !others.is_empty() {
            let names = some_names(others);
            let message = format!("{word}s that are ignored: {names}");
            findings.push(Finding::not_read(message));
        }
        findings
    }

    fn names(&self, name: &str) -> Result<Vec<String>, DataError> {
        let (name, array) = self.required(Role::Named(name))?;
        if array.shape.len() != 1 {
            return Err(self.error(name, "one dimension", format!("{:?}", array.shape)));
        }
        normal_texts(array)
            .or_else(|| Some(array.whole_numbers()?.iter().map(i64::to_string).collect()))
            .ok_or_else(|| self.error(name, "names or whole numbers", array.type_name()))
    }

    /// Returns the error of an array that holds neither names nor whole numbers, with the first other number.
    fn no_names(&self, name: &str, array: &Array) -> DataError {
        let expected = "names or whole numbers";
        let numbers = array.floats().unwrap_or_default();
        match numbers.iter().position(|number| number.fract() != 0.0) {
            Some(place) => {
                let item = format!("{name}[{place}]");
                self.error(&item, expected, numbers[place].to_string())
            }
            None => self.error(name, expected, array.type_name()),
        }
    }

    fn label_set(&self, names: Vec<String>) -> Result<LabelSet, DataError> {
        LabelSet::new(names).map_err(|error| in_file(self.path, error))
    }

    /// Returns the labels of the sweeps of the array `samples`, which has this shape.
    fn labels(&self, shape: &[usize], samples: &str) -> Result<(LabelSet, Vec<usize>), DataError> {
        let count = shape[0];
        let has_labels = self.has(Role::Labels);
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
        let (name, labels) = self.required(Role::Labels)?;
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
            // MATLAB counts from 1.
            let first = i64::from(self.container == Container::Mat);
            let index = |label: &i64| {
                let index = usize::try_from(label.checked_sub(first)?).ok();
                index.filter(|index| *index < materials.len())
            };
            if let Some(odd) = numbers.iter().find(|label| index(label).is_none()) {
                let from = if first == 1 { ", from 1" } else { "" };
                let expected = format!("indices of the {} materials{from}", materials.len());
                return Err(self.error(name, expected, odd.to_string()));
            }
            let of_sweep = numbers.iter().filter_map(index).collect();
            return Ok((self.label_set(materials.clone())?, of_sweep));
        }
        let texts = normal_texts(labels)
            .or_else(|| Some(numbers?.iter().map(i64::to_string).collect()))
            .ok_or_else(|| self.no_names(name, labels))?;
        self.refuse_nameless(name, &texts)?;
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

    /// Succeeds if all labels have a name.
    fn refuse_nameless(&self, name: &str, texts: &[String]) -> Result<(), DataError> {
        match texts.iter().position(|text| text.trim().is_empty()) {
            None => Ok(()),
            Some(nameless) => {
                let found = format!("an empty one, `{name}[{nameless}]`");
                Err(self.error(name, "a name for every sweep", found))
            }
        }
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
            let cure = match self.container {
                Container::Mat => format!("[~, {name}] = max({name}, [], 2)"),
                Container::Npz | Container::Hdf5 => format!("{name}.argmax(1)"),
            };
            found.push_str(&format!(
                "; one column for each material? `{cure}` makes labels of them"
            ));
        } else if let [own, ..] = labels.shape[..]
            && let Some(axis) = shape.iter().position(|extent| *extent == own)
        {
            let cure = match self.container {
                Container::Mat => permute(samples, axis, shape.len()),
                Container::Npz | Container::Hdf5 => format!("np.moveaxis({samples}, {axis}, 0)"),
            };
            let first = usize::from(self.container == Container::Mat);
            found.push_str(&format!(
                "; `{samples}` has shape {shape:?}: are its sweeps along axis {}? {cure} puts them first",
                axis + first
            ));
        }
        self.error(name, format!("shape [{count}], as `{samples}`"), found)
    }

    fn per_sweep(&self, name: &str, shape: &[usize]) -> Result<Option<Vec<u32>>, DataError> {
        let Some(array) = self.optional(name)? else {
            return Ok(None);
        };
        if array.shape != shape {
            let found = format!("shape {:?}", array.shape);
            return Err(self.error(name, format!("shape {shape:?}"), found));
        }
        // Numbers of MATLAB are floats by default.
        let whole = || {
            let numbers = array
                .whole_numbers()
                .filter(|_| self.container == Container::Mat)?;
            let numbers = numbers.into_iter().map(u32::try_from);
            numbers.collect::<Result<Vec<u32>, _>>().ok()
        };
        match array.indices().or_else(whole) {
            Some(values) => Ok(Some(values)),
            None => Err(self.error(name, "whole numbers from 0", array.type_name())),
        }
    }

    /// Removes and returns the arrays of conditions: those of their names with one finite number per sweep. Others of these
    /// names count as arrays that are not read.
    ///
    /// - `shape`: leading extents of the samples
    fn take_conditions(&mut self, shape: &[usize]) -> Vec<ConditionValues> {
        let is_other = |name: &&String| !self.roles.contain(name);
        let names: Vec<String> = self.by_name.keys().filter(is_other).cloned().collect();
        let mut found: Vec<ConditionValues> = Vec::new();
        for name in names {
            let Some(condition) = Condition::of_name(&name) else {
                continue;
            };
            let Some(Ok(array)) = self.by_name.remove(&name) else {
                continue;
            };
            let is_per_sweep =
                array.shape == shape || matches!(array.shape[..], [sweeps, 1] if shape == [sweeps]);
            let numbers = array.floats().filter(|_| is_per_sweep);
            let numbers = numbers.filter(|all| all.iter().all(|v| (*v as f32).is_finite()));
            let is_second = |of: &ConditionValues| of.condition.quantity == condition.quantity;
            match numbers {
                Some(numbers) if !found.iter().any(is_second) => found.push(ConditionValues {
                    condition,
                    values: numbers.into_iter().map(|value| value as f32).collect(),
                }),
                _ => self.others.push(Other {
                    name,
                    type_name: Some(array.type_name()),
                    shape: Some(array.shape),
                }),
            }
        }
        found
    }

    fn rate(&self) -> Result<Option<f64>, DataError> {
        let mut names = self.roles.rate.iter();
        let Some(name) = names.find(|name| self.contains(name)) else {
            return self.no_rate_elsewhere().map(|()| None);
        };
        let Some(array) = self.optional(name)? else {
            return Ok(None);
        };
        match array.floats().as_deref() {
            Some(&[rate]) if rate.is_finite() && rate > 0.0 => Ok(Some(rate)),
            other => {
                let found = match other {
                    Some(&[rate]) => rate.to_string(),
                    Some(rates) => format!("{} numbers", rates.len()),
                    None => array.type_name(),
                };
                Err(self.error(name, "a single positive number of Hz", found))
            }
        }
    }

    /// Succeeds if no array that is not read is named like a sample rate.
    fn no_rate_elsewhere(&self) -> Result<(), DataError> {
        let meant = |name: &&str| MEANT_AS_RATE.contains(&name.to_lowercase().as_str());
        match self.others.iter().map(|of| of.name.as_str()).find(meant) {
            None => Ok(()),
            Some(name) => Err(self.error(
                name,
                format!("the frames per second under the name `{RATE_ATTRIBUTE}`"),
                format!(
                    "`{name}`: rename it to `{RATE_ATTRIBUTE}`, or to another name if it is not a sample rate"
                ),
            )),
        }
    }
}

/// Returns the MATLAB command that puts an axis, counted from 0, in front.
fn permute(name: &str, axis: usize, axes: usize) -> String {
    let others = (0..axes).filter(|other| *other != axis);
    let order: Vec<String> = [axis]
        .into_iter()
        .chain(others)
        .map(|axis| (axis + 1).to_string())
        .collect();
    format!("{name} = permute({name}, [{}])", order.join(" "))
}

/// Returns the texts of an array in Unicode's composed form, in which names are compared.
fn normal_texts(array: &Array) -> Option<Vec<String>> {
    let texts = array.texts()?;
    Some(texts.iter().map(|text| normal_name(text)).collect())
}
