//! Cutting of continuous recordings: stretches without a gap, of one label, at one rate, in windows of one length.

use std::ops::Range;

use super::named_sweeps::{some_names, sorted_names};
use super::read_options::ReadOptions;
use super::recording::{Recording, Recordings};
use super::resample::{are_even, to_even, to_rate};
use super::timing::Timing;
use super::windows::{Windows, starts};
use super::{clock::LOST_AT_ONCE, intervals};
use crate::{DataError, Finding, Remedy};

/// Maximum ratio of two rates of resampling. Beyond it the rate is a mistake, and the memory of a machine is soon used up.
const MOST: f64 = 1000.0;

/// Stretch of a recording without a gap, of one label.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Piece {
    /// Index of the recording.
    pub(super) recording: usize,
    pub(super) frames: Range<usize>,
    pub(super) material: Option<String>,
}

/// Replaces the recordings by their pieces: resampled, and cut into windows if the options ask for them.
///
/// # Errors
/// Windows in seconds or resampling without a rate; windows that are longer than all stretches; intervals that cannot be
/// read; frames without a label.
pub(super) fn cut(
    recordings: &mut Recordings<'_>,
    timing: &Timing,
    options: &ReadOptions,
) -> Result<(), DataError> {
    let mut pieces = without_gaps(recordings, timing);
    if let Some(windows) = &options.windows {
        pieces = match &windows.intervals {
            Some(table) => intervals::pieces(recordings, timing, &pieces, table)?,
            None => of_one_label(recordings, &pieces),
        };
        pieces = labelled(recordings, pieces, windows)?;
    }
    let mut stretches: Vec<Recording> = Vec::with_capacity(pieces.len());
    for piece in &pieces {
        stretches.push(stretch(recordings, timing, piece, options)?);
    }
    recordings.recordings = match &options.windows {
        Some(windows) => in_windows(recordings, timing, &pieces, &stretches, windows, options)?,
        None => {
            share_blocks(recordings, &pieces, &mut stretches);
            stretches
        }
    };
    Ok(())
}

/// Gives the stretches of each recording one block if gaps have split recordings, so that no fold separates them, and notes it.
fn share_blocks(recordings: &mut Recordings<'_>, pieces: &[Piece], stretches: &mut [Recording]) {
    let all = recordings.recordings.len();
    let mut counts = vec![0_usize; all];
    for piece in pieces {
        counts[piece.recording] += 1;
    }
    let split = counts.iter().filter(|count| **count > 1).count();
    if split == 0 {
        return;
    }
    let mut lengths = Vec::new();
    for (piece, stretch) in pieces.iter().zip(stretches) {
        stretch.block.get_or_insert(piece.recording as u32);
        if counts[piece.recording] > 1 {
            lengths.push(stretch.frames(recordings.patch));
        }
    }
    let shortest = lengths.iter().min().copied().unwrap_or_default();
    let longest = lengths.iter().max().copied().unwrap_or_default();
    recordings.findings.push(Finding::not_read(format!(
        "{split} of {all} recordings have gaps and became {} sweeps of {shortest} to {longest} steps; the sweeps of one recording share a block",
        lengths.len()
    )));
}

/// Returns the stretches of all recordings without a gap.
fn without_gaps(recordings: &Recordings<'_>, timing: &Timing) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for (at, recording) in recordings.recordings.iter().enumerate() {
        let all = 0..recording.frames(recordings.patch);
        let stretches = match &timing.clocks[at] {
            Some(clock) => clock.stretches.clone(),
            None => vec![all],
        };
        pieces.extend(stretches.into_iter().map(|frames| Piece {
            recording: at,
            frames,
            material: recording.material.clone(),
        }));
    }
    pieces
}

/// Cuts the pieces where the label changes.
fn of_one_label(recordings: &Recordings<'_>, pieces: &[Piece]) -> Vec<Piece> {
    let mut cut = Vec::new();
    for piece in pieces {
        let runs = &recordings.recordings[piece.recording].labels;
        if runs.is_empty() {
            cut.push(piece.clone());
        }
        // The run that contains the first frame, and the next ones.
        let first = runs.partition_point(|run| run.start <= piece.frames.start);
        for at in first.saturating_sub(1)..runs.len() {
            let run = &runs[at];
            if run.start >= piece.frames.end {
                break;
            }
            let end = runs.get(at + 1).map_or(piece.frames.end, |next| next.start);
            cut.push(Piece {
                recording: piece.recording,
                frames: run.start.max(piece.frames.start)..end.min(piece.frames.end),
                material: Some(run.label.clone()),
            });
        }
    }
    cut
}

/// Returns the pieces whose label is not dropped.
///
/// # Errors
/// A label to drop that there is not; frames with an empty label.
fn labelled(
    recordings: &Recordings<'_>,
    mut pieces: Vec<Piece>,
    windows: &Windows,
) -> Result<Vec<Piece>, DataError> {
    let refused = |expected: String, found: String| {
        DataError::format(recordings.path, "labels", expected, found)
    };
    let label = |piece: &Piece| {
        piece
            .material
            .as_deref()
            .unwrap_or_default()
            .trim()
            .to_string()
    };
    let labels = sorted_names(&pieces.iter().map(label).collect::<Vec<_>>());
    let drops: Vec<&str> = windows.drop_labels.iter().map(|drop| drop.trim()).collect();
    if let Some(unknown) = drops
        .iter()
        .find(|drop| !labels.iter().any(|label| label == **drop))
    {
        let found = some_names(labels.iter().map(String::as_str));
        return Err(refused(format!("`{unknown}`, to drop"), found));
    }
    pieces.retain(|piece| !drops.contains(&label(piece).as_str()));
    let is_nameless = |piece: &&Piece| piece.material.is_some() && label(piece).is_empty();
    let nameless = pieces
        .iter()
        .filter(is_nameless)
        .map(|piece| piece.frames.len());
    match nameless.sum() {
        0_usize if pieces.is_empty() => Err(refused(
            "frames with a label that is not dropped".into(),
            "none".into(),
        )),
        0 => Ok(pieces),
        frames => {
            let found = format!("{frames} frames with an empty label");
            let error = refused("the material of each frame".into(), found);
            Err(error.with_remedy(Remedy::DropUnlabelled))
        }
    }
}

/// Returns the frames of a piece at the rate of the options, or as they are.
fn stretch(
    recordings: &Recordings<'_>,
    timing: &Timing,
    piece: &Piece,
    options: &ReadOptions,
) -> Result<Recording, DataError> {
    let recording = &recordings.recordings[piece.recording];
    let taxels = recordings.patch.taxels();
    let values = &recording.values[piece.frames.start * taxels..piece.frames.end * taxels];
    let values = match options.resample_hz {
        None => values.to_vec(),
        Some(to_hz) => {
            let rate = timing.odd_hz[piece.recording]
                .filter(|_| options.rate_hz.is_none())
                .or(timing.rate_hz);
            let from_hz = rate.ok_or_else(|| {
                let error =
                    DataError::format(recordings.path, "sample rate", "one, to resample", "none");
                error.with_remedy(Remedy::NameRate)
            })?;
            if !(to_hz > 0.0 && (1.0 / MOST..=MOST).contains(&(to_hz / from_hz))) {
                let expected = format!(
                    "a rate from {} to {} Hz, to resample {from_hz} Hz",
                    from_hz / MOST,
                    from_hz * MOST
                );
                return Err(DataError::format(
                    recordings.path,
                    "sample rate",
                    expected,
                    to_hz.to_string(),
                ));
            }
            match timing.clocks[piece.recording].as_ref() {
                Some(clock) if clock.exact && options.rate_hz.is_none() => {
                    let even = at_even_times(
                        values,
                        taxels,
                        &recording.seconds[piece.frames.clone()],
                        1.0 / from_hz,
                    );
                    to_rate(&even, taxels, from_hz, to_hz)
                }
                _ => to_rate(values, taxels, from_hz, to_hz),
            }
        }
    };
    let part = recording.part(recording.name.clone(), values, recording.block);
    Ok(Recording {
        material: piece.material.clone(),
        ..part
    })
}

/// Returns frames at even times, interpolated if their stamps are uneven.
fn at_even_times(values: &[f64], taxels: usize, seconds: &[f64], period: f64) -> Vec<f64> {
    let (Some(first), Some(last)) = (seconds.first(), seconds.last()) else {
        return Vec::new();
    };
    // A stretch misses at most so many frames between two.
    let most = (LOST_AT_ONCE + 2) as f64 * seconds.len() as f64;
    if are_even(seconds, period) || (last - first) / period > most {
        values.to_vec()
    } else {
        to_even(values, taxels, seconds, period)
    }
}

/// Returns the name of a window. Frames of the recording are counted at its own rate.
///
/// - `start`: first frame of the window in the stretch, at the rate `resample_hz` if there is one
fn window_name(
    stretch: &Recording,
    piece: &Piece,
    start: usize,
    resample_hz: Option<f64>,
) -> String {
    let (name, first) = (&stretch.name, piece.frames.start);
    match resample_hz {
        None => format!("{name}, from frame {}", first + start),
        Some(rate) => format!("{name}, {:.2} s after frame {first}", start as f64 / rate),
    }
}

/// Returns the windows of all stretches; each stretch is a block.
fn in_windows(
    recordings: &mut Recordings<'_>,
    timing: &Timing,
    pieces: &[Piece],
    stretches: &[Recording],
    windows: &Windows,
    options: &ReadOptions,
) -> Result<Vec<Recording>, DataError> {
    let taxels = recordings.patch.taxels();
    let rate = options.resample_hz.or(timing.rate_hz);
    let length = windows.length.steps(recordings.path, rate)?;
    let hop = windows
        .hop
        .unwrap_or(windows.length)
        .steps(recordings.path, rate)?;
    let (mut cut, mut block) = (Vec::new(), 0);
    let (mut short, mut left) = (0_usize, 0_usize);
    for (stretch, piece) in stretches.iter().zip(pieces) {
        let frames = stretch.frames(recordings.patch);
        let mut end = 0;
        for start in starts(frames, length, hop) {
            end = start + length;
            let name = window_name(stretch, piece, start, options.resample_hz);
            let values = stretch.values[start * taxels..end * taxels].to_vec();
            cut.push(stretch.part(name, values, stretch.block.or(Some(block))));
        }
        block += u32::from(end > 0);
        short += usize::from(end == 0);
        left += frames - end.min(frames);
    }
    if cut.is_empty() {
        let longest = stretches
            .iter()
            .map(|stretch| stretch.frames(recordings.patch))
            .max();
        let expected =
            format!("stretches of one label of at least {length} steps, the length of a window");
        let found = format!("{} steps in the longest", longest.unwrap_or(0));
        return Err(DataError::format(
            recordings.path,
            "recordings",
            expected,
            found,
        ));
    }
    recordings.findings.push(Finding::not_read(format!(
        "{} windows of {length} steps, {hop} steps apart, in {block} stretches of one label; {left} frames are in no window, {short} of the stretches are shorter",
        cut.len()
    )));
    Ok(cut)
}
