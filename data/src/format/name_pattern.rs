//! Patterns of file names that hold the material, and the files in a folder that match.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::DataError;

/// Pattern of names of files, such as `{material}/{block}/{sweep}.csv` or `{split}/sample_{sweep}_label_{material}.npy`.
///
/// ```
/// use tactnet_data::format::NamePattern;
///
/// let pattern: NamePattern = "{material}_{sweep}.txt".parse()?;
/// assert_eq!(pattern.to_string(), "{material}_{sweep}.txt");
/// assert!("{sweep}.txt".parse::<NamePattern>().is_err());
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamePattern {
    text: String,
    parts: Vec<Part>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Part {
    Text(String),
    Field(Field),
}

/// Meaning of a part of a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Field {
    Material,
    Sweep,
    Block,
    Split,
    Any,
}

/// Fields of a pattern.
const FIELDS: [(&str, Field); 5] = [
    ("{material}", Field::Material),
    ("{sweep}", Field::Sweep),
    ("{block}", Field::Block),
    ("{split}", Field::Split),
    ("*", Field::Any),
];

/// Properties of a sweep that its file name contains.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct NamedFile {
    pub(super) material: String,
    pub(super) block: Option<String>,
    pub(super) test: Option<bool>,
}

impl std::fmt::Display for NamePattern {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}

impl FromStr for NamePattern {
    type Err = DataError;

    fn from_str(text: &str) -> Result<Self, DataError> {
        let (mut parts, mut rest) = (Vec::new(), text);
        while !rest.is_empty() {
            let found = FIELDS
                .iter()
                .filter_map(|(name, field)| Some((rest.find(name)?, *name, *field)))
                .min_by_key(|(place, _, _)| *place);
            let (place, name, field) = found.unwrap_or((rest.len(), "", Field::Any));
            if place > 0 {
                parts.push(Part::Text(rest[..place].into()));
            }
            if !name.is_empty() {
                parts.push(Part::Field(field));
            }
            rest = &rest[place + name.len()..];
        }
        let count = |field| {
            parts
                .iter()
                .filter(|part| **part == Part::Field(field))
                .count()
        };
        let unknown = parts
            .iter()
            .any(|part| matches!(part, Part::Text(text) if text.contains(['{', '}'])));
        if count(Field::Material) != 1 || unknown {
            return Err(DataError::inconsistent(
                "pattern of names",
                "`{material}` once, and `{sweep}`, `{block}`, `{split}` or `*` where names differ",
                format!("`{text}`"),
            ));
        }
        Ok(Self {
            text: text.into(),
            parts,
        })
    }
}

impl NamePattern {
    /// Returns the extension of the files; `None` if it differs.
    fn extension(&self) -> Option<&str> {
        Path::new(&self.text).extension()?.to_str()
    }

    /// Returns the meaning of a name; `None` if it does not match.
    pub(super) fn meaning(&self, name: &str) -> Option<NamedFile> {
        let mut found = NamedFile::default();
        matches(&self.parts, name, &mut found).then_some(found)
    }
}

/// Matches a name with a pattern; fields are as long as possible.
fn matches(parts: &[Part], name: &str, found: &mut NamedFile) -> bool {
    let Some((first, rest)) = parts.split_first() else {
        return name.is_empty();
    };
    match first {
        Part::Text(text) => name
            .strip_prefix(text.as_str())
            .is_some_and(|name| matches(rest, name, found)),
        Part::Field(field) => {
            let ends: Vec<usize> = name
                .char_indices()
                .map(|(place, c)| place + c.len_utf8())
                .collect();
            for end in ends.into_iter().rev() {
                let value = &name[..end];
                let is_number = value.bytes().all(|byte| byte.is_ascii_digit());
                if value.contains('/') || (*field == Field::Sweep && !is_number) {
                    continue;
                }
                if matches(rest, &name[end..], found) {
                    match field {
                        Field::Material => found.material = value.into(),
                        Field::Block => found.block = Some(value.into()),
                        Field::Split => found.test = Some(value.to_lowercase().starts_with("test")),
                        Field::Sweep | Field::Any => {}
                    }
                    return true;
                }
            }
            false
        }
    }
}

/// Files in a folder whose names match a pattern, sorted with numbers in order, and the number of other files.
///
/// # Errors
/// A folder that cannot be listed; no file that matches.
pub(super) fn named_files(
    folder: &Path,
    pattern: &NamePattern,
) -> Result<(Vec<(PathBuf, NamedFile)>, usize), DataError> {
    let mut all = Vec::new();
    list(folder, String::new(), &mut all)?;
    all.sort_by_key(|(name, _)| human(name));
    let count = all.len();
    let same = |path: &Path| path.extension().and_then(|e| e.to_str()) == pattern.extension();
    let candidates = all.into_iter().filter(|(_, path)| same(path));
    let found: Vec<(PathBuf, NamedFile)> = candidates
        .filter_map(|(name, path)| Some((path, pattern.meaning(&name)?)))
        .collect();
    if found.is_empty() {
        let expected = format!("files named {pattern}");
        return Err(DataError::format(
            folder,
            "folder",
            expected,
            format!("{count} others"),
        ));
    }
    let others = count - found.len();
    Ok((found, others))
}

/// Appends the files in a folder and its folders, each with its name relative to the first.
fn list(folder: &Path, prefix: String, all: &mut Vec<(String, PathBuf)>) -> Result<(), DataError> {
    let failed = |error| DataError::io(folder, "list", error);
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        match entry.file_type().map_err(failed)?.is_dir() {
            true => list(&entry.path(), name + "/", all)?,
            false => all.push((name, entry.path())),
        }
    }
    Ok(())
}

/// Returns a key that sorts `a2` before `a10`.
fn human(name: &str) -> Vec<(String, u64)> {
    let mut key = vec![(String::new(), 0_u64)];
    for letter in name.chars() {
        let last = key.len() - 1;
        match letter.to_digit(10) {
            Some(digit) => {
                key[last].1 = key[last]
                    .1
                    .saturating_mul(10)
                    .saturating_add(u64::from(digit))
            }
            None => {
                if key[last].1 > 0 {
                    key.push((String::new(), 0));
                }
                let last = key.len() - 1;
                key[last].0.push(letter);
            }
        }
    }
    key
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_material_block_and_split() {
        let meaning =
            |pattern: &str, name: &str| pattern.parse::<NamePattern>().unwrap().meaning(name);
        let of = |material: &str, block: Option<&str>, test| {
            Some(NamedFile {
                material: material.into(),
                block: block.map(Into::into),
                test,
            })
        };
        let evtouch = "{split}/sample_{sweep}_label_{material}.npy";
        assert_eq!(
            meaning(evtouch, "test/sample_10_label_3.npy"),
            of("3", None, Some(true))
        );
        assert_eq!(
            meaning(evtouch, "train/sample_1_label_13.npy"),
            of("13", None, Some(false))
        );
        assert_eq!(
            meaning("{material}_{sweep}.txt", "full_vitamin_water_8.txt"),
            of("full_vitamin_water", None, None)
        );
        assert_eq!(meaning("{material}_{sweep}.txt", "README.txt"), None);
        assert_eq!(
            meaning("{material}/{block}/*.csv", "felt/monday/a b.csv"),
            of("felt", Some("monday"), None)
        );
        assert!("{sweep}.csv".parse::<NamePattern>().is_err());
        assert!("{material}{matrial}".parse::<NamePattern>().is_err());
        assert!(human("s2") < human("s10") && human("a10") < human("b2"));
    }
}
