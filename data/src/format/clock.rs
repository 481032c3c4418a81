//! Rate, gaps and lost frames of one recording, by the time stamps of its frames.
//!
//! Loggers round time stamps, deliver frames in bursts, delay and lose some. The period is the duration of stretches
//! without a gap, divided by the number of intervals. If deviations of the stamps cancel out, as those of rounding and
//! bursts do, the duration is that of the least-squares line through the stamps: they move the ends of a stretch, but
//! hardly its slope.

use std::ops::Range;

/// Time without a frame, in seconds, that is always a gap: drivers and networks buffer frames for a shorter time.
const LONGEST_BUFFER: f64 = 2.0;
/// Missing frames above which an interval is a gap. Fewer are lost frames: they can be interpolated.
pub(super) const LOST_AT_ONCE: usize = 5;
/// An interval that is longer than `LOST_AT_ONCE` frames and a half may be a gap.
const MAYBE_A_GAP: f64 = LOST_AT_ONCE as f64 + 1.5;
/// Share of the intervals that are not exceptions, by their length. One in twenty may be a pause between bursts.
const USUAL: f64 = 0.95;
/// Number of frames after a delay within which late frames catch up.
const CATCH_UP: usize = 32;
/// Minimum share of intervals that are near a multiple of the period, if the clock is steady.
const STEADY: f64 = 0.9;
/// Maximum distance from a multiple of the period, in periods, of an interval that is near it.
const NEAR: f64 = 0.25;
/// Number of intervals whose sum shows if deviations of the stamps cancel out.
const SUMMED: usize = 8;
/// Resolution of clocks that count whole milliseconds, in seconds.
const MILLISECOND: f64 = 1e-3;
/// Maximum period of a steady clock, in units of the stamps' resolution, whose multiples may come from rounding: rounding
/// a period of 1.33 units gives intervals of 1 and 2.
const ROUNDED: f64 = 1.67;
/// Number of such sums of a recording that suffice to decide for it alone.
const ENOUGH: usize = 1000;
/// Variance of such sums, relative to independent intervals, below which deviations cancel out. Errors of the stamps
/// (rounding, delays) give about 1/8, lost frames about 1.
const CANCELLED: f64 = 0.5;

/// Irregular interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Jump {
    /// Frame after the interval.
    pub(super) frame: usize,
    /// Length of the interval, in seconds; negative if the clock goes backwards.
    pub(super) seconds: f64,
}

/// Frames that are missing without a gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Lost {
    /// First frame after a missing one.
    pub(super) frame: usize,
    /// Number of missing frames.
    pub(super) frames: usize,
}

/// Time that passes in a number of frames.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Pace {
    seconds: f64,
    frames: f64,
}

impl Pace {
    /// Returns the pace of the frames of both.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            seconds: self.seconds + other.seconds,
            frames: self.frames + other.frames,
        }
    }

    /// Returns the time between two frames, in seconds; `None` if time does not pass.
    pub(super) fn period(self) -> Option<f64> {
        let period = self.seconds / self.frames;
        (period.is_finite() && period > 0.0).then_some(period)
    }
}

/// Time stamps of one recording.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Clock {
    /// Time and frames of all stretches, with missing frames.
    pub(super) pace: Pace,
    /// Middle of the sorted intervals within stretches, in seconds.
    pub(super) median: f64,
    /// Total length of the stretches, in seconds.
    pub(super) duration: f64,
    /// Possible error of the period, relative to it.
    pub(super) uncertainty: f64,
    /// Stretches without a gap.
    pub(super) stretches: Vec<Range<usize>>,
    /// Intervals without frames.
    pub(super) gaps: Vec<Jump>,
    /// Intervals of negative length.
    pub(super) backwards: Vec<Jump>,
    /// Missing frames outside gaps.
    pub(super) lost: Option<Lost>,
    /// True if every stamp is the time of its frame; false if frames are even and the deviations of stamps cancel out.
    pub(super) exact: bool,
}

impl Clock {
    /// Measures the time stamps of a recording.
    ///
    /// - `seconds`: finite stamps, in seconds
    /// - `resolution`: unit of the last digit with which all stamps are written, in seconds; 0 if that is not known
    /// - `all`: deviations of all recordings, which decide for short ones
    pub(super) fn of(seconds: &[f64], resolution: f64, all: Deviations) -> Self {
        let intervals = intervals(seconds);
        let mut backwards = Vec::new();
        for (at, &seconds) in intervals.iter().enumerate() {
            if seconds < 0.0 {
                let frame = at + 1;
                backwards.push(Jump { frame, seconds });
            }
        }
        let limit = Limit::of(&intervals);
        let pieces = limit.pieces(&intervals);
        let own = Deviations::within(seconds, &intervals, &pieces);
        let cancel = match own.stretches {
            ENOUGH.. => own.cancel(),
            _ => all.cancel(),
        };
        let unit = match limit.bursts {
            true => None,
            false => {
                let resolution = resolution.max(whole_milliseconds(seconds));
                steady_period(&intervals, &pieces, resolution, cancel)
            }
        };
        let period = unit.unwrap_or_else(|| mean(&intervals, &pieces));
        let (gaps, missing) = jumps(seconds, &intervals, &limit, unit, period);
        let mut cuts: Vec<usize> = gaps
            .iter()
            .chain(&backwards)
            .map(|jump| jump.frame - 1)
            .collect();
        cuts.sort_unstable();
        let stretches = between(&cuts, seconds.len());
        let mut inner: Vec<f64> = stretches
            .iter()
            .flat_map(|range| &intervals[range.start..range.end - 1])
            .copied()
            .collect();
        inner.sort_unstable_by(f64::total_cmp);
        let exact = unit.is_some() || !(limit.bursts || cancel);
        let pace = match exact {
            true => between_ends(seconds, &stretches, &missing),
            false => along_a_line(seconds, &stretches),
        };
        Self {
            pace,
            median: inner.get(inner.len() / 2).copied().unwrap_or(0.0),
            duration: inner.iter().sum(),
            uncertainty: uncertainty(&inner, pace, exact, !missing.is_empty()),
            stretches,
            gaps,
            backwards,
            lost: missing.first().map(|first| Lost {
                frame: first.frame,
                frames: missing.iter().map(|lost| lost.frames).sum(),
            }),
            exact,
        }
    }

    /// Returns the time between two frames, in seconds; `None` for a single frame or equal stamps.
    pub(super) fn period(&self) -> Option<f64> {
        self.pace.period()
    }
}

/// Returns the possible error of a period, relative to it.
///
/// - `intervals`: within stretches, sorted
fn uncertainty(intervals: &[f64], pace: Pace, exact: bool, some_are_missing: bool) -> f64 {
    let (Some(period), Some(longest)) = (pace.period(), intervals.last()) else {
        return f64::INFINITY;
    };
    // Intervals of a steady clock with missing frames are multiples of the period.
    if some_are_missing {
        return 0.0;
    }
    // A buffer or rounding moves an end by at most one interval.
    let of_ends = (longest - period) / pace.seconds;
    let count = intervals.len() as f64;
    let variance = intervals
        .iter()
        .map(|interval| (interval - period).powi(2))
        .sum::<f64>()
        / count;
    // Three standard errors of the mean of independent intervals.
    let of_mean = if exact {
        3.0 * (variance / count).sqrt() / period
    } else {
        0.0
    };
    of_ends.max(of_mean)
}

/// Returns gaps and lost frames.
///
/// - `unit`: period of a steady clock; frames of another clock are not missed singly
fn jumps(
    seconds: &[f64],
    intervals: &[f64],
    limit: &Limit,
    unit: Option<f64>,
    period: f64,
) -> (Vec<Jump>, Vec<Lost>) {
    let (mut gaps, mut missing) = (Vec::new(), Vec::new());
    for (at, &length) in intervals.iter().enumerate() {
        let is_long = length > 1.5 * period && (unit.is_some() || length > limit.gap);
        if !is_long {
            continue;
        }
        let (frame, frames) = (at + 1, missing_after(seconds, at, period));
        if length > limit.buffer || frames > LOST_AT_ONCE {
            gaps.push(Jump {
                frame,
                seconds: length,
            });
        } else if unit.is_some() && frames > 0 {
            missing.push(Lost { frame, frames });
        }
    }
    (gaps, missing)
}

/// Lengths of intervals above which they are gaps, in seconds.
struct Limit {
    /// No buffer holds frames for longer.
    buffer: f64,
    /// Longer than the other intervals, so that frames are missing or late.
    gap: f64,
    /// True if frames come in long bursts, between which nearly all of the time passes.
    bursts: bool,
}

impl Limit {
    fn of(intervals: &[f64]) -> Self {
        let mut sorted: Vec<f64> = intervals.iter().copied().filter(|s| *s >= 0.0).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        let buffer = LONGEST_BUFFER.max(10.0 * median);
        sorted.retain(|seconds| *seconds <= buffer);
        let usual = (USUAL * sorted.len().saturating_sub(1) as f64) as usize;
        let gap = MAYBE_A_GAP * sorted.get(usual).copied().unwrap_or(0.0);
        let total: f64 = sorted.iter().sum();
        let long = sorted.partition_point(|seconds| *seconds <= gap);
        let inside: f64 = sorted[..long].iter().sum();
        let bursts = inside < 0.5 * total && (sorted.len() - long >= 3 || inside == 0.0);
        Self {
            buffer,
            gap: if bursts { buffer } else { gap.min(buffer) },
            bursts,
        }
    }

    /// Returns the ranges of frames between gaps and steps back.
    fn pieces(&self, intervals: &[f64]) -> Vec<Range<usize>> {
        let breaks = |at: &usize| !(0.0..=self.gap).contains(&intervals[*at]);
        let cuts: Vec<usize> = (0..intervals.len()).filter(breaks).collect();
        between(&cuts, intervals.len() + 1)
    }
}

fn intervals(seconds: &[f64]) -> Vec<f64> {
    seconds.array_windows().map(|&[a, b]| b - a).collect()
}

/// Returns the ranges of frames between cuts.
///
/// - `cuts`: frames before a cut, in order
fn between(cuts: &[usize], frames: usize) -> Vec<Range<usize>> {
    let starts = std::iter::once(0).chain(cuts.iter().map(|at| at + 1));
    let ends = cuts.iter().map(|at| at + 1).chain([frames]);
    starts
        .zip(ends)
        .map(|(start, end)| start..end)
        .filter(|range| !range.is_empty())
        .collect()
}

/// Returns the mean interval within the pieces, in seconds.
fn mean(intervals: &[f64], pieces: &[Range<usize>]) -> f64 {
    let inner = pieces
        .iter()
        .flat_map(|piece| &intervals[piece.start..piece.end - 1]);
    let count = inner.clone().count();
    inner.sum::<f64>() / count.max(1) as f64
}

/// Returns the period of a steady clock, in seconds: nearly all intervals are near a multiple of it, and longer intervals
/// are not compensated by shorter ones.
///
/// - `cancel`: true if deviations from the mean cancel out
fn steady_period(
    intervals: &[f64],
    pieces: &[Range<usize>],
    resolution: f64,
    cancel: bool,
) -> Option<f64> {
    let mut inner: Vec<f64> = pieces
        .iter()
        .flat_map(|piece| &intervals[piece.start..piece.end - 1])
        .copied()
        .collect();
    let middle = inner.len() / 2;
    if inner.is_empty() {
        return None;
    }
    let (_, &mut median, _) = inner.select_nth_unstable_by(middle, f64::total_cmp);
    if median <= 0.0 {
        return None;
    }
    let (mut near, mut once, mut twice, mut sum) = (0_usize, 0_usize, 0_usize, 0.0);
    for &interval in &inner {
        let periods = (interval / median).round();
        let is_near = periods >= 1.0 && (interval / median - periods).abs() <= NEAR;
        near += usize::from(is_near);
        if is_near && periods == 1.0 {
            once += 1;
            sum += interval;
        }
        twice += usize::from(is_near && periods == 2.0);
    }
    if (near as f64) < STEADY * inner.len() as f64 {
        return None;
    }
    // Frames that are lost regularly, never two at once: only rounding could explain such stamps otherwise.
    let regularly =
        once + twice == inner.len() && 2 * once >= inner.len() && median > ROUNDED * resolution;
    let steady = once == inner.len() || regularly || !cancel;
    steady.then(|| sum / once.max(1) as f64)
}

/// Returns the resolution of stamps that are whole milliseconds, in seconds, otherwise 0.
fn whole_milliseconds(seconds: &[f64]) -> f64 {
    let is_whole = |time: &f64| {
        let milliseconds = time / MILLISECOND;
        // Unix times have an error of a quarter of a microsecond.
        (milliseconds - milliseconds.round()).abs() < 1e-3
    };
    if seconds.iter().all(is_whole) {
        MILLISECOND
    } else {
        0.0
    }
}

/// Squared deviations from the mean interval, relative to it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Deviations {
    /// Sum over stretches of a few intervals.
    of_stretches: f64,
    /// Sum over the intervals of these stretches.
    of_intervals: f64,
    /// Number of stretches.
    stretches: usize,
}

impl Deviations {
    /// Returns the deviations of a recording.
    ///
    /// - `seconds`: finite stamps, in seconds
    pub(super) fn of(seconds: &[f64]) -> Self {
        let intervals = intervals(seconds);
        Self::within(
            seconds,
            &intervals,
            &Limit::of(&intervals).pieces(&intervals),
        )
    }

    fn within(seconds: &[f64], intervals: &[f64], pieces: &[Range<usize>]) -> Self {
        let mean = mean(intervals, pieces);
        let mut all = Self::default();
        if mean <= 0.0 {
            return all;
        }
        for piece in pieces {
            for first in piece.start..piece.end.saturating_sub(SUMMED) {
                let sum = (seconds[first + SUMMED] - seconds[first]) / mean - SUMMED as f64;
                all.of_stretches += sum * sum;
                let apart = intervals[first..first + SUMMED].iter();
                all.of_intervals += apart.map(|s| (s / mean - 1.0).powi(2)).sum::<f64>();
                all.stretches += 1;
            }
        }
        all
    }

    /// Returns the deviations of both.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            of_stretches: self.of_stretches + other.of_stretches,
            of_intervals: self.of_intervals + other.of_intervals,
            stretches: self.stretches + other.stretches,
        }
    }

    /// Returns true if deviations cancel out within a few frames: the stamps are inexact, the frames are even.
    fn cancel(self) -> bool {
        // Few frames do not show that any are lost.
        self.stretches == 0 || self.of_stretches < CANCELLED * self.of_intervals
    }
}

/// Returns the number of frames that are missing in an interval. Frames that are only late are not: the next ones follow
/// faster.
///
/// - `at`: frame before the interval
fn missing_after(seconds: &[f64], at: usize, period: f64) -> usize {
    let next = seconds[at + 1..]
        .iter()
        .take(CATCH_UP)
        .take_while(|next| **next >= seconds[at]);
    let excess = next
        .enumerate()
        .map(|(more, next)| next - seconds[at] - (more + 1) as f64 * period);
    let least = excess.fold(f64::INFINITY, f64::min);
    // The cast of a negative number is 0.
    (least / period).round() as usize
}

/// Returns time and frames between the ends of all stretches: the mean of independent intervals.
///
/// - `missing`: frames that count as well
fn between_ends(seconds: &[f64], stretches: &[Range<usize>], missing: &[Lost]) -> Pace {
    let lost: usize = missing.iter().map(|lost| lost.frames).sum();
    let mut pace = Pace {
        seconds: 0.0,
        frames: lost as f64,
    };
    for stretch in stretches {
        pace.seconds += seconds[stretch.end - 1] - seconds[stretch.start];
        pace.frames += (stretch.len() - 1) as f64;
    }
    pace
}

/// Returns time and frames along the least-squares line through the stamps of each stretch: errors of the stamps at the
/// ends hardly change its slope.
fn along_a_line(seconds: &[f64], stretches: &[Range<usize>]) -> Pace {
    let mut pace = Pace::default();
    for stretch in stretches.iter().filter(|stretch| stretch.len() > 1) {
        let middle = 0.5 * (stretch.len() - 1) as f64;
        let (mut covariance, mut variance) = (0.0, 0.0);
        for (frame, time) in seconds[stretch.clone()].iter().enumerate() {
            let position = frame as f64 - middle;
            covariance += position * (time - seconds[stretch.start]);
            variance += position * position;
        }
        let frames = (stretch.len() - 1) as f64;
        pace.seconds += covariance / variance * frames;
        pace.frames += frames;
    }
    pace
}
