//! Sweeps that are longer than the training sweeps: their prediction is the mean over windows.

use std::collections::BTreeMap;

use tactnet_data::SweepView;

/// Frames of some sweeps of a view, at most as many as the longest training sweep has.
pub(super) struct Part<'a> {
    /// Positions of the sweeps in the whole view.
    pub(super) positions: Vec<usize>,
    pub(super) view: SweepView<'a>,
}

/// Returns parts that together cover all sweeps: sweeps of at most `longest` frames as they are, others in windows of `longest` frames.
pub(super) fn parts<'a>(view: &SweepView<'a>, longest: usize) -> Vec<Part<'a>> {
    let is_short = |position: &usize| view.steps(*position) <= longest;
    let (short, long): (Vec<usize>, Vec<usize>) = (0..view.len()).partition(is_short);
    let mut parts = Vec::new();
    if !short.is_empty() {
        parts.push(Part {
            view: view.select(&short),
            positions: short,
        });
    }
    let mut by_start: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for position in long {
        for start in starts(view.steps(position), longest) {
            by_start.entry(start).or_default().push(position);
        }
    }
    parts.extend(by_start.into_iter().map(|(start, positions)| Part {
        view: view.select(&positions).window(start, longest),
        positions,
    }));
    parts
}

/// Returns the first frames of the windows of a sweep: half a window apart, and the last window ends with the sweep.
fn starts(steps: usize, window: usize) -> impl Iterator<Item = usize> {
    let last = steps - window;
    (0..last).step_by(hop(window)).chain([last])
}

/// Returns the number of frames between the starts of two windows.
pub(super) fn hop(window: usize) -> usize {
    (window / 2).max(1)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn windows_cover_every_frame(window in 1usize..50, more in 0usize..200) {
            let steps = window + more;
            let starts: Vec<usize> = starts(steps, window).collect();
            prop_assert_eq!(starts[0], 0);
            prop_assert_eq!(starts[starts.len() - 1] + window, steps);
            let is_near = |pair: &[usize]| pair[0] < pair[1] && pair[1] - pair[0] <= hop(window);
            prop_assert!(starts.windows(2).all(is_near), "{:?}", starts);
        }
    }
}
