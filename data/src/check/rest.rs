//! Frames of a sensor at rest, to tell them from frames that were lost or added.

use super::sweep_statistics::{Run, SweepStatistics};
use super::taxel_limits::TaxelLimits;
use crate::Dataset;

/// Maximum share of repeated frames in motion below which a run of them is significant; sensors of coarse resolution, such
/// as event counts, repeat more of them.
const REPEATED_SHARE: f64 = 0.05;
/// Maximum share of repeated values of single taxels in motion. A sensor of fine resolution hardly ever repeats a value,
/// so that no frame of it is equal to the one before, at rest neither.
const REPEATED_VALUES: f64 = 0.02;
/// Expected number of runs by accident, in the whole data set, that is accepted.
const ACCIDENTS: f64 = 0.01;
/// Number of frames before and after a run in which repeated values are counted: at least, and at most.
const NEARBY_FRAMES: [usize; 2] = [10, 64];
/// Number of moving taxels from which two of them are independent: their common force and their noise.
const INDEPENDENT_TAXELS: usize = 4;
/// Maximum difference to a frame at rest, as a share of the usual largest deviation of the taxel.
const REST_TOLERANCE: f32 = 0.1;
/// Maximum difference of the frames next to a run to the frames in it for the signal to fade, as a share of the usual
/// largest deviation of the taxel: a finger that is lifted leaves in several frames.
const FADE_TOLERANCE: f32 = 0.2;
/// Minimum share of sweeps with zero frames in the middle for these to be lifts of the finger, if the signal fades.
const LIFTED_SHARE: f64 = 0.1;
/// Number of runs in the middle of the median sweep from which a sensor repeats frames, for example because it is slower
/// than the recording.
const USUAL_RUNS: usize = 2;
/// Distance of zero from the median, in usual largest deviations, from which zero is an unusual value of a taxel.
const FAR_ZERO: f32 = 1.5;
/// Minimum share of sweeps that begin or end with equal frames for these to be frames at rest.
const RESTING_SHARE: f64 = 0.02;
/// Maximum number of sweeps from which frames at rest and repeated values are counted.
const COUNTED_SWEEPS: usize = 64;

/// End of the sweeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    Head,
    Tail,
}

/// Frames that a data set repeats, in motion and at rest.
pub(super) struct Rest<'a> {
    dataset: &'a Dataset,
    /// Usual values of each taxel.
    limits: &'a [TaxelLimits],
    /// Tolerance of each taxel.
    tolerance: Vec<f32>,
    /// Usual frames at rest at the beginning and at the end of sweeps, if the sensor rests there.
    head: Option<RestFrame>,
    tail: Option<RestFrame>,
    /// Number of pairs of neighbouring frames in motion, at least 1.
    pairs: f64,
    /// Share of them that are equal.
    repeated_share: f64,
    /// True if the sensor hardly ever repeats a value.
    pub(super) is_fine: bool,
    /// True if the signal often fades before it is zero, and returns so.
    has_lifts: bool,
}

/// Usual frame at rest.
struct RestFrame {
    values: Vec<f32>,
    /// Usual change from the rest to the motion, or back.
    change: f32,
    /// True if most motions begin or end gradually.
    fades: bool,
}

impl<'a> Rest<'a> {
    pub(super) fn of(
        dataset: &'a Dataset,
        sweeps: &[SweepStatistics],
        limits: &'a [TaxelLimits],
    ) -> Self {
        let in_runs = |sweep: &SweepStatistics| -> usize {
            sweep.runs.iter().map(|run| run.frames - 1).sum()
        };
        let mut runs: Vec<usize> = sweeps
            .iter()
            .map(|sweep| sweep.middle_runs().count())
            .collect();
        runs.sort_unstable();
        let repeats_frames = runs[runs.len() / 2] >= USUAL_RUNS;
        let pairs: usize = sweeps
            .iter()
            .map(|sweep| (sweep.steps - 1).saturating_sub(in_runs(sweep)))
            .sum();
        let repeated: usize = sweeps.iter().map(|sweep| sweep.repeated).sum();
        let (pairs, repeated) = (pairs.max(1) as f64, repeated as f64);
        let whole = f32::from(u8::from(dataset.samples().element_max().is_some()));
        let mut rest = Self {
            dataset,
            limits,
            tolerance: limits
                .iter()
                .map(|limits| (REST_TOLERANCE * limits.deviation).max(whole))
                .collect(),
            head: rest_frame(dataset, sweeps, End::Head),
            tail: rest_frame(dataset, sweeps, End::Tail),
            pairs,
            repeated_share: if repeats_frames {
                1.0
            } else {
                repeated / pairs
            },
            is_fine: repeated_values(dataset, sweeps) <= REPEATED_VALUES,
            has_lifts: false,
        };
        for end in [End::Head, End::Tail] {
            let runs = sweeps.iter().map(|sweep| run_at(end, sweep));
            let fading = rest.share_fading(runs.enumerate());
            let of_end = match end {
                End::Head => &mut rest.head,
                End::Tail => &mut rest.tail,
            };
            if let Some(of_end) = of_end {
                of_end.fades = fading >= 0.5;
            }
        }
        let lifted = |(index, sweep): (usize, &SweepStatistics)| {
            let mut runs = sweep.middle_runs();
            runs.any(|run| rest.is_zero(index, run) && rest.fades(index, run))
        };
        let lifted = sweeps.iter().enumerate().filter(|of| lifted(*of)).count();
        rest.has_lifts = lifted as f64 >= LIFTED_SHARE * sweeps.len() as f64;
        rest
    }

    /// Returns the share of these runs before or after which the signal fades.
    fn share_fading<'r>(&self, runs: impl Iterator<Item = (usize, Option<&'r Run>)>) -> f64 {
        let (mut fading, mut all) = (0, 0);
        for (sweep, run) in runs {
            if let Some(run) = run {
                all += 1;
                fading += usize::from(self.fades(sweep, run));
            }
        }
        fading as f64 / all.max(1) as f64
    }

    /// Returns true if the frames before and after the run are near those in it.
    fn fades(&self, sweep: usize, run: &Run) -> bool {
        let end = run.start + run.frames;
        let after = (end < self.dataset.steps_of(sweep)).then_some(end);
        let next = [run.start.checked_sub(1), after].into_iter().flatten();
        next.into_iter()
            .all(|step| self.are_near(sweep, run.start, step))
    }

    /// Returns true if two frames of a sweep are so near that the signal fades from one to the other.
    pub(super) fn are_near(&self, sweep: usize, step: usize, other: usize) -> bool {
        let frames = [self.frame(sweep, step), self.frame(sweep, other)];
        let pairs = frames[0].iter().zip(&frames[1]).zip(self.limits);
        pairs
            .into_iter()
            .all(|((a, b), limits)| (a - b).abs() <= FADE_TOLERANCE * limits.deviation)
    }

    /// Returns true if these frames, each a sweep and a step, are alike: those of a sensor at rest.
    pub(super) fn are_one_level(&self, frames: &[(usize, usize)]) -> bool {
        let Some((&(sweep, step), others)) = frames.split_first() else {
            return false;
        };
        let first = self.frame(sweep, step);
        let is_alike =
            |&&(sweep, step): &&(usize, usize)| self.are_alike(&first, &self.frame(sweep, step));
        2 * others.iter().filter(is_alike).count() >= others.len()
    }

    /// Returns true if the run is one of many lifts of the finger.
    pub(super) fn is_lift(&self, sweep: usize, run: &Run) -> bool {
        self.has_lifts && self.is_zero(sweep, run) && self.fades(sweep, run)
    }

    /// Returns true if the frames are like those at rest at this end of most sweeps, and motions begin or end there
    /// gradually.
    pub(super) fn is_gradual(&self, end: End, sweep: usize, run: &Run) -> bool {
        self.of_end(end).is_some_and(|rest| rest.fades) && self.is_like(end, sweep, run)
    }

    /// Returns true if all taxels are zero in the run, and for none of them zero is a usual value.
    pub(super) fn is_far_zero(&self, sweep: usize, run: &Run) -> bool {
        let is_far = |limits: &TaxelLimits| limits.distance(0.0) >= FAR_ZERO;
        self.limits.iter().all(is_far) && self.is_zero(sweep, run)
    }

    /// Returns true if a run is longer than one by accident. An accident of L frames has the probability p to the power of
    /// L - 1 at each frame, where p is the share of repeated frames of the data set or nearby, whichever is larger.
    pub(super) fn is_no_accident(&self, sweep: usize, run: &Run) -> bool {
        if self.repeated_share > REPEATED_SHARE {
            return false;
        }
        let nearby = self.repeated_nearby(sweep, run);
        let share = nearby.max(self.repeated_share).max(1.0 / self.pairs);
        let expected = self.pairs * share.powi(i32::try_from(run.frames - 1).unwrap_or(i32::MAX));
        expected < ACCIDENTS
    }

    /// Returns the estimated share of repeated frames before and after a run. Of the taxels that move there, two are taken
    /// as independent.
    fn repeated_nearby(&self, sweep: usize, run: &Run) -> f64 {
        let shape = self.dataset.shape();
        let frames = run.frames.clamp(NEARBY_FRAMES[0], NEARBY_FRAMES[1]);
        let start = run.start.saturating_sub(frames);
        let end = run.start + run.frames;
        let before: Vec<Vec<f32>> = (start..run.start)
            .map(|step| self.frame(sweep, step))
            .collect();
        let after: Vec<Vec<f32>> = (end..(end + frames).min(self.dataset.steps_of(sweep)))
            .map(|step| self.frame(sweep, step))
            .collect();
        let pairs = || {
            [&before, &after]
                .into_iter()
                .flat_map(|side| side.array_windows())
        };
        let (mut equal, mut all, mut moving) = (0, 0, 0);
        for taxel in 0..shape.taxels() {
            let same = pairs().filter(|[a, b]| a[taxel] == b[taxel]).count();
            let of_taxel = pairs().count();
            if same < of_taxel {
                equal += same;
                all += of_taxel;
                moving += 1;
            }
        }
        let share = if all == 0 {
            1.0
        } else {
            equal as f64 / all as f64
        };
        if moving >= INDEPENDENT_TAXELS {
            share * share
        } else {
            share
        }
    }

    /// Returns true if the frames of the run are like those at rest at this end of the sweeps.
    pub(super) fn is_like(&self, end: End, sweep: usize, run: &Run) -> bool {
        self.of_end(end)
            .is_some_and(|rest| self.are_alike(&self.frame(sweep, run.start), &rest.values))
    }

    fn of_end(&self, end: End) -> Option<&RestFrame> {
        match end {
            End::Head => self.head.as_ref(),
            End::Tail => self.tail.as_ref(),
        }
    }

    /// Returns true if the frames of the run are like the first or the last frame of the same sweep.
    pub(super) fn is_like_own(&self, end: End, sweep: usize, run: &Run) -> bool {
        let step = match end {
            End::Head => 0,
            End::Tail => self.dataset.steps_of(sweep) - 1,
        };
        self.are_alike(&self.frame(sweep, run.start), &self.frame(sweep, step))
    }

    /// Returns the largest usual change between rest and motion; 0 if the sensor never rests.
    pub(super) fn change(&self) -> f32 {
        let both = [&self.head, &self.tail].into_iter().flatten();
        both.map(|rest| rest.change).fold(0.0, f32::max)
    }

    /// Returns true if all taxels are zero in the run.
    pub(super) fn is_zero(&self, sweep: usize, run: &Run) -> bool {
        self.frame(sweep, run.start)
            .iter()
            .all(|value| *value == 0.0)
    }

    fn frame(&self, sweep: usize, step: usize) -> Vec<f32> {
        frame(self.dataset, sweep, step)
    }

    fn are_alike(&self, a: &[f32], b: &[f32]) -> bool {
        let pairs = a.iter().zip(b).zip(&self.tolerance);
        pairs
            .into_iter()
            .all(|((a, b), tolerance)| (a - b).abs() <= *tolerance)
    }
}

fn frame(dataset: &Dataset, sweep: usize, step: usize) -> Vec<f32> {
    let shape = dataset.shape();
    let mut frame = vec![0.0; shape.taxels()];
    let start = sweep * shape.values() + step * shape.taxels();
    dataset.samples().copy_to(start, &mut frame);
    frame
}

/// Returns the run of equal frames at one end of a sweep.
pub(super) fn run_at(end: End, sweep: &SweepStatistics) -> Option<&Run> {
    let steps = sweep.steps;
    let run = match end {
        End::Head => sweep.runs.first().filter(|run| run.start == 0),
        End::Tail => {
            let last = sweep.runs.last();
            last.filter(|run| run.start + run.frames == steps)
        }
    };
    run.filter(|run| run.frames < steps)
}

/// Returns the median of the equal frames at one end of the sweeps.
fn rest_frame(dataset: &Dataset, sweeps: &[SweepStatistics], end: End) -> Option<RestFrame> {
    let at_rest = sweeps.iter().enumerate();
    let at_rest: Vec<(usize, &Run)> = at_rest
        .filter_map(|(index, sweep)| Some((index, run_at(end, sweep)?)))
        .collect();
    if at_rest.is_empty() || (at_rest.len() as f64) < RESTING_SHARE * sweeps.len() as f64 {
        return None;
    }
    let stride = at_rest.len().div_ceil(COUNTED_SWEEPS);
    let counted: Vec<&(usize, &Run)> = at_rest.iter().step_by(stride).collect();
    let frames: Vec<Vec<f32>> = counted
        .iter()
        .map(|(index, run)| frame(dataset, *index, run.start))
        .collect();
    let values = (0..dataset.shape().taxels())
        .map(|taxel| median(frames.iter().map(|frame| frame[taxel]).collect()))
        .collect();
    let changes = counted.iter().map(|(_, run)| match end {
        End::Head => run.change_out,
        End::Tail => run.change_in,
    });
    Some(RestFrame {
        values,
        change: median(changes.collect()),
        fades: false,
    })
}

fn median(mut values: Vec<f32>) -> f32 {
    values.sort_by(f32::total_cmp);
    values[values.len() / 2]
}

/// Returns the share of values that equal the one before, in frames that differ from the frame before.
fn repeated_values(dataset: &Dataset, sweeps: &[SweepStatistics]) -> f64 {
    let taxels = dataset.shape().taxels();
    let stride = sweeps.len().div_ceil(COUNTED_SWEEPS);
    let (mut equal, mut all) = (0, 0);
    for index in (0..sweeps.len()).step_by(stride) {
        let values = dataset.sweep(index);
        let frames = values.chunks_exact(taxels);
        for (before, after) in frames.clone().zip(frames.skip(1)) {
            let same = before.iter().zip(after).filter(|(a, b)| a == b).count();
            if same < taxels {
                equal += same;
                all += taxels;
            }
        }
    }
    equal as f64 / all.max(1) as f64
}
