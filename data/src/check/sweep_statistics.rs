//! Statistics of one sweep, from one pass over its values.

use crate::Dataset;

/// Minimum length of a run of equal frames that is kept, in frames: loggers that poll a sensor repeat single frames.
pub(super) const RUN_FRAMES: usize = 3;
/// Change between frames below which a sweep counts as quiet, as a share of its median change: the noise of a sensor at
/// rest is a few hundredths of the vibration of a sliding contact, or more.
const QUIET_SHARE: f32 = 0.05;
/// Number of changes over which the mean is quiet or lively.
const MEAN_FRAMES: usize = 4;
/// Minimum change of the last frames before a quiet tail, as a share of the median change: a real motion decays over
/// several frames.
const LIVELY_SHARE: f32 = 0.3;

/// Ratio of a change to the largest other one of its sweep from which it is a jump.
pub(super) const JUMP: f32 = 3.0;
/// Maximum mean change after a jump to rest, as a share of the usual change.
const REST_SHARE: f32 = 0.2;

/// Statistics of one sweep.
pub(super) struct SweepStatistics {
    /// Number of frames.
    pub(super) steps: usize,
    /// Smallest and largest finite value of each taxel; positive and negative infinity if all values are not finite.
    pub(super) taxels: Vec<(f32, f32)>,
    /// Number of values that are not finite, and the index of the first within the sweep.
    pub(super) not_finite: Option<(usize, usize)>,
    /// Number of negative values.
    pub(super) negative: usize,
    /// Hash of the values.
    pub(super) hash: u64,
    /// Runs of at least [`RUN_FRAMES`] equal frames.
    pub(super) runs: Vec<Run>,
    /// Number of frames that equal the frame before them, outside of `runs`.
    pub(super) repeated: usize,
    /// Largest change between two frames, except at the ends of `runs`; a change is the sum over the taxels of the
    /// absolute differences.
    pub(super) top_change: f32,
    /// Frames at the end that are quiet without being equal, after a lively frame.
    pub(super) quiet_tail: usize,
    /// True if the first frames are quiet.
    pub(super) quiet_head: bool,
}

/// Consecutive frames that are equal in all taxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Run {
    /// First of the equal frames.
    pub(super) start: usize,
    /// Number of equal frames.
    pub(super) frames: usize,
    /// Change from the frame before the run; infinity if it begins the sweep.
    pub(super) change_in: f32,
    /// Change to the frame after the run; infinity if it ends the sweep.
    pub(super) change_out: f32,
}

impl SweepStatistics {
    pub(super) fn of(dataset: &Dataset, index: usize) -> Self {
        let values = dataset.sweep(index);
        let taxels = dataset.shape().taxels();
        let mut low = vec![f32::INFINITY; taxels];
        let mut high = vec![f32::NEG_INFINITY; taxels];
        let mut all_finite = true;
        for frame in values.chunks_exact(taxels) {
            for ((&value, low), high) in frame.iter().zip(&mut low).zip(&mut high) {
                all_finite &= value.is_finite();
                *low = low.min(if value.is_finite() {
                    value
                } else {
                    f32::INFINITY
                });
                *high = high.max(if value.is_finite() {
                    value
                } else {
                    f32::NEG_INFINITY
                });
            }
        }
        let not_finite = || {
            let values = values.iter().enumerate();
            values.filter(|(_, value)| !value.is_finite())
        };
        let first = if all_finite {
            None
        } else {
            not_finite().next()
        };
        let changes = changes(&values, taxels);
        let runs = runs(&changes);
        let in_runs: usize = runs.iter().map(|run| run.frames - 1).sum();
        let repeated = changes.iter().filter(|&&change| change == 0.0).count();
        let (quiet_tail, quiet_head) = quiet_ends(&changes);
        Self {
            steps: values.len() / taxels,
            not_finite: first.map(|(first, _)| (not_finite().count(), first)),
            negative: if low.iter().any(|&low| low < 0.0) {
                values.iter().filter(|&&value| value < 0.0).count()
            } else {
                0
            },
            taxels: low.into_iter().zip(high).collect(),
            hash: hash(&values),
            repeated: repeated.saturating_sub(in_runs),
            top_change: top_change(&changes, &runs),
            runs,
            quiet_tail,
            quiet_head,
        }
    }

    /// Returns the runs that neither begin nor end the sweep.
    pub(super) fn middle_runs(&self) -> impl Iterator<Item = &Run> {
        let steps = self.steps;
        let is_middle = move |run: &&Run| run.start > 0 && run.start + run.frames < steps;
        self.runs.iter().filter(is_middle)
    }

    pub(super) fn max(&self) -> f32 {
        let highs = self.taxels.iter().map(|taxel| taxel.1);
        highs.fold(f32::NEG_INFINITY, f32::max)
    }

    pub(super) fn is_constant(&self) -> bool {
        self.not_finite.is_none() && self.taxels.iter().all(|(low, high)| low == high)
    }
}

/// Returns the sums of the absolute differences between neighbouring frames: `[steps - 1]`.
fn changes(values: &[f32], taxels: usize) -> Vec<f32> {
    if taxels == 1 {
        return values.array_windows().map(|[a, b]| (a - b).abs()).collect();
    }
    let after = values[taxels..].chunks_exact(taxels);
    let pairs = values.chunks_exact(taxels).zip(after);
    pairs.map(|(a, b)| change(a, b)).collect()
}

/// Returns the sum of the absolute differences of two frames, in eight sums that the compiler computes at once.
fn change(a: &[f32], b: &[f32]) -> f32 {
    let ((a, rest_a), (b, rest_b)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [0.0_f32; 8];
    for (a, b) in a.iter().zip(b) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += (a - b).abs();
        }
    }
    let rest = rest_a.iter().zip(rest_b).map(|(a, b)| (a - b).abs());
    sums.iter().sum::<f32>() + rest.sum::<f32>()
}

/// Returns the runs of at least [`RUN_FRAMES`] equal frames.
fn runs(changes: &[f32]) -> Vec<Run> {
    let mut runs = Vec::new();
    let mut start = 0;
    while start < changes.len() {
        let equal = changes[start..].iter().take_while(|&&change| change == 0.0);
        let equal = equal.count();
        if equal + 1 >= RUN_FRAMES {
            let before = start.checked_sub(1).map(|at| changes[at]);
            runs.push(Run {
                start,
                frames: equal + 1,
                change_in: before.unwrap_or(f32::INFINITY),
                change_out: changes.get(start + equal).copied().unwrap_or(f32::INFINITY),
            });
        }
        start += equal + 1;
    }
    runs
}

/// Returns the largest change that is not at the end of a run.
fn top_change(changes: &[f32], runs: &[Run]) -> f32 {
    let mut runs = runs.iter().peekable();
    let mut top = 0.0_f32;
    for (at, &change) in changes.iter().enumerate() {
        while runs
            .next_if(|run| run.start + run.frames - 1 < at)
            .is_some()
        {}
        // Change `at` leads from frame `at` to the next.
        let is_edge = runs
            .peek()
            .is_some_and(|run| at + 1 == run.start || at == run.start + run.frames - 1);
        if !is_edge && change > top {
            top = change;
        }
    }
    top
}

/// Returns the number of quiet frames at the end, and true if the first frames are quiet.
fn quiet_ends(changes: &[f32]) -> (usize, bool) {
    let mut sorted: Vec<f32> = changes.to_vec();
    sorted.retain(|&change| change > 0.0);
    if sorted.len() < RUN_FRAMES {
        return (0, false);
    }
    // The third quartile: up to half of a sweep may be padding.
    let place = 3 * sorted.len() / 4;
    let (_, &mut usual, _) = sorted.select_nth_unstable_by(place, f32::total_cmp);
    // Single changes of few taxels vary; their mean over a few frames does not.
    let mean = |some: &[f32]| some.iter().sum::<f32>() / some.len() as f32;
    let is_quiet = |start: usize| {
        let end = changes.len().min(start + MEAN_FRAMES);
        mean(&changes[start..end]) <= QUIET_SHARE * usual
    };
    let head = is_quiet(0);
    if let Some(jump) = jump_to_rest(changes, usual) {
        return (changes.len() - jump, head);
    }
    let tail = (0..changes.len())
        .rev()
        .take_while(|start| is_quiet(*start));
    let frames = tail.count();
    let start = changes.len() - frames;
    let frozen = changes[start..].iter().filter(|change| **change == 0.0);
    let frozen = frozen.count();
    // The change before the tail may be the step to the padding; those before it belong to the motion.
    let before = start.saturating_sub(1);
    let before = &changes[before.saturating_sub(MEAN_FRAMES)..before];
    let is_abrupt = !before.is_empty() && mean(before) >= LIVELY_SHARE * usual;
    if is_abrupt && 2 * frozen < frames {
        (frames + 1, head)
    } else {
        (0, head)
    }
}

/// Returns the place of a change that is by far the largest and after which the sweep is much quieter; `None` if there is
/// none.
fn jump_to_rest(changes: &[f32], usual: f32) -> Option<usize> {
    let greater = |a: &usize, b: &usize| changes[*a].total_cmp(&changes[*b]);
    let jump = (0..changes.len()).max_by(greater)?;
    let others = changes[..jump].iter().chain(&changes[jump + 1..]);
    let next = others.copied().fold(0.0, f32::max);
    let mean = |some: &[f32]| some.iter().sum::<f32>() / some.len().max(1) as f32;
    let (before, after) = (&changes[..jump], &changes[jump + 1..]);
    let is_noise = after.iter().filter(|change| **change == 0.0).count() * 2 < after.len();
    let is_jump = changes[jump] > JUMP * next && mean(before) >= LIVELY_SHARE * usual;
    (is_jump && is_noise && mean(after) <= REST_SHARE * usual).then_some(jump)
}

/// Returns a hash of the bits of the values. Sweeps of one hash are compared value by value.
fn hash(values: &[f32]) -> u64 {
    /// Odd number with well-mixed bits: 2^64 divided by the golden ratio.
    const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;
    let mut lanes = [1_u64, 2, 3, 4];
    let (eights, rest) = values.as_chunks::<8>();
    for eight in eights {
        for (lane, pair) in lanes.iter_mut().zip(eight.as_chunks::<2>().0) {
            let bits = u64::from(pair[0].to_bits()) | u64::from(pair[1].to_bits()) << 32;
            *lane = (lane.rotate_left(5) ^ bits).wrapping_mul(FACTOR);
        }
    }
    let rest = rest.iter().map(|value| u64::from(value.to_bits()));
    lanes.into_iter().chain(rest).fold(0, |hash: u64, bits| {
        (hash.rotate_left(5) ^ bits).wrapping_mul(FACTOR)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_know_the_changes_at_their_ends() {
        let values = [5.0, 5.0, 5.0, 9.0, 8.0, 0.0, 0.0, 0.0, 0.0, 7.0, 7.0];
        let changes = changes(&values, 1);
        let runs = runs(&changes);
        let of = |run: &Run| (run.start, run.frames, run.change_in, run.change_out);
        assert_eq!(
            runs.iter().map(of).collect::<Vec<_>>(),
            [(0, 3, f32::INFINITY, 4.0), (5, 4, 8.0, 7.0)]
        );
        assert_eq!(top_change(&changes, &runs), 1.0);
    }

    #[test]
    fn a_tail_is_quiet_if_the_motion_stops_at_once() {
        let lively = (0..60).map(|i| if i % 2 == 0 { 10.0 } else { 20.0 });
        let still = (0..40).map(|i| if i % 2 == 0 { 0.1 } else { 0.2 });
        let values: Vec<f32> = lively.clone().chain(still).collect();
        assert_eq!(quiet_ends(&changes(&values, 1)), (40, false));
        // Louder noise after a jump.
        let noise = (0..40).map(|i| if i % 2 == 0 { 500.0 } else { 501.0 });
        let values: Vec<f32> = lively.clone().chain(noise).collect();
        assert_eq!(quiet_ends(&changes(&values, 1)), (40, false));
        let decay = (0..40).map(|i| 10.0 * 0.8_f32.powi(i) * if i % 2 == 0 { 1.0 } else { -1.0 });
        let values: Vec<f32> = lively.chain(decay).collect();
        assert_eq!(quiet_ends(&changes(&values, 1)), (0, false));
    }
}
