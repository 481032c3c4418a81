//! Rate of a data set and findings about its time stamps.

use super::clock::{Clock, Deviations, Jump, Lost, Pace};
use super::read_options::ReadOptions;
use super::recording::{Recording, Recordings};
use crate::{DataError, Finding, FindingKind, Place, Remedy, Severity};

/// Maximum relative difference between the rates of recordings of one data set. At 2 %, a vibration of 100 Hz in one
/// recording has the frequency bin of 102 Hz in another.
const OTHER_RATE: f64 = 0.02;
/// Relative difference between mean and median interval above which the stamps are irregular.
const IRREGULAR: f64 = 0.05;
/// Maximum length of all gaps of a recording together, relative to the rest. Features average over a sweep: with a longer
/// pause it consists of two recordings.
const LONG_GAPS: f64 = 0.1;
/// Maximum share of missing frames. More of them change the apparent frequencies as another rate does.
const MANY_LOST: f64 = 0.03;
/// Maximum relative difference between a rate that the caller names and the measured one that counts as equal.
const SAME_RATE: f64 = 1e-3;
/// Maximum number of findings of a kind that are listed.
const LISTED: usize = 1000;
/// Stamps of a clock that was not set yet, and stamps of one that was, in seconds since 1970.
const UNSET_CLOCK: f64 = 1e8;
const SET_CLOCK: f64 = 9e8;

/// Time stamps of all recordings of a data set.
pub(super) struct Timing {
    /// Sample rate in Hz; `None` without stamps and without a named rate.
    pub(super) rate_hz: Option<f64>,
    /// Clock of each recording, if it has stamps.
    pub(super) clocks: Vec<Option<Clock>>,
    /// Rate of each recording in Hz, if it differs from that of the data set.
    pub(super) odd_hz: Vec<Option<f64>>,
    pub(super) findings: Vec<Finding>,
}

/// Returns the rate in Hz of a time between two frames in seconds. Stamps are rounded: a rate within a thousandth of a
/// whole number is that number.
fn rate_of(period: f64) -> f64 {
    let rate = 1.0 / period;
    let whole = rate.round();
    if (rate - whole).abs() < 1e-3 * rate {
        whole
    } else {
        rate
    }
}

/// Returns a rate for messages.
fn hz(rate: f64) -> f64 {
    (100.0 * rate).round() / 100.0
}

impl Timing {
    /// Measures the time stamps of recordings.
    ///
    /// - `indices`: index of each recording among the sweeps of the data set, if it becomes one
    ///
    /// # Errors
    /// Stamps that give no rate, unless the options name one.
    pub(super) fn of(
        recordings: &Recordings<'_>,
        indices: &[Option<usize>],
        options: &ReadOptions,
    ) -> Result<Self, DataError> {
        let timed = recordings
            .recordings
            .iter()
            .filter(|of| !of.seconds.is_empty());
        let deviations = timed.map(|recording| Deviations::of(&recording.seconds));
        let all = deviations.fold(Deviations::default(), Deviations::and);
        let clock = |recording: &Recording| {
            (!recording.seconds.is_empty())
                .then(|| Clock::of(&recording.seconds, recordings.resolution, all))
        };
        let clocks: Vec<Option<Clock>> = recordings.recordings.iter().map(clock).collect();
        let mut timing = Self {
            rate_hz: options.rate_hz,
            odd_hz: vec![None; clocks.len()],
            clocks,
            findings: Vec::new(),
        };
        let mut periods: Vec<f64> = timing
            .clocks
            .iter()
            .flatten()
            .filter_map(Clock::period)
            .collect();
        periods.sort_unstable_by(f64::total_cmp);
        let usual = periods.get(periods.len() / 2).copied();
        match usual {
            None if options.rate_hz.is_none() && timing.clocks.iter().any(Option::is_some) => {
                return Err(no_rate(recordings));
            }
            None => {}
            Some(usual) => timing.measure(recordings, indices, options, usual),
        }
        timing.jumps(recordings, indices, options);
        Ok(timing)
    }

    /// Sets the rate from the stamps of all recordings of the usual rate.
    fn measure(
        &mut self,
        recordings: &Recordings<'_>,
        indices: &[Option<usize>],
        options: &ReadOptions,
        usual: f64,
    ) {
        let is_odd = |clock: &Clock| {
            let tolerance = OTHER_RATE + clock.uncertainty;
            clock
                .period()
                .is_some_and(|period| (usual / period - 1.0).abs() > tolerance)
        };
        let mut pace = Pace::default();
        let mut irregular: Vec<(usize, &Clock)> = Vec::new();
        for (at, clock) in self.clocks.iter().enumerate() {
            let Some(clock) = clock else { continue };
            if is_odd(clock) {
                self.odd_hz[at] = clock.period().map(rate_of);
                continue;
            }
            pace = pace.and(clock.pace);
            let period = clock.period();
            if period.is_some_and(|period| (clock.median / period - 1.0).abs() > IRREGULAR) {
                irregular.push((at, clock));
            }
        }
        let period = pace.period().unwrap_or(usual);
        let measured = rate_of(period);
        if let Some(finding) = irregular_rate(&irregular, self.clocks.len(), period) {
            self.findings.push(finding);
        }
        if let Some(named) = options
            .rate_hz
            .filter(|named| (named / measured - 1.0).abs() > SAME_RATE)
        {
            self.findings
                .push(named_rate(measured, named, "the time stamps give"));
        }
        self.rate_hz = Some(options.rate_hz.unwrap_or(measured));
        self.mixed_rates(recordings, indices, options, measured);
    }

    /// Adds a finding for each recording of another rate.
    fn mixed_rates(
        &mut self,
        recordings: &Recordings<'_>,
        indices: &[Option<usize>],
        options: &ReadOptions,
        measured: f64,
    ) {
        // Resampling gives all recordings one rate.
        let severity = match options.resample_hz {
            Some(_) => Severity::Note,
            None => Severity::Error,
        };
        for (at, own) in self.odd_hz.iter().enumerate() {
            let Some(own) = own else { continue };
            let message = format!(
                "{}: {} Hz, other than the {} Hz of most recordings, by the time stamps",
                subject(recordings, at),
                hz(*own),
                hz(measured)
            );
            let finding = Finding::new(severity, FindingKind::MixedRates, message)
                .at(place(recordings, indices, at, None))
                .with_remedy(Remedy::Resample);
            self.findings.push(finding);
        }
    }

    /// Adds findings about gaps, missing frames and clocks that go backwards.
    fn jumps(
        &mut self,
        recordings: &Recordings<'_>,
        indices: &[Option<usize>],
        options: &ReadOptions,
    ) {
        let (mut gaps, mut backwards, mut lost) = (Vec::new(), Vec::new(), Vec::new());
        for (at, clock) in self.clocks.iter().enumerate() {
            let Some(clock) = clock else { continue };
            let place = |frame| place(recordings, indices, at, Some(frame));
            let severity = severity_of_gaps(clock, options);
            for gap in &clock.gaps {
                let message = gap_message(recordings, at, gap, self.rate_hz);
                let finding = Finding::new(severity, FindingKind::TimeGap, message);
                gaps.push((finding, place(gap.frame)));
            }
            let severity = severity_of_backwards(options);
            for jump in &clock.backwards {
                let message = backwards_message(recordings, at, jump);
                let finding = Finding::new(severity, FindingKind::ClockBackwards, message);
                backwards.push((finding, place(jump.frame)));
            }
            if let Some(Lost { frame, frames }) = clock.lost {
                let all = recordings.recordings[at].seconds.len() + frames;
                let share = frames as f64 / all as f64;
                let message = lost_message(recordings, at, frame, frames, share);
                let severity = severity_of_lost(share, options);
                let finding = Finding::new(severity, FindingKind::LostFrames, message);
                lost.push((finding, place(frame)));
            }
        }
        for (mut findings, remedy) in [
            (gaps, Remedy::CutWindows),
            (backwards, Remedy::NameRate),
            (lost, Remedy::Resample),
        ] {
            let all = findings.len();
            findings.truncate(LISTED);
            if let Some((last, _)) = findings.last_mut().filter(|_| all > LISTED) {
                let more = format!(" (and {} more that are not listed)", all - LISTED);
                last.message.push_str(&more);
            }
            let with_cure = |(finding, place): (Finding, Place)| match finding.severity {
                // A recording that is cut or resampled is cured.
                Severity::Note => finding.at(place),
                _ => finding.at(place).with_remedy(remedy.clone()),
            };
            self.findings.extend(findings.into_iter().map(with_cure));
        }
    }
}

fn severity_of_gaps(clock: &Clock, options: &ReadOptions) -> Severity {
    let total: f64 = clock.gaps.iter().map(|gap| gap.seconds).sum();
    match (options.cuts(), total > LONG_GAPS * clock.duration) {
        (true, _) => Severity::Note,
        (false, true) => Severity::Error,
        (false, false) => Severity::Warning,
    }
}

/// Returns the severity of a clock that goes backwards. A named rate makes up for it.
fn severity_of_backwards(options: &ReadOptions) -> Severity {
    match (options.cuts(), options.rate_hz) {
        (true, _) => Severity::Note,
        (false, Some(_)) => Severity::Warning,
        (false, None) => Severity::Error,
    }
}

/// Returns the severity of lost frames. Stamps that are rounded may look like it; a named rate then decides.
fn severity_of_lost(share: f64, options: &ReadOptions) -> Severity {
    match (options.resample_hz, options.rate_hz) {
        (Some(_), _) => Severity::Note,
        (None, None) if share > MANY_LOST => Severity::Error,
        (None, _) => Severity::Warning,
    }
}

/// Returns a warning that a rate of the caller takes precedence over that of the data.
///
/// - `source`: subject and verb of the data's rate
pub(crate) fn named_rate(own: f64, named: f64, source: &str) -> Finding {
    let message = format!(
        "{source} {} Hz; the named {named} Hz takes precedence",
        hz(own)
    );
    Finding::new(Severity::Warning, FindingKind::NamedRate, message)
}

fn irregular_rate(irregular: &[(usize, &Clock)], all: usize, period: f64) -> Option<Finding> {
    let (_, clock) = irregular.first()?;
    let of = match all {
        1 => String::new(),
        _ => format!(" in {} of {all} recordings", irregular.len()),
    };
    let message = format!(
        "time stamps are irregular{of}: the mean time between frames is {}, the median {}; stamps are rounded or delayed, or frames are missing; \
         the rate of {} Hz is that of the mean",
        duration(clock.period().unwrap_or(period)),
        duration(clock.median),
        hz(rate_of(period))
    );
    let finding = Finding::new(Severity::Warning, FindingKind::IrregularRate, message);
    Some(finding.with_remedy(Remedy::NameRate))
}

/// Returns a time in a readable unit.
fn duration(seconds: f64) -> String {
    let digits = |value: f64| {
        // Four significant digits.
        let places = (3 - value.abs().max(1e-12).log10().floor() as i32).clamp(0, 6);
        let factor = 10_f64.powi(places);
        (value * factor).round() / factor
    };
    if seconds.abs() < 0.1 && seconds != 0.0 {
        format!("{} ms", digits(1e3 * seconds))
    } else {
        format!("{} s", digits(seconds))
    }
}

fn subject(recordings: &Recordings<'_>, at: usize) -> String {
    let recording = &recordings.recordings[at];
    format!("sweep `{}`", recordings.shown(recording))
}

/// Returns the place of a recording, or of one of its frames.
fn place(
    recordings: &Recordings<'_>,
    indices: &[Option<usize>],
    at: usize,
    frame: Option<usize>,
) -> Place {
    let recording = &recordings.recordings[at];
    Place {
        file: (recording.file != recordings.path).then(|| recording.file.clone()),
        line: frame.and_then(|frame| recording.lines.get(frame).copied()),
        material: recording.material.clone(),
        sweep: indices.get(at).copied().flatten(),
        step: frame,
        ..Place::default()
    }
}

/// Returns frame and line of a frame in words.
fn before(recordings: &Recordings<'_>, at: usize, frame: usize) -> String {
    match recordings.recordings[at].lines.get(frame) {
        Some(line) => format!("before frame {frame} (line {line})"),
        None => format!("before frame {frame}"),
    }
}

fn gap_message(recordings: &Recordings<'_>, at: usize, gap: &Jump, rate: Option<f64>) -> String {
    let seconds = &recordings.recordings[at].seconds;
    let frames = rate.map_or(String::new(), |rate| {
        format!(", as long as {:.0} frames", gap.seconds * rate)
    });
    let set = match seconds[gap.frame - 1] < UNSET_CLOCK && seconds[gap.frame] > SET_CLOCK {
        true => "; the clock was set during the recording",
        false => "",
    };
    format!(
        "{}: no frame for {}{frames}, {}{set}",
        subject(recordings, at),
        duration(gap.seconds),
        before(recordings, at, gap.frame)
    )
}

fn backwards_message(recordings: &Recordings<'_>, at: usize, jump: &Jump) -> String {
    let seconds = &recordings.recordings[at].seconds;
    format!(
        "{}: the time goes back from {} s to {} s {}",
        subject(recordings, at),
        seconds[jump.frame - 1],
        seconds[jump.frame],
        before(recordings, at, jump.frame)
    )
}

fn lost_message(
    recordings: &Recordings<'_>,
    at: usize,
    frame: usize,
    frames: usize,
    share: f64,
) -> String {
    let all = recordings.recordings[at].seconds.len() + frames;
    format!(
        "{}: {frames} of {all} frames are missing ({:.1} %), the first {}",
        subject(recordings, at),
        100.0 * share,
        before(recordings, at, frame)
    )
}

/// Returns the error of stamps that give no rate.
fn no_rate(recordings: &Recordings<'_>) -> DataError {
    let longest = recordings
        .recordings
        .iter()
        .map(|recording| recording.seconds.len())
        .max();
    let found = match longest {
        Some(0 | 1) | None => "a single frame",
        _ => "equal times in all frames",
    };
    let expected = "seconds that grow from frame to frame";
    DataError::format(recordings.path, "column `time`", expected, found)
        .with_remedy(Remedy::NameRate)
}
