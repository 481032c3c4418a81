//! HDF5 files with a group for each sweep, as robomimic writes them: `data/demo_0/obs/tactile`, `data/demo_1/obs/tactile`.
//!
//! A path with `*` names the samples of all sweeps. The labels are data sets or, after `@`, attributes:
//! `data/*/material`, `data/*@task`.

use std::path::Path;

use super::arrays::Other;
use super::guarded::guarded;
use super::hdf5_arrays::{Content, Entry, rate_attribute};
use super::hdf5_values::{self, extents, shown_type};
use super::named_sweeps::{NAMED, NamedSweeps, some_names};
use super::npy::Array;
use super::read_options::ReadOptions;
use super::recording::{LabelRun, Recording, Recordings};
use super::sweep_file::Patch;
use super::tactmat;
use crate::{DataError, Finding, Remedy};
use hdf5_reader::Hdf5File;

/// Returns true if the options name the samples of many sweeps.
pub(super) fn are_named(options: &ReadOptions) -> bool {
    options
        .samples
        .as_ref()
        .is_some_and(|name| name.contains('*'))
}

/// Reads all sweeps; values may be NaN or infinite.
///
/// # Errors
/// No data set of that path; data sets without frames or with different taxels; labels that are missing.
pub(super) fn read_with_gaps(path: &Path, options: &ReadOptions) -> Result<NamedSweeps, DataError> {
    guarded(path, "HDF5", || read_unguarded(path, options))
}

fn read_unguarded(path: &Path, options: &ReadOptions) -> Result<NamedSweeps, DataError> {
    let file = tactmat::open(path)?;
    let content = Content::of(&file, path)?;
    let pattern = options
        .samples
        .as_deref()
        .unwrap_or_default()
        .trim_matches('/');
    let mut episodes: Vec<(String, &Entry)> = Vec::new();
    let mut others = Vec::new();
    for entry in &content.entries {
        match starred(pattern, &entry.path) {
            Some(name) => episodes.push((name, entry)),
            None => others.push(entry),
        }
    }
    let Some((_, first)) = episodes.first() else {
        return Err(no_episode(path, pattern, &content));
    };
    let rate = rate_attribute(&file, first).map(|(_, rate)| rate);
    episodes.sort_by_cached_key(|(name, _)| natural(name));
    let source = Source {
        file: &file,
        path,
        content: &content,
        options,
    };
    let frames: Vec<Frames> = episodes
        .iter()
        .map(|(_, entry)| source.frames(entry))
        .collect::<Result<_, _>>()?;
    let patch = frames[0].patch;
    if let Some(odd) = frames.iter().position(|frames| frames.patch != patch) {
        let expected = format!("{patch}, as `{}`", episodes[0].1.path);
        let found = frames[odd].patch.to_string();
        return Err(source.error(&episodes[odd].1.path, &expected, found));
    }
    let recordings = episodes
        .into_iter()
        .zip(frames)
        .map(|((name, _), frames)| source.recording(name, frames));
    let recordings = Recordings {
        path,
        patch,
        recordings: recordings.collect::<Result<_, _>>()?,
        clockwork: None,
        resolution: 0.0,
        conditions: Vec::new(),
        findings: ignored(&others, options),
    };
    let options = ReadOptions {
        rate_hz: options.rate_hz.or(rate),
        ..options.clone()
    };
    recordings.into_sweeps(&options)
}

/// Returns the error of a path that no data set has.
fn no_episode(path: &Path, pattern: &str, content: &Content) -> DataError {
    let listed: Vec<String> = grouped(&content.entries)
        .into_iter()
        .map(|of| of.name)
        .collect();
    let found = format!("only {}", some_names(listed.iter().map(String::as_str)));
    let item = format!("data sets `{pattern}`");
    DataError::format(path, item, "to be in the file", found).with_remedy(Remedy::NameSamples)
}

/// Frames of one sweep.
struct Frames {
    patch: Patch,
    values: Vec<f64>,
}

/// File with its content.
struct Source<'a> {
    file: &'a Hdf5File,
    path: &'a Path,
    content: &'a Content,
    options: &'a ReadOptions,
}

impl Source<'_> {
    fn error(&self, name: &str, expected: &str, found: impl Into<String>) -> DataError {
        DataError::format(self.path, format!("data set `{name}`"), expected, found)
    }

    /// Reads a data set of numbers or text.
    fn array(&self, entry: &Entry) -> Result<Array, DataError> {
        let array = match &entry.target {
            Ok(dataset) => hdf5_values::read(self.file, dataset),
            Err(other) => Err(format!("a link to the file `{other}`")),
        };
        array.map_err(|found| self.error(&entry.path, "numbers or text", found))
    }

    /// Reads the frames of one sweep.
    fn frames(&self, entry: &Entry) -> Result<Frames, DataError> {
        let array = self.array(entry)?;
        let patch = match array.shape[..] {
            [_] => Patch::Taxels(1),
            [_, taxels] => Patch::Taxels(taxels),
            [_, rows, cols] => Patch::Grid(rows, cols),
            _ => {
                let expected = "[steps][taxels] or [steps][rows][cols]";
                return Err(self.error(&entry.path, expected, format!("{:?}", array.shape)));
            }
        };
        match array.values_f64() {
            Some(Ok(values)) => Ok(Frames { patch, values }),
            Some(Err(wide)) => Err(self.error(&entry.path, super::narrow::HELD, wide.0)),
            None => Err(self.error(&entry.path, "numbers", array.type_name())),
        }
    }

    /// Returns a sweep with its material.
    fn recording(&self, name: String, frames: Frames) -> Result<Recording, DataError> {
        let count = frames.values.len() / frames.patch.taxels().max(1);
        let labels = match &self.options.labels {
            Some(pattern) => self.labels(pattern.trim_matches('/'), &name, count)?,
            None => Vec::new(),
        };
        let runs = match self.options.windows {
            Some(_) => labels.clone(),
            None => Vec::new(),
        };
        let material = match labels.as_slice() {
            [] => None,
            [only] => Some(only.label.clone()),
            [first, second, ..] if runs.is_empty() => {
                let found = format!(
                    "`{}`, and `{}` from frame {}",
                    first.label, second.label, second.start
                );
                let item = format!("labels of sweep `{name}`");
                let error = DataError::format(self.path, item, "one material", found);
                return Err(error.with_remedy(Remedy::CutWindows));
            }
            _ => None,
        };
        Ok(Recording {
            name,
            file: self.path.into(),
            lines: Vec::new(),
            values: frames.values,
            seconds: Vec::new(),
            material,
            labels: runs,
            block: None,
            test: None,
            conditions: Vec::new(),
        })
    }

    /// Returns the stretches of one label of a sweep.
    ///
    /// - `count`: number of frames
    fn labels(&self, pattern: &str, sweep: &str, count: usize) -> Result<Vec<LabelRun>, DataError> {
        let mut parts = sweep.split('/');
        let mut filled = String::new();
        for letter in pattern.chars() {
            match letter {
                '*' => filled.push_str(parts.next().unwrap_or_default()),
                letter => filled.push(letter),
            }
        }
        let expected = "the material of the sweep";
        let texts = match filled.split_once('@') {
            Some((object, attribute)) => self.attribute(object, attribute).map(|text| vec![text]),
            None => {
                let entry = self.content.entries.iter().find(|of| of.path == filled);
                let array = entry.map(|entry| self.array(entry)).transpose()?;
                array.and_then(|array| {
                    let numbers =
                        || Some(array.whole_numbers()?.iter().map(i64::to_string).collect());
                    array.texts().or_else(numbers)
                })
            }
        };
        match texts {
            None => Err(self.error(&filled, expected, "none")),
            Some(texts) if texts.len() == 1 || texts.len() == count => {
                Ok(LabelRun::all(texts.iter()))
            }
            Some(texts) => {
                let found = format!("{} labels for {count} frames", texts.len());
                Err(self.error(&filled, expected, found))
            }
        }
    }

    /// Returns the text or whole number of an attribute of a group or data set.
    fn attribute(&self, object: &str, name: &str) -> Option<String> {
        let group = self
            .file
            .group(object)
            .and_then(|group| group.attribute(name));
        let of_set = || {
            self.file
                .dataset(object)
                .and_then(|set| set.attribute(name))
        };
        let attribute = group.or_else(|_| of_set()).ok()?;
        let number = || {
            let number = attribute.read_as_f64().ok()?;
            (number.fract() == 0.0).then(|| (number as i64).to_string())
        };
        attribute.read_string().ok().or_else(number)
    }
}

/// Returns a note about the data sets that are not read.
fn ignored(others: &[&Entry], options: &ReadOptions) -> Vec<Finding> {
    let labels = options
        .labels
        .as_deref()
        .unwrap_or_default()
        .trim_matches('/');
    let left = others
        .iter()
        .filter(|entry| starred(labels, &entry.path).is_none());
    let mut names: Vec<String> = left.map(|entry| pattern_of(&entry.path)).collect();
    names.sort();
    names.dedup();
    match names.is_empty() {
        true => Vec::new(),
        false => {
            let names = some_names(names.iter().map(String::as_str));
            vec![Finding::not_read(format!(
                "data sets that are ignored: {names}"
            ))]
        }
    }
}

/// Returns the parts of a path that the stars of a pattern stand for, joined by slashes; `None` for other paths.
fn starred(pattern: &str, path: &str) -> Option<String> {
    let (patterns, parts) = (pattern.split('/'), path.split('/'));
    if patterns.clone().count() != parts.clone().count() {
        return None;
    }
    let mut stars = Vec::new();
    for (pattern, part) in patterns.zip(parts) {
        match pattern.split_once('*') {
            Some((before, after)) => {
                stars.push(part.strip_prefix(before)?.strip_suffix(after)?);
            }
            None if pattern == part => {}
            None => return None,
        }
    }
    Some(stars.join("/"))
}

/// Returns a path with a star in place of the number at the end of each group's name.
fn pattern_of(path: &str) -> String {
    let (groups, name) = path.rsplit_once('/').unwrap_or(("", path));
    let part = |part: &str| {
        let word = part.trim_end_matches(|letter: char| letter.is_ascii_digit());
        if word == part {
            part.to_owned()
        } else {
            format!("{word}*")
        }
    };
    let groups = groups.split('/').filter(|part| !part.is_empty()).map(part);
    groups
        .chain([name.to_owned()])
        .collect::<Vec<String>>()
        .join("/")
}

/// Returns the data sets of a file; those of numbered groups as one, if there are many.
pub(super) fn grouped(entries: &[Entry]) -> Vec<Other> {
    let mut found: Vec<(String, &Entry, usize)> = Vec::new();
    for entry in entries {
        let name = match entries.len() > NAMED {
            true => pattern_of(&entry.path),
            false => entry.path.clone(),
        };
        match found.iter_mut().find(|(known, ..)| *known == name) {
            Some((_, _, count)) => *count += 1,
            None => found.push((name, entry, 1)),
        }
    }
    let other = |(name, entry, count): (String, &Entry, usize)| {
        let of_type = match &entry.target {
            Ok(dataset) => shown_type(dataset),
            Err(other) => format!("in the file `{other}`"),
        };
        Other {
            name: if count == 1 { entry.path.clone() } else { name },
            shape: entry.target.as_ref().ok().map(extents),
            type_name: Some(match count {
                1 => of_type,
                _ => format!("{of_type}, the first of {count}"),
            }),
        }
    };
    found.into_iter().map(other).collect()
}

/// Returns a key that sorts numbers by their value: `demo_2` before `demo_10`.
fn natural(name: &str) -> (String, u64, String) {
    let word = name.trim_end_matches(|letter: char| letter.is_ascii_digit());
    let number = name[word.len()..].parse().unwrap_or(0);
    (word.into(), number, name.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_a_part_of_one_name() {
        assert_eq!(
            starred("data/*/obs", "data/demo_1/obs").as_deref(),
            Some("demo_1")
        );
        assert_eq!(
            starred("data/demo_*/obs", "data/demo_1/obs").as_deref(),
            Some("1")
        );
        assert_eq!(starred("*/demo_*", "a/demo_1").as_deref(), Some("a/1"));
        assert_eq!(starred("data/*", "data/demo_1/obs"), None);
        assert_eq!(starred("data/*/obs", "data/demo_1/act"), None);
        assert_eq!(
            pattern_of("data/demo_12/obs/skin2"),
            "data/demo_*/obs/skin2"
        );
        let mut names = ["demo_10", "demo_2", "demo_1"];
        names.sort_by_key(|name| natural(name));
        assert_eq!(names, ["demo_1", "demo_2", "demo_10"]);
    }
}
