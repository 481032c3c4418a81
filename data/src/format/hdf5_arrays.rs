//! HDF5 files whose arrays have any names: data sets in groups, `X` and `y`, and the files of MATLAB 7.3.

use std::collections::BTreeSet;
use std::path::Path;

use super::arrays::{Arrays, Container, RATES, Roles};
use super::guarded::guarded;
use super::hdf5_episodes::grouped;
use super::hdf5_values::{self, matlab_class, scalar};
use super::mismatch::{COPY, Mismatch};
use super::named_sweeps::Labels;
use super::read_options::ReadOptions;
use super::tactmat;
use crate::{Condition, DataError, Dataset};
use hdf5_reader::error::Error;
use hdf5_reader::group::Group;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::link::LinkTarget;
use hdf5_reader::{Attribute, Hdf5File};

/// Maximum number of data sets of a file.
const MOST: usize = 100_000;
/// Maximum number of groups in each other.
const DEEPEST: usize = 32;

/// Reads sweeps, and returns true if the file names their materials.
///
/// # Errors
/// As [`tactmat::read`].
pub(super) fn read_arrays(
    path: &Path,
    labels: Labels,
    options: &ReadOptions,
) -> Result<(Dataset, bool), DataError> {
    guarded(path, "HDF5", || read_unguarded(path, labels, options))
}

fn read_unguarded(
    path: &Path,
    labels: Labels,
    options: &ReadOptions,
) -> Result<(Dataset, bool), DataError> {
    let file = tactmat::open(path)?;
    let is_named = options.samples.is_some() || options.labels.is_some();
    if !is_named && tactmat::is_layout(&file) {
        return Ok((tactmat::read_file(&file, path)?, true));
    }
    let content = Content::of(&file, path)?;
    arrays(&file, path, &content, options)?.into_sweeps(labels)
}

/// Data set of a file, or a link to one in another file.
#[derive(Clone)]
pub(super) struct Entry {
    /// Path without a leading slash.
    pub(super) path: String,
    /// The data set, or the name of the other file.
    pub(super) target: Result<hdf5_reader::Dataset, String>,
}

/// All data sets of a file.
pub(super) struct Content {
    pub(super) entries: Vec<Entry>,
    pub(super) container: Container,
}

impl Content {
    /// Lists the data sets in all groups.
    ///
    /// # Errors
    /// A group or a data set that cannot be read.
    pub(super) fn of(file: &Hdf5File, path: &Path) -> Result<Self, DataError> {
        let mut content = Self {
            entries: Vec::new(),
            container: Container::Hdf5,
        };
        let listed = file
            .root_group()
            .and_then(|root| content.list(file, &root, "", &mut BTreeSet::new(), 0));
        listed.map_err(|error| {
            let mismatch = Mismatch::from_hdf5(&error);
            DataError::format(path, "HDF5 file", mismatch.expected, mismatch.found)
        })?;
        let mut sets = content
            .entries
            .iter()
            .filter_map(|of| of.target.as_ref().ok());
        if sets.any(|set| matlab_class(set).is_some()) {
            content.container = Container::Mat;
        }
        Ok(content)
    }

    /// Appends the data sets of a group.
    fn list(
        &mut self,
        file: &Hdf5File,
        group: &Group,
        prefix: &str,
        seen: &mut BTreeSet<u64>,
        depth: usize,
    ) -> hdf5_reader::error::Result<()> {
        if depth > DEEPEST || self.entries.len() > MOST {
            let found = format!("more than {MOST} data sets, or {DEEPEST} groups in each other");
            return Err(Error::ResourceLimit(found));
        }
        // Hard links may form a cycle.
        if !seen.insert(group.address()) {
            return Ok(());
        }
        let (groups, sets) = group.members()?;
        self.entries.extend(sets.into_iter().map(|set| Entry {
            path: format!("{prefix}{}", set.name().trim_start_matches('/')),
            target: Ok(set),
        }));
        let header = file.get_or_parse_header(group.address())?;
        for message in &header.messages {
            if let HdfMessage::Link(link) = message
                && let LinkTarget::External { filename, .. } = &link.target
            {
                self.entries.push(Entry {
                    path: format!("{prefix}{}", link.name),
                    target: Err(filename.clone()),
                });
            }
        }
        for inner in groups {
            let name = inner.name().trim_start_matches('/');
            // MATLAB stores the contents of cells and of its own objects in these groups.
            if depth == 0 && ["#refs#", "#subsystem#"].contains(&name) {
                continue;
            }
            self.list(file, &inner, &format!("{prefix}{name}/"), seen, depth + 1)?;
        }
        Ok(())
    }
}

/// Reads the arrays that are needed.
fn arrays<'a>(
    file: &Hdf5File,
    path: &'a Path,
    content: &Content,
    options: &ReadOptions,
) -> Result<Arrays<'a>, DataError> {
    let paths: Vec<&str> = content.entries.iter().map(|of| of.path.as_str()).collect();
    let roles = Roles::of_paths(content.container, &paths, options);
    let mut arrays = Arrays::new(path, content.container, roles);
    for entry in &content.entries {
        if arrays.is_known(&entry.path) {
            let array = match &entry.target {
                Ok(dataset) => hdf5_values::read(file, dataset),
                Err(other) => Err(format!("a link to the file `{other}`; {COPY}")),
            };
            let is_samples = arrays.is_samples(&entry.path);
            let array = array.map(|array| match content.container {
                // MATLAB has no arrays of one dimension.
                Container::Mat if !is_samples => array.into_list(),
                _ => array,
            });
            arrays.insert(name_with_unit(entry), array)?;
        }
    }
    let mut others = content.entries.clone();
    others.retain(|entry| !arrays.is_known(&entry.path));
    for other in grouped(&others) {
        arrays.add_other(other);
    }
    let samples = content
        .entries
        .iter()
        .find(|of| arrays.is_samples(&of.path));
    if let Some((name, rate)) = samples.and_then(|entry| rate_attribute(file, entry)) {
        arrays.name_rate(name, scalar(rate));
    }
    Ok(arrays)
}

/// Returns the path of a data set; that of a condition with the unit in its attributes.
fn name_with_unit(entry: &Entry) -> String {
    match (Condition::of_name(&entry.path), &entry.target) {
        (
            Some(Condition {
                quantity,
                unit: None,
            }),
            Ok(set),
        ) => {
            let unit = hdf5_values::unit(set);
            Condition { quantity, unit }.to_string()
        }
        _ => entry.path.clone(),
    }
}

/// Returns the sample rate in an attribute of a data set or of one of its groups, and the attribute's name.
pub(super) fn rate_attribute(file: &Hdf5File, entry: &Entry) -> Option<(String, f64)> {
    let rate = |attributes: Vec<Attribute>| {
        let of_name = |rate: &&str| {
            let found = attributes
                .iter()
                .find(|of| of.name.eq_ignore_ascii_case(rate))?;
            Some((found.name.clone(), found.read_as_f64().ok()?))
        };
        RATES.iter().find_map(of_name)
    };
    let own = entry
        .target
        .as_ref()
        .ok()
        .and_then(|set| rate(set.attributes()));
    let groups = entry
        .path
        .rmatch_indices('/')
        .map(|(slash, _)| &entry.path[..slash]);
    let mut groups = groups.chain([""]);
    own.or_else(|| groups.find_map(|path| rate(file.group(path).ok()?.attributes().ok()?)))
}
