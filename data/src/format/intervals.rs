//! Tables of labelled intervals: columns `start`, `end`, `label`, and optionally `file`.

use std::path::Path;

use super::csv::Rows;
use super::frame_table::{Column, MATERIAL};
use super::pieces::Piece;
use super::recording::{Recording, Recordings};
use super::time_stamps::{Clockwork, times_of};
use super::timing::Timing;
use crate::{DataError, Finding, FindingKind, Place, Remedy, Severity};

/// Names of the columns, without a unit.
const START: &[&str] = &["start", "begin", "from", "onset"];
const END: &[&str] = &["end", "stop", "to"];
const FILE: &[&str] = &["file", "recording", "sweep"];
/// Expected columns, for messages.
const COLUMNS: &str =
    "the columns start, end, label, and file if the intervals differ between recordings";

/// Interval of one label, in the recording's clock.
struct Interval {
    start: f64,
    end: f64,
    label: String,
    /// Recording that it belongs to; `None`: all.
    file: Option<String>,
    line: usize,
}

/// Cuts the pieces to the intervals; frames outside all intervals are left out.
///
/// # Errors
/// A table that cannot be read; intervals of different labels that overlap.
pub(super) fn pieces(
    recordings: &mut Recordings<'_>,
    timing: &Timing,
    pieces: &[Piece],
    table: &Path,
) -> Result<Vec<Piece>, DataError> {
    let intervals = read(
        table,
        recordings.clockwork.unwrap_or(Clockwork::Numbers(1.0)),
    )?;
    let mut used = vec![false; intervals.len()];
    let mut cut = Vec::new();
    for piece in pieces {
        let recording = &recordings.recordings[piece.recording];
        let seconds = times_of_frames(recordings, timing, piece)?;
        let mut own: Vec<usize> = (0..intervals.len())
            .filter(|at| intervals[*at].is_of(recording))
            .collect();
        own.sort_by(|a, b| intervals[*a].start.total_cmp(&intervals[*b].start));
        refuse_overlap(table, &intervals, &own)?;
        for at in own {
            let interval = &intervals[at];
            let start = seconds.partition_point(|time| *time < interval.start);
            let end = seconds.partition_point(|time| *time < interval.end);
            if start < end {
                used[at] = true;
                cut.push(Piece {
                    recording: piece.recording,
                    frames: piece.frames.start + start..piece.frames.start + end,
                    material: Some(interval.label.clone()),
                });
            }
        }
    }
    let unused = intervals.iter().zip(&used).filter(|(_, used)| !**used);
    let unused = unused.map(|(interval, _)| interval.without_frames(table));
    recordings.findings.extend(unused);
    if cut.is_empty() {
        let expected = "times within the recordings";
        return Err(DataError::format(
            table,
            "intervals",
            expected,
            "none within",
        ));
    }
    Ok(cut)
}

/// Returns the times of the frames of a piece. Without stamps, time counts from the first frame of the recording.
fn times_of_frames(
    recordings: &Recordings<'_>,
    timing: &Timing,
    piece: &Piece,
) -> Result<Vec<f64>, DataError> {
    let seconds = &recordings.recordings[piece.recording].seconds;
    match (seconds.get(piece.frames.clone()), timing.rate_hz) {
        (Some(seconds), _) => Ok(seconds.to_vec()),
        (None, Some(rate)) => Ok(piece
            .frames
            .clone()
            .map(|frame| frame as f64 / rate)
            .collect()),
        (None, None) => {
            let expected = "one, for intervals";
            let error = DataError::format(recordings.path, "sample rate", expected, "none");
            Err(error.with_remedy(Remedy::NameRate))
        }
    }
}

impl Interval {
    /// Returns true if the interval is one of the recording.
    fn is_of(&self, recording: &Recording) -> bool {
        let Some(file) = &self.file else { return true };
        let path = Path::new(file);
        recording.name == *file
            || recording.file.ends_with(path)
            || recording.file.file_stem() == Some(path.as_os_str())
    }

    /// Returns a warning that no recording has frames in the interval.
    fn without_frames(&self, table: &Path) -> Finding {
        let Self {
            start,
            end,
            label,
            line,
            ..
        } = self;
        let message = format!(
            "{}, line {line}: no frame from {start} to {end} s (`{label}`)",
            table.display()
        );
        Finding::new(Severity::Warning, FindingKind::NotRead, message).at(Place {
            file: Some(table.into()),
            line: Some(*line),
            ..Place::default()
        })
    }
}

fn refuse_overlap(table: &Path, intervals: &[Interval], sorted: &[usize]) -> Result<(), DataError> {
    for &[a, b] in sorted.array_windows() {
        let (a, b) = (&intervals[a], &intervals[b]);
        if b.start < a.end && a.label != b.label {
            let expected = format!(
                "a start after the end of `{}`, {} s (line {})",
                a.label, a.end, a.line
            );
            return Err(DataError::format(
                table,
                format!("line {}", b.line),
                expected,
                b.start.to_string(),
            ));
        }
    }
    Ok(())
}

fn read(table: &Path, clockwork: Clockwork) -> Result<Vec<Interval>, DataError> {
    let mut rows = Rows::open(table)?;
    let header = rows.next()?.unwrap_or_default();
    let find = |names: &[&str]| {
        header
            .iter()
            .position(|name| names.contains(&first_word(name).as_str()))
    };
    let (Some(start), Some(end), Some(label)) = (find(START), find(END), find(MATERIAL)) else {
        return Err(DataError::format(
            table,
            "first line",
            COLUMNS,
            header.join(", "),
        ));
    };
    let file = find(FILE);
    let (mut starts, mut ends, mut labels) = (Vec::new(), Vec::new(), Vec::new());
    let mut lines = Vec::new();
    while let Some(row) = rows.next()? {
        lines.push(rows.line());
        starts.push(row[start].clone());
        ends.push(row[end].clone());
        let file = file.map(|at| row[at].trim().to_string());
        labels.push((
            row[label].trim().to_string(),
            file.filter(|file| !file.is_empty()),
        ));
    }
    let times =
        |at: usize, cells| times_of(table, &lines, &header[at], &Column::Words(cells), clockwork);
    let (starts, ends) = (times(start, starts)?, times(end, ends)?);
    let mut intervals = Vec::new();
    for (at, (label, file)) in labels.into_iter().enumerate() {
        let (start, end, line) = (starts[at], ends[at], lines[at]);
        if start >= end {
            let expected = format!("an end after the start, {start} s");
            return Err(DataError::format(
                table,
                format!("line {line}"),
                expected,
                end.to_string(),
            ));
        }
        intervals.push(Interval {
            start,
            end,
            label,
            file,
            line,
        });
    }
    Ok(intervals)
}

/// Returns the first word of a name in lower case: `start` of `Start [ms]` and `start_s`.
fn first_word(name: &str) -> String {
    let mut words = name.trim().split(|c: char| !c.is_alphanumeric());
    words.next().unwrap_or_default().to_lowercase()
}
