//! Sides of a split. Their types prevent fitting on test sweeps.

use std::ops::Deref;

use super::Scheme;
use crate::{Dataset, Seed, SweepShape};

/// Some sweeps of a data set, in ascending order; the input of predictions.
///
/// A *position* counts within the view (`0..len()`), an *index* within the whole data set.
///
/// ```
/// use tactnet_data::SweepView;
/// use tactnet_data::twin;
///
/// let dataset = twin::small(2, 3, 100)?;
/// let view = SweepView::new(&dataset, vec![4, 1]);
/// assert_eq!(view.indices(), [1, 4]);
/// assert_eq!(view.labels().collect::<Vec<_>>(), [0, 1]);
/// let mut batch = vec![0.0; 2 * dataset.shape().values()];
/// view.copy_batch(&[1, 0], &mut batch);
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
#[derive(Debug, Clone)]
pub struct SweepView<'a> {
    dataset: &'a Dataset,
    indices: Vec<usize>,
    /// Frames of each sweep that are viewed; `None`: all.
    window: Option<Window>,
}

/// Consecutive frames, the same in each sweep.
#[derive(Debug, Clone, Copy)]
struct Window {
    start: usize,
    steps: usize,
}

impl<'a> SweepView<'a> {
    /// Returns a view of the sweeps with these indices, sorted.
    ///
    /// # Panics
    /// If an index is out of range or occurs twice.
    pub fn new(dataset: &'a Dataset, mut indices: Vec<usize>) -> Self {
        indices.sort_unstable();
        assert!(
            indices.is_sorted_by(|a, b| a < b),
            "duplicate sweep in {indices:?}"
        );
        assert!(
            indices.last().is_none_or(|&last| last < dataset.len()),
            "sweep {:?} of {}",
            indices.last(),
            dataset.len()
        );
        Self {
            dataset,
            indices,
            window: None,
        }
    }

    /// Returns a view of all sweeps.
    pub fn all(dataset: &'a Dataset) -> Self {
        Self {
            dataset,
            indices: (0..dataset.len()).collect(),
            window: None,
        }
    }

    /// Returns a view of the same sweeps in another form of the data set.
    ///
    /// # Panics
    /// If it has fewer sweeps.
    pub fn of_same_sweeps<'b>(&self, dataset: &'b Dataset) -> SweepView<'b> {
        SweepView {
            window: self.window,
            ..SweepView::new(dataset, self.indices.clone())
        }
    }

    /// Returns the data set that the sweeps belong to.
    pub fn dataset(&self) -> &'a Dataset {
        self.dataset
    }

    /// Returns the shape of all sweeps; that of the longest sweep of the data set if their lengths differ.
    pub fn shape(&self) -> SweepShape {
        let shape = self.dataset.shape();
        SweepShape {
            steps: self.window.map_or(shape.steps, |window| window.steps),
            ..shape
        }
    }

    /// Returns the number of frames of the sweep at `position`.
    ///
    /// # Panics
    /// If `position >= self.len()`.
    pub fn steps(&self, position: usize) -> usize {
        match self.window {
            Some(window) => window.steps,
            None => self.dataset.steps_of(self.indices[position]),
        }
    }

    /// Returns the numbers of frames of all sweeps, in the order of the positions.
    pub fn lengths(&self) -> impl ExactSizeIterator<Item = usize> + '_ {
        (0..self.len()).map(|position| self.steps(position))
    }

    /// Returns the number of frames of the longest sweep, or that of the shape if there is none.
    pub fn longest(&self) -> usize {
        self.lengths().max().unwrap_or(self.shape().steps)
    }

    /// Returns the sweeps at `positions`, in ascending order.
    ///
    /// # Panics
    /// If a position is out of range or occurs twice.
    pub fn select(&self, positions: &[usize]) -> Self {
        let indices = positions.iter().map(|&position| self.indices[position]);
        Self {
            window: self.window,
            ..Self::new(self.dataset, indices.collect())
        }
    }

    /// Returns a view of `steps` frames of every sweep, from `start` on.
    ///
    /// # Panics
    /// If a sweep has fewer frames.
    pub fn window(&self, start: usize, steps: usize) -> Self {
        assert!(
            self.lengths().all(|length| start + steps <= length),
            "{steps} frames from {start} on in every sweep"
        );
        let before = self.window.map_or(0, |window| window.start);
        Self {
            window: Some(Window {
                start: before + start,
                steps,
            }),
            ..self.clone()
        }
    }

    /// Returns the sweeps of each length with their positions, the shortest first. The shape of each part is that of all
    /// its sweeps.
    ///
    /// ```
    /// use tactnet_data::SweepView;
    /// use tactnet_data::twin;
    ///
    /// let twin = twin::small(3, 1, 100)?.with_lengths(vec![100, 60, 100])?;
    /// let parts = SweepView::all(&twin).by_length();
    /// assert_eq!(parts.len(), 2);
    /// assert_eq!((parts[0].0.as_slice(), parts[0].1.shape().steps), (&[1][..], 60));
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn by_length(&self) -> Vec<(Vec<usize>, Self)> {
        let mut positions: Vec<usize> = (0..self.len()).collect();
        let whole = self.shape().steps;
        if self.lengths().all(|steps| steps == whole) {
            return vec![(positions, self.clone())];
        }
        positions.sort_by_key(|position| self.steps(*position));
        positions
            .chunk_by(|a, b| self.steps(*a) == self.steps(*b))
            .map(|part| {
                let steps = self.steps(part[0]);
                (part.to_vec(), self.select(part).window(0, steps))
            })
            .collect()
    }

    /// Returns the indices of the sweeps in the data set, ascending.
    pub fn indices(&self) -> &[usize] {
        &self.indices
    }

    /// Returns the number of sweeps.
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// Returns true if the view has no sweeps.
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// Returns the label of the sweep at `position`.
    ///
    /// # Panics
    /// If `position >= self.len()`.
    pub fn label(&self, position: usize) -> usize {
        self.dataset.records()[self.indices[position]].label
    }

    /// Returns the labels of all sweeps, in the order of the positions.
    pub fn labels(&self) -> impl ExactSizeIterator<Item = usize> + '_ {
        self.indices
            .iter()
            .map(|&index| self.dataset.records()[index].label)
    }

    /// Returns the number of sweeps per label: `[labels]`.
    pub fn sweeps_per_label(&self) -> Vec<usize> {
        let mut counts = vec![0; self.dataset.labels().len()];
        self.labels().for_each(|label| counts[label] += 1);
        counts
    }

    /// Returns the frames of the sweep at `position` as `[steps][rows][cols]` digits.
    ///
    /// # Panics
    /// If `position >= self.len()`.
    pub fn sweep(&self, position: usize) -> Vec<f32> {
        let mut out = vec![0.0; self.steps(position) * self.shape().taxels()];
        self.copy_sweep(position, &mut out);
        out
    }

    /// Copies the first `out.len()` values of the sweep at `position`, `[steps][rows][cols]` digits. The last frame of a
    /// sweep that is shorter than the shape is repeated.
    ///
    /// # Panics
    /// If `position >= self.len()`, or `out` is longer than the shape.
    pub fn copy_sweep(&self, position: usize, out: &mut [f32]) {
        assert!(out.len() <= self.shape().values(), "{}", self.shape());
        let shape = self.dataset.shape();
        let before = self.window.map_or(0, |window| window.start) * shape.taxels();
        let start = self.indices[position] * shape.values() + before;
        self.dataset.samples().copy_to(start, out);
    }

    /// Copies the sweeps at `positions` as `f32` to `out`, in this order. The last frame of a sweep that is shorter than the
    /// shape is repeated.
    ///
    /// - `positions`: `[batch]`; repetitions are allowed
    /// - `out`: `[batch][steps][rows][cols]`, digits
    ///
    /// # Panics
    /// If a position is not below `self.len()`, or `out` has another length.
    pub fn copy_batch(&self, positions: &[usize], out: &mut [f32]) {
        let values = self.shape().values();
        assert_eq!(
            out.len(),
            positions.len() * values,
            "{} sweeps of {}",
            positions.len(),
            self.shape()
        );
        for (&position, sweep) in positions.iter().zip(out.chunks_exact_mut(values)) {
            self.copy_sweep(position, sweep);
        }
    }
}

macro_rules! side {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone)]
        pub struct $name<'a>(SweepView<'a>);

        impl<'a> $name<'a> {
            pub(super) fn new(dataset: &'a Dataset, indices: Vec<usize>) -> Self {
                Self(SweepView::new(dataset, indices))
            }
        }

        impl<'a> Deref for $name<'a> {
            type Target = SweepView<'a>;

            fn deref(&self) -> &SweepView<'a> {
                &self.0
            }
        }
    };
}

/// Settings that determine a fold; they also name the inner splits of its training sweeps.
#[derive(Debug, Clone, Copy)]
pub(super) struct SplitKey {
    pub(super) scheme: Scheme,
    pub(super) seed: Seed,
    pub(super) repeat: usize,
    pub(super) fold: usize,
}

side! {
    /// Training sweeps that are set aside to choose settings. Models are not fitted to them, and they contain no test
    /// sweeps.
    ValidationSplit
}

side! {
    /// Test sweeps, on which results are measured.
    TestSplit
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LabelSet, Samples, SweepRecord};

    fn three_sweeps() -> Dataset {
        let records = (0..3)
            .map(|sweep| SweepRecord::new(sweep % 2, sweep / 2))
            .collect();
        let shape = SweepShape {
            steps: 2,
            rows: 1,
            cols: 2,
        };
        let labels = LabelSet::new(["cork", "denim"]).unwrap();
        Dataset::new(
            "three",
            750.0,
            shape,
            labels,
            records,
            Samples::U8((0..12).collect()),
        )
        .unwrap()
    }

    #[test]
    fn a_batch_holds_the_sweeps_asked_for_in_their_order() {
        let dataset = three_sweeps();
        let view = SweepView::new(&dataset, vec![2, 0]);
        let mut batch = [0.0; 12];
        view.copy_batch(&[1, 0, 1], &mut batch);
        assert_eq!(batch, [8., 9., 10., 11., 0., 1., 2., 3., 8., 9., 10., 11.]);
        assert_eq!(view.indices(), [0, 2]);
        assert!(view.labels().eq([0, 0]));
        assert_eq!(view.sweeps_per_label(), [2, 0]);
        assert_eq!(
            SweepView::all(&dataset).labels().collect::<Vec<_>>(),
            [0, 1, 0]
        );
    }

    #[test]
    #[should_panic(expected = "duplicate sweep")]
    fn a_view_refuses_the_same_sweep_twice() {
        SweepView::new(&three_sweeps(), vec![1, 1]);
    }

    #[test]
    #[should_panic(expected = "of 3")]
    fn a_view_refuses_a_sweep_that_is_not_there() {
        SweepView::new(&three_sweeps(), vec![3]);
    }
}
