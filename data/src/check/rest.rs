//! Frames of a sensor at rest, to tell them from frames that were lost or added.

use super::sweep_statistics::{Run, SweepStatistics};
use super::taxel_limits::TaxelLimits;
use crate::Dataset;

/// Maximum share of repeated frames in motion for a run of them to be no accident; sensors of coarse resolution, such as
/// event counts, repeat more of them.
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
}

/// Usual frame at rest.
struct RestFrame {
    values: Vec<f32>,
    /// Usual change from the rest to the motion, or back.
    change: f32,
}

impl<'a> Rest<'a> {
    pub(super) fn of(
        dataset: &'a Dataset,
        sweeps: &[SweepStatistics],
        limits: &[TaxelLimits],
    ) -> Self {
        let steps = dataset.shape().steps;
        let in_runs = |sweep: &SweepStatistics| -> usize {
            sweep.runs.iter().map(|run| run.frames - 1).sum()
        };
        let pairs: usize = sweeps
            .iter()
            .map(|sweep| (steps - 1).saturating_sub(in_runs(sweep)))
            .sum();
        let repeated: usize = sweeps.iter().map(|sweep| sweep.repeated).sum();
        let (pairs, repeated) = (pairs.max(1) as f64, repeated as f64);
        let whole = f32::from(u8::from(dataset.samples().element_max().is_some()));
        Self {
            dataset,
            tolerance: limits
                .iter()
                .map(|limits| (REST_TOLERANCE * limits.deviation).max(whole))
                .collect(),
            head: rest_frame(dataset, sweeps, End::Head),
            tail: rest_frame(dataset, sweeps, End::Tail),
            pairs,
            repeated_share: repeated / pairs,
            is_fine: repeated_values(dataset, sweeps) <= REPEATED_VALUES,
        }
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
        let after: Vec<Vec<f32>> = (end..(end + frames).min(shape.steps))
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
        let rest = match end {
            End::Head => &self.head,
            End::Tail => &self.tail,
        };
        rest.as_ref()
            .is_some_and(|rest| self.are_alike(&self.frame(sweep, run.start), &rest.values))
    }

    /// Returns true if the frames of the run are like the first or the last frame of the same sweep.
    pub(super) fn is_like_own(&self, end: End, sweep: usize, run: &Run) -> bool {
        let step = match end {
            End::Head => 0,
            End::Tail => self.dataset.shape().steps - 1,
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
pub(super) fn run_at(end: End, sweep: &SweepStatistics, steps: usize) -> Option<&Run> {
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
    let steps = dataset.shape().steps;
    let at_rest = sweeps.iter().enumerate();
    let at_rest: Vec<(usize, &Run)> = at_rest
        .filter_map(|(index, sweep)| Some((index, run_at(end, sweep, steps)?)))
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
