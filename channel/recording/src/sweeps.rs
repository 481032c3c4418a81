//! Conversion of recorded frames into a data set.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::iter::repeat_n;
use std::path::Path;

use tactnet_data::{Dataset, LabelSet, Samples, SweepRecord, SweepShape, ValueRange};
use tactnet_skin::packets::{Command, ModelNames, SkinFrame, SweepCommand};
use tactnet_skin::{Frame, Segmentation, ServeConfig, SweepChange, SweepSegmenter};

use crate::RecordingError;
use crate::recording::{Entry, RecordedPacket, Recording};

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

/// A complete sweep with its label.
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
    let mut config = ServeConfig::of(&recording.table)?;
    config.segmenter.values = config.segmenter.values.or_else(|| raw_digits(recording));
    let format = SweepFormat::of(path, recording, settings)?;
    let fallback = material.or(recording.material.as_deref());
    let mut cutter = Cutter::new(&config, &format, fallback);
    for entry in &recording.entries {
        cutter.take(entry);
    }
    let Cutter {
        complete,
        rejected,
        unlabelled,
        ..
    } = cutter;
    if complete.is_empty() {
        let reasons = match &rejected[..] {
            [] => String::new(),
            rejected => format!(" ({})", counted_reasons(rejected)),
        };
        return Err(RecordingError::Unreadable {
            path: path.into(),
            reason: format!(
                "no sweep with a label: {unlabelled} without, {} rejected{reasons}",
                rejected.len()
            ),
        });
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    Ok(Sweeps {
        dataset: dataset(&name, &format, &complete)?,
        rejected,
        unlabelled,
    })
}

/// Returns the distinct reasons with their numbers, the most frequent first.
fn counted_reasons(rejected: &[String]) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for reason in rejected {
        *counts.entry(reason).or_default() += 1;
    }
    let mut counts: Vec<(&str, usize)> = counts.into_iter().collect();
    counts.sort_by_key(|(_, count)| Reverse(*count));
    let shown = |(reason, count): &(&str, usize)| format!("{count} x {reason}");
    counts
        .iter()
        .take(3)
        .map(shown)
        .collect::<Vec<_>>()
        .join("; ")
}

/// Shape and rate of the sweeps in a recording.
struct SweepFormat<'a> {
    steps: usize,
    rows: usize,
    cols: usize,
    rate_hz: f64,
    model: Option<&'a ModelNames>,
}

impl<'a> SweepFormat<'a> {
    /// Returns the settings, completed from the recorded model and frames.
    fn of(
        path: &Path,
        recording: &'a Recording,
        settings: SweepSettings,
    ) -> Result<Self, RecordingError> {
        let unreadable = |reason: String| RecordingError::Unreadable {
            path: path.into(),
            reason,
        };
        let packets = || recording.entries.iter().map(|entry| &entry.packet);
        let model = packets().find_map(|packet| match packet {
            RecordedPacket::Model(model) => Some(&**model),
            _ => None,
        });
        let taxels = packets()
            .find_map(|packet| match packet {
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
                "expected sweeps of 1 to {frames} frames (the number of messages), found {steps}"
            )));
        }
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(unreadable(format!(
                "expected a positive frame rate, found {rate_hz} Hz"
            )));
        }
        Ok(Self {
            steps,
            rows,
            cols,
            rate_hz,
            model,
        })
    }
}

/// A finger with the material of its last start command.
struct Finger {
    segmenter: SweepSegmenter,
    material: Option<String>,
}

/// Cuts the entries of a recording into sweeps.
struct Cutter<'a> {
    config: &'a ServeConfig,
    by_command: bool,
    /// Label of sweeps whose start command names no material.
    fallback: Option<&'a str>,
    fingers: Vec<Finger>,
    complete: Vec<CompleteSweep>,
    rejected: Vec<String>,
    unlabelled: usize,
}

impl<'a> Cutter<'a> {
    fn new(config: &'a ServeConfig, format: &SweepFormat<'_>, fallback: Option<&'a str>) -> Self {
        let taxels = format.rows * format.cols;
        let finger = |_| Finger {
            segmenter: SweepSegmenter::new(config.segmenter, format.steps, taxels, format.rate_hz),
            material: None,
        };
        Self {
            config,
            by_command: config.segmenter.segmentation == Segmentation::Command,
            fallback,
            fingers: config.fingers.iter().map(finger).collect(),
            complete: Vec::new(),
            rejected: Vec::new(),
            unlabelled: 0,
        }
    }

    fn take(&mut self, entry: &Entry) {
        let outcome = match &entry.packet {
            RecordedPacket::Frame(frame) => self.frame(&entry.channel, frame),
            RecordedPacket::Command(command) if self.by_command => self.command(command),
            _ => None,
        };
        match outcome {
            Some((finger, SweepChange::Complete)) => self.complete(finger),
            Some((_, SweepChange::Rejected(reject) | SweepChange::RejectedAndBegun(reject))) => {
                self.rejected.push(reject.to_string());
            }
            _ => {}
        }
    }

    /// Returns the number of the finger and the change of its sweep.
    fn frame(&mut self, channel: &str, frame: &SkinFrame) -> Option<(usize, SweepChange)> {
        let number = self.config.fingers.iter().position(|id| **id == *channel)?;
        let change = self.fingers[number].segmenter.push(&Frame {
            sequence: frame.sequence,
            sensor_time_nanos: frame.sensor_time_ns,
            taxels: frame.values(),
        });
        Some((number, change))
    }

    /// Returns the number of the finger and the change of its sweep.
    fn command(&mut self, command: &SweepCommand) -> Option<(usize, SweepChange)> {
        let number = command.finger as usize;
        let finger = self.fingers.get_mut(number)?;
        let change = match command.command()? {
            Command::Start => {
                let change = finger.segmenter.start();
                let named = command.material.as_str();
                finger.material = (!named.is_empty()).then(|| named.to_owned());
                change
            }
            Command::Stop => finger.segmenter.stop(),
            _ => return None,
        };
        Some((number, change))
    }

    fn complete(&mut self, number: usize) {
        let finger = &self.fingers[number];
        let label = finger.material.as_deref().or(self.fallback);
        let window = finger.segmenter.window();
        match (label, window.first(window.kept())) {
            (Some(label), Some(digits)) => self.complete.push(CompleteSweep {
                material: label.into(),
                digits: digits.to_vec(),
            }),
            _ => self.unlabelled += 1,
        }
    }
}

/// Returns the sweeps as a data set.
///
/// Materials that the recorded model knows keep their order, so that a network trained on these sweeps can replace it.
fn dataset(
    name: &str,
    format: &SweepFormat<'_>,
    sweeps: &[CompleteSweep],
) -> Result<Dataset, RecordingError> {
    let mut names: Vec<&str> = Vec::new();
    if let Some(model) = format.model {
        let known = model.names.iter().take(model.materials as usize);
        names.extend(
            known
                .map(|name| name.as_str())
                .filter(|name| sweeps.iter().any(|sweep| sweep.material == *name)),
        );
    }
    let mut counts: Vec<usize> = vec![0; names.len()];
    let mut records = Vec::with_capacity(sweeps.len());
    for sweep in sweeps {
        let label = names
            .iter()
            .position(|name| *name == sweep.material)
            .unwrap_or_else(|| {
                names.push(&sweep.material);
                counts.push(0);
                names.len() - 1
            });
        records.push(SweepRecord::new(label, counts[label]));
        counts[label] += 1;
    }
    // The digits of an eight-bit skin stay bytes.
    let is_byte = |digit: &f32| digit.fract() == 0.0 && (0.0..=255.0).contains(digit);
    let taxels = format.rows * format.cols;
    let lengths: Vec<usize> = sweeps.iter().map(|s| s.digits.len() / taxels).collect();
    let longest = lengths.iter().copied().max().unwrap_or(format.steps);
    // Longer sweeps than the training sweeps differ in length; `with_lengths` writes what follows the end of a sweep.
    let padding = |sweep: &CompleteSweep| longest * taxels - sweep.digits.len();
    let digits = sweeps
        .iter()
        .flat_map(|sweep| sweep.digits.iter().chain(repeat_n(&0.0, padding(sweep))));
    let samples = if digits.clone().all(is_byte) {
        Samples::U8(digits.map(|digit| *digit as u8).collect())
    } else {
        Samples::F32(digits.copied().collect())
    };
    let shape = SweepShape {
        steps: longest,
        rows: format.rows,
        cols: format.cols,
    };
    let labels = LabelSet::new(names)?;
    let dataset = Dataset::new(name, format.rate_hz, shape, labels, records, samples)?;
    Ok(dataset.with_lengths(lengths)?)
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
