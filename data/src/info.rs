//! Properties of data sets.

use crate::{Condition, ConditionValues, Dataset, Samples, SweepShape};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeSet;

/// Approximate number of evenly spaced values of an `f32` data set from which the percentiles are taken.
const PERCENTILE_VALUES: usize = 1 << 20;
/// Percentages of [`Info::percentiles`].
const PERCENTILES: [f64; 7] = [1.0, 5.0, 25.0, 50.0, 75.0, 95.0, 99.0];

/// Properties of a data set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Info {
    /// Name of the data set.
    pub name: String,
    /// Checksum of the content, see [`Dataset::sha256`].
    pub sha256: String,
    /// Number of sweeps.
    pub sweeps: usize,
    /// Shape of every sweep, or of the longest if their lengths differ; without conditions.
    pub shape: SweepShape,
    /// Lengths of the sweeps; absent if all have the length of the shape.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lengths: Option<LengthRange>,
    /// Element type: `u8`, `u16` or `f32`.
    pub element: &'static str,
    /// Memory of the values, in bytes.
    pub memory_bytes: usize,
    /// Sample rate, in Hz.
    pub sample_rate_hz: f64,
    /// True if the data does not name its sample rate.
    pub sample_rate_assumed: bool,
    /// Duration of a sweep, or of the longest, in s.
    pub sweep_seconds: f64,
    /// The materials in label order; empty if the file names none.
    pub materials: Vec<MaterialInfo>,
    /// Numbers that are known for every sweep, in the order of their columns.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<ConditionInfo>,
    /// Number of recording blocks, counted per material, if they are known.
    pub blocks: Option<usize>,
    /// Number of distinct block numbers, if they are known.
    pub block_numbers: Option<usize>,
    /// Number of sweeps in the author's test split, if it is known.
    pub test_sweeps: Option<usize>,
    /// Smallest finite value, in digits.
    pub min: f64,
    /// Largest finite value, in digits.
    pub max: f64,
    /// Mean of the finite values, in digits.
    pub mean: f64,
    /// Standard deviation of the finite values, in digits.
    pub std: f64,
    /// Percentage, and value below which that percentage of the values is. Exact for integers; for `f32` from about a
    /// million evenly spaced values.
    pub percentiles: Vec<(f64, f64)>,
    /// Share of the values that are 0.
    pub zeros: f64,
    /// Number of NaN and infinite values.
    pub not_finite: usize,
}

/// Properties of a condition in a data set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConditionInfo {
    /// Quantity and unit.
    #[serde(flatten)]
    pub condition: Condition,
    /// Smallest value.
    pub min: f32,
    /// Largest value.
    pub max: f32,
    /// Mean of the sweeps of each material: `[materials]`.
    pub means: Vec<f64>,
}

impl ConditionInfo {
    fn of(dataset: &Dataset, of: ConditionValues) -> Self {
        let mut means = vec![0.0; dataset.labels().len()];
        let counts = dataset.sweeps_per_label();
        for (record, value) in dataset.records().iter().zip(&of.values) {
            means[record.label] += f64::from(*value) / counts[record.label] as f64;
        }
        Self {
            min: of.values.iter().copied().fold(f32::INFINITY, f32::min),
            max: of.values.iter().copied().fold(f32::NEG_INFINITY, f32::max),
            condition: of.condition,
            means,
        }
    }
}

/// Properties of a material in a data set.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MaterialInfo {
    /// Name of the material.
    pub name: String,
    /// Number of its sweeps.
    pub sweeps: usize,
    /// Number of its sweeps in the author's test split, if it is known.
    pub test_sweeps: Option<usize>,
    /// Lengths of its sweeps; absent if all sweeps of the data set have one length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lengths: Option<LengthRange>,
}

/// Lengths of some sweeps, in frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct LengthRange {
    /// Length of the shortest sweep.
    pub shortest: usize,
    /// Median of the lengths.
    pub median: usize,
    /// Length of the longest sweep.
    pub longest: usize,
}

impl LengthRange {
    /// Returns the range of some lengths; `None` without any.
    pub fn of(lengths: impl IntoIterator<Item = usize>) -> Option<Self> {
        let mut sorted: Vec<usize> = lengths.into_iter().collect();
        sorted.sort_unstable();
        Some(Self {
            shortest: *sorted.first()?,
            median: sorted[sorted.len() / 2],
            longest: *sorted.last()?,
        })
    }
}

impl Info {
    /// Returns the properties without materials, for an unlabelled file.
    #[must_use]
    pub fn unlabelled(self) -> Self {
        Self {
            materials: Vec::new(),
            conditions: {
                let mut conditions = self.conditions;
                conditions.iter_mut().for_each(|of| of.means.clear());
                conditions
            },
            ..self
        }
    }
}

/// Returns the properties of `dataset`.
///
/// ```
/// use tactnet_data::info;
/// use tactnet_data::twin;
///
/// let info = info(&twin::small(2, 3, 150)?);
/// assert_eq!((info.sweeps, info.element, info.sweep_seconds), (6, "u8", 0.2));
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
pub fn info(dataset: &Dataset) -> Info {
    let sha256 = dataset.sha256().to_owned();
    let conditions = dataset.condition_values().into_iter();
    let conditions = conditions
        .map(|of| ConditionInfo::of(dataset, of))
        .collect();
    let dataset = dataset.without_conditions();
    let dataset = dataset.as_ref();
    let shape = dataset.shape();
    let records = dataset.records();
    let tests_of = |label: Option<usize>| {
        let test =
            |r: &&crate::SweepRecord| r.test == Some(true) && label.is_none_or(|l| r.label == l);
        dataset
            .has_test_flag()
            .then(|| records.iter().filter(test).count())
    };
    let counts = dataset.sweeps_per_label();
    let lengths_of = |label: Option<usize>| {
        let lengths = dataset.lengths()?.iter().zip(records);
        let of_label = lengths.filter(|(_, r)| label.is_none_or(|l| r.label == l));
        LengthRange::of(of_label.map(|(steps, _)| *steps))
    };
    let materials = dataset
        .labels()
        .names()
        .enumerate()
        .map(|(label, name)| MaterialInfo {
            name: name.to_owned(),
            sweeps: counts[label],
            test_sweeps: tests_of(Some(label)),
            lengths: lengths_of(Some(label)),
        });
    let blocks: BTreeSet<_> = records
        .iter()
        .filter_map(|r| Some((r.label, r.block?)))
        .collect();
    let block_numbers: BTreeSet<_> = blocks.iter().map(|(_, block)| block).collect();
    let block_numbers = dataset.has_blocks().then_some(block_numbers.len());
    let Moments {
        count,
        zeros,
        sum,
        squares,
        min,
        max,
    } = moments(dataset);
    let values = dataset.frames() * shape.taxels();
    let finite = count.max(1) as f64;
    let mean = sum / finite;
    Info {
        name: dataset.name().to_owned(),
        sha256,
        sweeps: dataset.len(),
        shape,
        lengths: lengths_of(None),
        element: dataset.samples().element(),
        memory_bytes: dataset.samples().bytes(),
        sample_rate_hz: dataset.sample_rate_hz(),
        sample_rate_assumed: dataset.is_rate_assumed(),
        sweep_seconds: shape.steps as f64 / dataset.sample_rate_hz(),
        materials: materials.collect(),
        conditions,
        blocks: dataset.has_blocks().then_some(blocks.len()),
        block_numbers,
        test_sweeps: tests_of(None),
        min,
        max,
        mean,
        std: (squares / finite - mean * mean).max(0.0).sqrt(),
        percentiles: percentiles(dataset),
        zeros: zeros as f64 / values as f64,
        not_finite: values - count,
    }
}

/// Sums of finite values.
struct Moments {
    count: usize,
    zeros: usize,
    sum: f64,
    squares: f64,
    min: f64,
    max: f64,
}

/// Returns the sums over all sweeps. They are added in the order of the sweeps, so the result does not depend on the
/// number of threads.
fn moments(dataset: &Dataset) -> Moments {
    let of_sweeps: Vec<Moments> = (0..dataset.len())
        .into_par_iter()
        .map(|index| {
            let mut m = Moments::none();
            for value in dataset
                .sweep(index)
                .into_iter()
                .filter(|value| value.is_finite())
            {
                let value = f64::from(value);
                m.count += 1;
                m.zeros += usize::from(value == 0.0);
                m.sum += value;
                m.squares += value * value;
                m.min = m.min.min(value);
                m.max = m.max.max(value);
            }
            m
        })
        .collect();
    let mut all = Moments::none();
    for m in of_sweeps {
        all.count += m.count;
        all.zeros += m.zeros;
        all.sum += m.sum;
        all.squares += m.squares;
        all.min = all.min.min(m.min);
        all.max = all.max.max(m.max);
    }
    all
}

impl Moments {
    fn none() -> Self {
        Self {
            count: 0,
            zeros: 0,
            sum: 0.0,
            squares: 0.0,
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
        }
    }
}

/// Returns the value at each percentage of the sorted values (nearest rank).
fn percentiles(dataset: &Dataset) -> Vec<(f64, f64)> {
    let rank = |percent: f64, count: usize| (percent / 100.0 * (count - 1) as f64).round() as usize;
    match dataset.samples() {
        Samples::U8(values) => from_counts(&counts(dataset, values, usize::from, 1 << 8), rank),
        Samples::U16(values) => from_counts(&counts(dataset, values, usize::from, 1 << 16), rank),
        Samples::F32(values) => {
            let stride = values.len().div_ceil(PERCENTILE_VALUES);
            let read = of_frames(dataset, values).step_by(stride);
            let mut some: Vec<f32> = read.copied().filter(|x| x.is_finite()).collect();
            if some.is_empty() {
                return Vec::new();
            }
            some.sort_unstable_by(f32::total_cmp);
            PERCENTILES
                .map(|p| (p, f64::from(some[rank(p, some.len())])))
                .to_vec()
        }
    }
}

/// Returns the values of all frames, without padding.
fn of_frames<'a, T>(dataset: &'a Dataset, values: &'a [T]) -> impl Iterator<Item = &'a T> {
    let shape = dataset.shape();
    let sweeps = values.chunks_exact(shape.values()).enumerate();
    sweeps.flat_map(move |(index, sweep)| &sweep[..dataset.steps_of(index) * shape.taxels()])
}

fn counts<T: Copy>(
    dataset: &Dataset,
    values: &[T],
    index: impl Fn(T) -> usize,
    kinds: usize,
) -> Vec<usize> {
    let mut counts = vec![0; kinds];
    for &value in of_frames(dataset, values) {
        counts[index(value)] += 1;
    }
    counts
}

fn from_counts(counts: &[usize], rank: impl Fn(f64, usize) -> usize) -> Vec<(f64, f64)> {
    let total = counts.iter().sum();
    let value_at = |rank: usize| {
        let mut below = 0;
        counts
            .iter()
            .position(|count| {
                below += count;
                below > rank
            })
            .unwrap_or_default()
    };
    PERCENTILES
        .map(|p| (p, value_at(rank(p, total)) as f64))
        .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LabelSet, SweepRecord};

    fn dataset(samples: Samples) -> Dataset {
        let shape = SweepShape {
            steps: samples.len() / 4,
            rows: 1,
            cols: 1,
        };
        let record = |i: usize| SweepRecord {
            label: i / 2,
            sweep: i % 2,
            block: Some((i % 2) as u32),
            test: Some(i == 3),
        };
        let labels = LabelSet::new(["cork", "denim"]).unwrap();
        Dataset::new(
            "t",
            50.0,
            shape,
            labels,
            (0..4).map(record).collect(),
            samples,
        )
        .unwrap()
    }

    #[test]
    fn integers_and_floats_of_the_same_values_give_the_same_numbers() {
        let digits: Vec<u16> = (0..4000).map(|i| i % 1001).collect();
        let bytes = info(&dataset(Samples::U16(digits.clone())));
        let floats = digits.iter().map(|&x| f32::from(x)).collect();
        let floats = info(&dataset(Samples::F32(floats)));
        assert_eq!(bytes.percentiles, floats.percentiles);
        assert_eq!((bytes.min, bytes.max), (0.0, 1000.0));
        assert_eq!((bytes.mean, bytes.std), (floats.mean, floats.std));
        assert_eq!(bytes.zeros, 4.0 / 4000.0);
        assert_eq!(bytes.sweep_seconds, 20.0);
        assert_eq!((bytes.blocks, bytes.test_sweeps), (Some(4), Some(1)));
        assert_eq!(bytes.block_numbers, Some(2));
        assert_eq!(bytes.element, "u16");
        assert_eq!(bytes.materials[1].test_sweeps, Some(1));
    }

    #[test]
    fn values_that_are_not_finite_are_counted_and_left_out() {
        let info = info(&dataset(Samples::F32(vec![
            1.0,
            f32::NAN,
            3.0,
            f32::INFINITY,
        ])));
        assert_eq!((info.not_finite, info.mean, info.max), (2, 2.0, 3.0));
    }
}
