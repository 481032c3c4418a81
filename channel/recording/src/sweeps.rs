//! Conversion of recorded frames into a data set.

use std::path::Path;

use tactnet_data::{Dataset, LabelSet, Samples, SweepRecord, SweepShape, ValueRange};
use tactnet_skin::packets::Command;
use tactnet_skin::{Frame, Segmentation, ServeConfig, SweepChange, SweepSegmenter};

use crate::RecordingError;
use crate::recording::{RecordedPacket, Recording};

/// Shape and rate of the sweeps, for recordings that do not contain them.
#[derive(Debug, Clone, Copy, Default)]
pub struct SweepSettings {
    /// Frames per sweep [default: as in the recorded model, otherwise 1000].
    pub steps: Option<usize>,
    /// Frames per second [default: as in the recorded model, otherwise estimated from the frames' clock].
    pub rate_hz: Option<f64>,
    /// Rows and columns of taxels [default: as in the recorded model, otherwise a square].
    pub rows_cols: Option<(usize, usize)>,
}

/// Sweeps of a recording.
#[derive(Debug)]
pub struct Sweeps {
    /// Labelled sweeps.
    pub dataset: Dataset,
    /// Reasons why sweeps were rejected, one per sweep.
    pub rejected: Vec<String>,
    /// Number of complete sweeps without a label.
    pub unlabelled: usize,
}

/// A complete sweep.
struct CompleteSweep {
    material: String,
    digits: Vec<f32>,
}

/// Cuts a recording into sweeps like the online classifier. The label is the material of the start command, otherwise
/// that of the recording.
///
/// # Errors
/// No sweep has a label; the number of taxels is not a square number and no model gives their rows and columns.
pub fn sweeps(
    path: &Path,
    recording: &Recording,
    material: Option<&str>,
    settings: SweepSettings,
) -> Result<Sweeps, RecordingError> {
    let unreadable = |reason: String| RecordingError::Unreadable {
        path: path.into(),
        reason,
    };
    let mut config = ServeConfig::of(&recording.table)?;
    config.segmenter.values = config.segmenter.values.or_else(|| raw_digits(recording));
    let model = recording
        .entries
        .iter()
        .find_map(|entry| match &entry.packet {
            RecordedPacket::Model(model) => Some(model),
            _ => None,
        });
    let taxels = recording
        .entries
        .iter()
        .find_map(|entry| match &entry.packet {
            RecordedPacket::Frame(frame) => Some(frame.values().len()),
            _ => None,
        })
        .ok_or_else(|| unreadable("no frame".into()))?;
    let steps = settings
        .steps
        .or(model.map(|model| model.steps as usize))
        .unwrap_or(1000);
    let rate_hz = settings
        .rate_hz
        .or(model.map(|model| model.sample_rate_hz))
        .or_else(|| rate_of(recording))
        .ok_or_else(|| RecordingError::UnknownRate { path: path.into() })?;
    let (rows, cols) = settings
        .rows_cols
        .or(model.map(|model| (model.rows as usize, model.cols as usize)))
        .unwrap_or((taxels.isqrt(), taxels.isqrt()));
    if rows * cols != taxels {
        return Err(RecordingError::WrongShape {
            path: path.into(),
            taxels,
            rows,
            cols,
        });
    }
    let frames = recording.entries.len();
    if steps == 0 || steps > frames {
        return Err(unreadable(format!(
            "expected at least {steps} frames for one sweep, found {frames} messages"
        )));
    }
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        return Err(unreadable(format!(
            "expected a positive frame rate, found {rate_hz} Hz"
        )));
    }
    let fallback = material.or(recording.material.as_deref());
    let by_command = config.segmenter.segmentation == Segmentation::Command;
    let mut fingers: Vec<(SweepSegmenter, Option<String>)> = config
        .fingers
        .iter()
        .map(|_| {
            (
                SweepSegmenter::new(config.segmenter, steps, taxels, rate_hz),
                None,
            )
        })
        .collect();
    let mut found: Vec<CompleteSweep> = Vec::new();
    let mut rejected = Vec::new();
    let mut unlabelled = 0;
    for entry in &recording.entries {
        let (number, change) = match &entry.packet {
            RecordedPacket::Frame(frame) => {
                let Some(number) = config.fingers.iter().position(|id| **id == *entry.channel)
                else {
                    continue;
                };
                let change = fingers[number].0.push(&Frame {
                    sequence: frame.sequence,
                    sensor_time_nanos: frame.sensor_time_ns,
                    taxels: frame.values(),
                });
                (number, change)
            }
            RecordedPacket::Command(command) => {
                let number = command.finger as usize;
                let Some((segmenter, material)) = fingers.get_mut(number) else {
                    continue;
                };
                match command.command() {
                    Some(Command::Start) if by_command => {
                        let change = segmenter.start();
                        let named = command.material.as_str();
                        *material = (!named.is_empty()).then(|| named.to_owned());
                        (number, change)
                    }
                    Some(Command::Stop) if by_command => (number, segmenter.stop()),
                    _ => continue,
                }
            }
            _ => continue,
        };
        match change {
            SweepChange::Complete => {
                let (segmenter, material) = &fingers[number];
                let label = material.as_deref().or(fallback);
                match (label, segmenter.window().sweep()) {
                    (Some(label), Some(digits)) => found.push(CompleteSweep {
                        material: label.into(),
                        digits: digits.to_vec(),
                    }),
                    _ => unlabelled += 1,
                }
            }
            SweepChange::Rejected(reject) | SweepChange::RejectedAndBegun(reject) => {
                rejected.push(reject.to_string());
            }
            SweepChange::Unchanged | SweepChange::Begun | SweepChange::Extended => {}
        }
    }
    if found.is_empty() {
        return Err(unreadable(format!(
            "no sweep with a label: {unlabelled} without, {} rejected",
            rejected.len()
        )));
    }
    // Materials that the recorded model knows keep their order, so that a network trained on these sweeps can replace
    // it.
    let mut names: Vec<&str> = Vec::new();
    if let Some(model) = model {
        let known = model.names.iter().take(model.materials as usize);
        names.extend(
            known
                .map(|name| name.as_str())
                .filter(|name| found.iter().any(|sweep| sweep.material == *name)),
        );
    }
    let mut counts: Vec<usize> = vec![0; names.len()];
    let mut records = Vec::with_capacity(found.len());
    for sweep in &found {
        let label = names
            .iter()
            .position(|name| *name == sweep.material)
            .unwrap_or_else(|| {
                names.push(&sweep.material);
                counts.push(0);
                names.len() - 1
            });
        records.push(SweepRecord {
            label,
            sweep: counts[label],
            block: None,
            test: None,
        });
        counts[label] += 1;
    }
    let labels = LabelSet::new(names)?;
    // The digits of an eight-bit skin stay bytes.
    let is_byte = |digit: &f32| digit.fract() == 0.0 && (0.0..=255.0).contains(digit);
    let digits = found.iter().flat_map(|sweep| &sweep.digits);
    let samples = if digits.clone().all(is_byte) {
        Samples::U8(digits.map(|digit| *digit as u8).collect())
    } else {
        Samples::F32(digits.copied().collect())
    };
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let dataset = Dataset::new(
        &*name,
        rate_hz,
        SweepShape { steps, rows, cols },
        labels,
        records,
        samples,
    )?;
    Ok(Sweeps {
        dataset,
        rejected,
        unlabelled,
    })
}

/// Returns 0 and 255 if all digits are in that range, which is that of a raw eight-bit skin. Other ranges are unknown.
fn raw_digits(recording: &Recording) -> Option<[f32; 2]> {
    let ranges = recording
        .entries
        .iter()
        .filter_map(|entry| match &entry.packet {
            RecordedPacket::Frame(frame) => ValueRange::of_frame(frame.values()),
            _ => None,
        });
    let mut limits = ranges.map(|range| range.limits());
    let first = limits.next()?;
    (first == ValueRange::DIGITS && limits.all(|other| other == first)).then_some(first)
}

/// Returns the frames per second, from numbers and times of the first and last frame of a finger.
fn rate_of(recording: &Recording) -> Option<f64> {
    let frames = recording
        .entries
        .iter()
        .filter_map(|entry| match &entry.packet {
            RecordedPacket::Frame(frame) => Some((&entry.channel, frame)),
            _ => None,
        });
    let (channel, first) = frames.clone().next()?;
    let (_, last) = frames.rev().find(|(other, _)| *other == channel)?;
    let time_ns = last.sensor_time_ns.checked_sub(first.sensor_time_ns)?;
    let periods = last.sequence.checked_sub(first.sequence)?;
    (time_ns > 0 && periods > 0).then(|| periods as f64 * 1e9 / time_ns as f64)
}
