//! Layouts of files of one sweep that other programs chose: other orders of axes, frames of several lines.

use std::path::Path;
use std::str::FromStr;

use super::dialect::{decode, number};
use super::file_kind;
use super::name_pattern::NamePattern;
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
        let numbers = numbers_of(frame).map_err(|(line, cell)| {
            refused(format!("line {line}"), "numbers", format!("`{cell}`"))
        })?;
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

/// Returns the numbers of a frame's lines; or the line, counted from 1, and the cell that is not a number.
fn numbers_of<'a>(frame: &[(usize, &'a str)]) -> Result<Vec<f64>, (usize, &'a str)> {
    let mut numbers = Vec::new();
    for (line, text) in frame {
        for cell in text
            .split([' ', '\t', ',', ';'])
            .filter(|cell| !cell.is_empty())
        {
            numbers.push(number(cell).ok_or((line + 1, cell))?);
        }
    }
    Ok(numbers)
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
