//! Layouts of files of one sweep that other programs chose: names that hold the material, other orders of axes, frames of several lines.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::dialect::{decode, number};
use super::file_kind;
use crate::{DataError, Finding};

/// Layout of the files in a folder; the default is one folder per material, `[steps][taxels]`, a line per frame.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FileLayout {
    /// Pattern of the files' names.
    pub names: Option<NamePattern>,
    /// Order of the axes of an array.
    pub axes: Option<Axes>,
    /// Number of lines of a text file that form a frame. The numbers of all its lines are columns, numbered from 1.
    pub lines_per_frame: Option<usize>,
    /// Number of steps to which every sweep is stretched or compressed, by linear interpolation.
    pub stretch: Option<usize>,
    /// Materials whose sweeps are left out.
    pub drop_materials: Vec<String>,
}

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

/// Order of the axes of the array of one sweep, such as `taxels,steps` or `rows,cols,steps`.
///
/// ```
/// use tactnet_data::format::Axes;
///
/// assert!("rows,cols,steps".parse::<Axes>().is_ok());
/// assert!("steps,steps".parse::<Axes>().is_err());
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Axes {
    /// Index of the axis of time steps.
    steps: usize,
    /// Number of axes: 2 or 3.
    count: usize,
}

impl FromStr for Axes {
    type Err = DataError;

    fn from_str(text: &str) -> Result<Self, DataError> {
        let names: Vec<&str> = text.split(',').map(str::trim).collect();
        let others: Vec<&str> = names
            .iter()
            .copied()
            .filter(|name| *name != "steps")
            .collect();
        let steps = names.iter().position(|name| *name == "steps");
        match (steps, others.as_slice()) {
            (Some(steps), ["taxels"] | ["rows", "cols"]) => Ok(Self {
                steps,
                count: names.len(),
            }),
            _ => {
                let expected = "`steps` with `taxels`, or with `rows` before `cols`, such as `rows,cols,steps`";
                Err(DataError::inconsistent(
                    "axes",
                    expected,
                    format!("`{text}`"),
                ))
            }
        }
    }
}

impl Axes {
    /// Returns extents and values with the steps first; `None` for another number of axes.
    pub(super) fn steps_first(
        &self,
        shape: &[usize],
        values: &[f64],
    ) -> Option<(Vec<usize>, Vec<f64>)> {
        if shape.len() != self.count {
            return None;
        }
        let before: usize = shape[..self.steps].iter().product();
        let (steps, after) = (
            shape[self.steps],
            shape[self.steps + 1..].iter().product::<usize>(),
        );
        let mut turned = Vec::with_capacity(values.len());
        for step in 0..steps {
            for first in 0..before {
                let start = (first * steps + step) * after;
                turned.extend_from_slice(&values[start..start + after]);
            }
        }
        let mut extents = vec![steps];
        extents.extend(
            shape
                .iter()
                .enumerate()
                .filter(|(axis, _)| *axis != self.steps)
                .map(|(_, extent)| *extent),
        );
        Some((extents, turned))
    }
}

/// Reads a text file with several lines per frame: `[frames][columns]` and the number of columns; with notes.
///
/// - `columns`: numbers or ranges of the columns that are taxels, from 1; empty: all
///
/// # Errors
/// A file that cannot be read; other text than numbers; frames of different lengths; columns that do not exist.
pub(super) fn read_lines(
    path: &Path,
    lines_per_frame: usize,
    columns: &[String],
) -> Result<(Vec<f64>, usize, Vec<Finding>), DataError> {
    file_kind::refuse_pretended(path, "a text file")?;
    let refused = |item: String, expected: &str, found: String| {
        DataError::format(path, item, expected, found)
    };
    let bytes = crate::read_file(path).map_err(|error| DataError::io(path, "read", error))?;
    let text =
        decode(bytes).map_err(|found| refused("file".into(), "a text file", found.into()))?;
    let lines: Vec<(usize, &str)> = text
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty())
        .collect();
    // Lines that do not fill a frame come before the frames.
    let head = lines.len() % lines_per_frame.max(1);
    let mut frames: Vec<Vec<f64>> = Vec::new();
    for frame in lines[head..].chunks_exact(lines_per_frame) {
        let mut numbers = Vec::new();
        for (line, text) in frame {
            for cell in text
                .split([' ', '\t', ',', ';'])
                .filter(|cell| !cell.is_empty())
            {
                let number = number(cell).ok_or_else(|| {
                    refused(format!("line {}", line + 1), "numbers", format!("`{cell}`"))
                })?;
                numbers.push(number);
            }
        }
        if let Some(first) = frames.first()
            && first.len() != numbers.len()
        {
            let item = format!("the frame that begins in line {}", frame[0].0 + 1);
            let expected = format!("{} numbers, as in the first", first.len());
            return Err(refused(item, &expected, numbers.len().to_string()));
        }
        frames.push(numbers);
    }
    let Some(width) = frames.first().map(Vec::len) else {
        let expected = format!("at least {lines_per_frame} lines");
        return Err(refused("file".into(), &expected, lines.len().to_string()));
    };
    let chosen = chosen_columns(columns, width).map_err(|found| {
        refused(
            "columns".into(),
            &format!("numbers or ranges from 1 to {width}"),
            found,
        )
    })?;
    let values = frames
        .iter()
        .flat_map(|frame| chosen.iter().map(|column| frame[*column]))
        .collect();
    let note = (head > 0).then(|| {
        Finding::not_read(format!(
            "lines before the first frame that are ignored: {head}"
        ))
    });
    Ok((values, chosen.len(), note.into_iter().collect()))
}

/// Returns the places of columns that are given as `3` or `15-74`.
fn chosen_columns(columns: &[String], width: usize) -> Result<Vec<usize>, String> {
    if columns.is_empty() {
        return Ok((0..width).collect());
    }
    let mut chosen = Vec::new();
    for column in columns {
        let (first, last) = column.split_once('-').unwrap_or((column, column));
        match (first.trim().parse::<usize>(), last.trim().parse::<usize>()) {
            (Ok(first), Ok(last)) if 1 <= first && first <= last && last <= width => {
                chosen.extend(first - 1..last);
            }
            _ => return Err(format!("`{column}`")),
        }
    }
    Ok(chosen)
}

/// Returns a sweep stretched or compressed to `steps` steps, by linear interpolation: `[steps][taxels]`.
pub(super) fn stretched(values: &[f64], taxels: usize, steps: usize) -> Vec<f64> {
    let frames = values.len() / taxels.max(1);
    let mut out = Vec::with_capacity(steps * taxels);
    for step in 0..steps {
        let place = match steps {
            1 => 0.0,
            _ => step as f64 * (frames - 1) as f64 / (steps - 1) as f64,
        };
        let before = (place.floor() as usize).min(frames - 1);
        let after = (before + 1).min(frames - 1);
        let share = place - before as f64;
        out.extend((0..taxels).map(|taxel| {
            let (a, b) = (
                values[before * taxels + taxel],
                values[after * taxels + taxel],
            );
            a + share * (b - a)
        }));
    }
    out
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

    #[test]
    fn axes_are_turned_so_that_steps_come_first() {
        let axes: Axes = "rows,cols,steps".parse().unwrap();
        // [1][2][3]: two taxels with three steps.
        let turned = axes
            .steps_first(&[1, 2, 3], &[1.0, 2.0, 3.0, 10.0, 20.0, 30.0])
            .unwrap();
        assert_eq!(
            turned,
            (vec![3, 1, 2], vec![1.0, 10.0, 2.0, 20.0, 3.0, 30.0])
        );
        assert!(axes.steps_first(&[2, 3], &[0.0; 6]).is_none());
    }

    #[test]
    fn a_stretched_sweep_keeps_its_ends_and_lines() {
        assert_eq!(
            stretched(&[0.0, 5.0, 2.0, 7.0], 2, 3),
            [0.0, 5.0, 1.0, 6.0, 2.0, 7.0]
        );
        assert_eq!(stretched(&[0.0, 1.0, 2.0, 3.0], 1, 2), [0.0, 3.0]);
        assert_eq!(stretched(&[4.0], 1, 3), [4.0; 3]);
    }

    #[test]
    fn frames_of_several_lines_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        std::fs::write(&path, "-10000\n1 2\n3.5\n4 5 \n6\n").unwrap();
        let (values, width, notes) = read_lines(&path, 2, &[]).unwrap();
        assert_eq!(
            (values.as_slice(), width, notes.len()),
            (&[1.0, 2.0, 3.5, 4.0, 5.0, 6.0][..], 3, 1)
        );
        let (values, width, _) = read_lines(&path, 2, &["2-3".into()]).unwrap();
        assert_eq!((values.as_slice(), width), (&[2.0, 3.5, 5.0, 6.0][..], 2));
        assert!(read_lines(&path, 2, &["4".into()]).is_err());
        std::fs::write(&path, "1 2\n3\n4\n5\n").unwrap();
        let refused = read_lines(&path, 2, &[]).unwrap_err().to_string();
        assert!(
            refused.contains("the frame that begins in line 3: expected 3 numbers"),
            "{refused}"
        );
    }
}
