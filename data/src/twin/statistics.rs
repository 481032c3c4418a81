//! Figures that describe a tactile signal, and their values on real TactMat sweeps.
//!
//! The real values come from the four sweeps in figure 2b of Tulbure and Bäuml (Humanoids 2018): white metal twice,
//! cotton fabric reverse, linen fabric smooth. The vector lines of the figure give them as `[4][1000][16]` digits; the
//! definitions below were applied to these. Four sweeps are few, so figures of levels have wide tolerances.

use super::spectra::SweepSpectra;
use crate::{Dataset, Samples};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Lags of [`SignalStatistics::autocorrelation`], steps.
pub const LAGS: [usize; 4] = [1, 5, 20, 75];

/// Edges of [`SignalStatistics::energy_bands`], Hz; the last band ends at half the sample rate.
pub const BAND_EDGES_HZ: [f64; 5] = [0.0, 2.0, 20.0, 60.0, 200.0];

/// Figures of one data set; a figure that the data cannot give (a correlation of one taxel, one sweep per material) is
/// NaN.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SignalStatistics {
    /// Mean of all values, digits.
    pub mean: f64,
    /// 50th, 95th and 99th percentile of all values (nearest rank), digits.
    pub percentiles: [f64; 3],
    /// Largest value, digits.
    pub max: f64,
    /// Share of values that are 0.
    pub zeros: f64,
    /// Share of values that are 1 or 2.
    pub ones_and_twos: f64,
    /// Share of differences between two successive values of a taxel of size 0, 1, 2 and 3.
    pub steps: [f64; 4],
    /// Standard deviation of those differences, digits.
    pub step_std: f64,
    /// Share of a taxel's energy in 0-2, 2-20, 20-60, 60-200 and 200-375 Hz: periodogram of the whole sweep without its
    /// mean, rectangular window, divided by its sum; mean over sweeps and taxels that are not constant.
    pub energy_bands: [f64; 5],
    /// Slope of the logarithm of that mean periodogram over the logarithm of frequency, least squares over the
    /// bins from 5 to 100 Hz.
    pub spectral_slope: f64,
    /// Autocorrelation at [`LAGS`]: without the first fifth of the sweep and without linear trend; median over sweeps and
    /// taxels.
    pub autocorrelation: [f64; 4],
    /// Exponent `e` of the power law `fluctuation ~ level^e` in 2-60 and 150-375 Hz: least squares of the logarithms over
    /// all taxels and sweeps with a mean level of at least 5 digits, without the first fifth of the sweep.
    pub level_exponents: [f64; 2],
    /// Standard deviation of the natural logarithm of the fluctuation from that power law.
    pub level_residuals: [f64; 2],
    /// Unsteadiness of the texture, for the taxels of that power law: standard deviation over eight windows (100 steps
    /// each of 1000) of the logarithm of the power in 20-60 Hz; median over taxels and sweeps.
    pub intermittency: f64,
    /// Mean correlation between two taxels of a sweep in 2-20 and 20-200 Hz (linear trend removed, rectangular
    /// pass band), over pairs of taxels that are not constant.
    pub taxel_correlation: [f64; 2],
    /// Root mean square difference of a taxel's mean level between two sweeps of one material, digits.
    pub level_rms_same: f64,
    /// Root mean square difference of a taxel's mean level between sweeps of two materials, digits.
    pub level_rms_other: f64,
    /// Sum over the taxels, mean over sweeps, in the first fiftieth of the sweep (20 of 1000 steps) and in its last two
    /// fifths, digits.
    pub force: [f64; 2],
}

/// Figures of the four published TactMat sweeps. The largest value is that of the data set (154; the four reach 91). The
/// two values of 2 among their 64 000 are treated as errors of the recovery.
///
/// `level_rms_same` is based on one pair of sweeps, `level_rms_other` on five.
pub const REAL: SignalStatistics = SignalStatistics {
    mean: 8.445,
    percentiles: [7.0, 22.0, 35.0],
    max: 154.0,
    zeros: 0.1346,
    ones_and_twos: 0.0,
    steps: [0.7516, 0.2041, 0.0206, 0.0199],
    step_std: 0.7406,
    energy_bands: [0.438, 0.421, 0.053, 0.048, 0.040],
    spectral_slope: -1.53,
    autocorrelation: [0.85, 0.71, 0.48, 0.12],
    level_exponents: [0.97, 0.50],
    level_residuals: [0.54, 0.27],
    intermittency: 0.715,
    taxel_correlation: [0.033, 0.003],
    level_rms_same: 4.7,
    level_rms_other: 3.9,
    force: [231.8, 116.5],
};

/// Maximum difference of the twin from [`REAL`]. Much of the standard deviations of log-power is between materials, and
/// the four sweeps cover only three.
pub const TOLERANCE: SignalStatistics = SignalStatistics {
    mean: 1.5,
    percentiles: [2.0, 5.0, 10.0],
    max: 0.0,
    zeros: 0.03,
    ones_and_twos: 0.0,
    steps: [0.03, 0.03, 0.01, 0.01],
    step_std: 0.06,
    energy_bands: [0.06; 5],
    spectral_slope: 0.2,
    autocorrelation: [0.08, 0.08, 0.1, 0.1],
    level_exponents: [0.25, 0.25],
    level_residuals: [0.15, 0.12],
    intermittency: 0.08,
    taxel_correlation: [0.04, 0.02],
    level_rms_same: 1.5,
    level_rms_other: 2.5,
    force: [50.0, 40.0],
};

impl SignalStatistics {
    /// Returns all figures with their names, in the order of the fields.
    pub fn figures(&self) -> Vec<(&'static str, f64)> {
        let mut figures = vec![
            ("mean [digits]", self.mean),
            ("median [digits]", self.percentiles[0]),
            ("95th percentile [digits]", self.percentiles[1]),
            ("99th percentile [digits]", self.percentiles[2]),
            ("largest value [digits]", self.max),
            ("zeros", self.zeros),
            ("ones and twos", self.ones_and_twos),
            ("unchanged steps", self.steps[0]),
            ("steps of 1 digit", self.steps[1]),
            ("steps of 2 digits", self.steps[2]),
            ("steps of 3 digits", self.steps[3]),
            ("std of steps [digits]", self.step_std),
        ];
        let names = [
            "energy 0-2 Hz",
            "energy 2-20 Hz",
            "energy 20-60 Hz",
            "energy 60-200 Hz",
            "energy 200-375 Hz",
        ];
        figures.extend(names.into_iter().zip(self.energy_bands));
        figures.push(("spectral slope 5-100 Hz", self.spectral_slope));
        let names = [
            "autocorrelation lag 1",
            "autocorrelation lag 5",
            "autocorrelation lag 20",
            "autocorrelation lag 75",
        ];
        figures.extend(names.into_iter().zip(self.autocorrelation));
        figures.extend([
            ("level exponent 2-60 Hz", self.level_exponents[0]),
            ("level exponent 150-375 Hz", self.level_exponents[1]),
            ("log-power sd 2-60 Hz", self.level_residuals[0]),
            ("log-power sd 150-375 Hz", self.level_residuals[1]),
            ("intermittency 20-60 Hz", self.intermittency),
            ("taxel correlation 2-20 Hz", self.taxel_correlation[0]),
            ("taxel correlation 20-200 Hz", self.taxel_correlation[1]),
            ("level rms, same material [digits]", self.level_rms_same),
            ("level rms, two materials [digits]", self.level_rms_other),
            ("force at rest [digits]", self.force[0]),
            ("force after slipping [digits]", self.force[1]),
        ]);
        figures
    }
}

/// Sums of the values of one sweep.
struct SweepCounts {
    zeros: u64,
    ones_and_twos: u64,
    steps: [u64; 4],
    change: f64,
    change_squares: f64,
    levels: Vec<f64>,
    force: [f64; 2],
    spectra: SweepSpectra,
}

/// Measures all figures of `dataset`; takes about a millisecond for a sweep of 1000 steps and 16 taxels.
///
/// ```
/// use tactnet_data::twin::{self, TwinConfig, measure};
///
/// let config = TwinConfig { materials: 2, sweeps: 2, steps: 500, ..TwinConfig::default() };
/// let statistics = measure(&twin::generate(&config)?);
/// assert!(statistics.max <= 154.0);
/// # Ok::<(), tactnet_data::DataError>(())
/// ```
pub fn measure(dataset: &Dataset) -> SignalStatistics {
    let shape = dataset.shape();
    let sweeps: Vec<SweepCounts> = (0..dataset.len())
        .into_par_iter()
        .map(|index| {
            count(
                &dataset.sweep(index),
                shape.taxels(),
                dataset.sample_rate_hz(),
            )
        })
        .collect();
    let total = |of: fn(&SweepCounts) -> f64| sweeps.iter().map(of).sum::<f64>();
    let values = (dataset.len() * shape.values()) as f64;
    let changes = (dataset.len() * (shape.steps - 1) * shape.taxels()) as f64;
    let change = total(|s| s.change) / changes;
    let levels: Vec<(usize, &[f64])> = dataset
        .records()
        .iter()
        .map(|r| r.label)
        .zip(sweeps.iter().map(|s| s.levels.as_slice()))
        .collect();
    let [level_rms_same, level_rms_other] = level_differences(&levels, dataset.labels().len());
    let (percentiles, max) = percentiles(dataset.samples());
    let spectra: Vec<&SweepSpectra> = sweeps.iter().map(|s| &s.spectra).collect();
    SignalStatistics {
        mean: total(|s| s.levels.iter().sum()) / (dataset.len() * shape.taxels()) as f64,
        percentiles,
        max,
        zeros: total(|s| s.zeros as f64) / values,
        ones_and_twos: total(|s| s.ones_and_twos as f64) / values,
        steps: std::array::from_fn(|size| {
            sweeps.iter().map(|s| s.steps[size] as f64).sum::<f64>() / changes
        }),
        step_std: (total(|s| s.change_squares) / changes - change * change).sqrt(),
        energy_bands: SweepSpectra::energy_bands(&spectra, shape.steps, dataset.sample_rate_hz()),
        spectral_slope: SweepSpectra::slope(&spectra, shape.steps, dataset.sample_rate_hz()),
        autocorrelation: SweepSpectra::autocorrelation(&spectra),
        level_exponents: SweepSpectra::level_exponents(&spectra),
        level_residuals: SweepSpectra::level_residuals(&spectra),
        intermittency: SweepSpectra::intermittency(&spectra),
        taxel_correlation: SweepSpectra::taxel_correlation(&spectra),
        level_rms_same,
        level_rms_other,
        force: [
            total(|s| s.force[0]) / dataset.len() as f64,
            total(|s| s.force[1]) / dataset.len() as f64,
        ],
    }
}

fn count(sweep: &[f32], taxels: usize, sample_rate_hz: f64) -> SweepCounts {
    let steps = sweep.len() / taxels;
    let mean_force = |range: std::ops::Range<usize>| {
        let frames = range.len() as f64;
        sweep[range.start * taxels..range.end * taxels]
            .iter()
            .map(|&x| f64::from(x))
            .sum::<f64>()
            / frames
    };
    let mut counts = SweepCounts {
        zeros: sweep.iter().filter(|&&x| x == 0.0).count() as u64,
        ones_and_twos: sweep.iter().filter(|&&x| x == 1.0 || x == 2.0).count() as u64,
        steps: [0; 4],
        change: 0.0,
        change_squares: 0.0,
        levels: vec![0.0; taxels],
        force: [
            mean_force(0..steps.div_ceil(50)),
            mean_force(steps * 3 / 5..steps),
        ],
        spectra: SweepSpectra::measure(sweep, taxels, sample_rate_hz),
    };
    for (&next, &last) in sweep[taxels..].iter().zip(sweep) {
        let change = f64::from(next - last);
        if let Some(bin) = counts
            .steps
            .iter_mut()
            .enumerate()
            .find_map(|(k, n)| (change.abs() == k as f64).then_some(n))
        {
            *bin += 1;
        }
        counts.change += change;
        counts.change_squares += change * change;
    }
    for frame in sweep.chunks_exact(taxels) {
        for (level, &x) in counts.levels.iter_mut().zip(frame) {
            *level += f64::from(x) / steps as f64;
        }
    }
    counts
}

/// Returns the root mean square over pairs of sweeps and over taxels, for pairs within a label and for pairs across
/// labels.
fn level_differences(levels: &[(usize, &[f64])], labels: usize) -> [f64; 2] {
    let taxels = levels[0].1.len();
    let mut sums = vec![vec![0.0; taxels]; labels];
    let mut squares = vec![0.0; labels];
    let mut counts = vec![0.0; labels];
    for (label, level) in levels {
        counts[*label] += 1.0;
        for (sum, x) in sums[*label].iter_mut().zip(*level) {
            *sum += x;
            squares[*label] += x * x;
        }
    }
    // Over all pairs i < j: sum |x_i - x_j|^2 = n sum |x|^2 - |sum x|^2.
    let over_pairs =
        |n: f64, squares: f64, sum: &[f64]| n * squares - sum.iter().map(|s| s * s).sum::<f64>();
    let pairs = |n: f64| n * (n - 1.0) / 2.0;
    let (mut same, mut same_pairs) = (0.0, 0.0);
    for label in 0..labels {
        same += over_pairs(counts[label], squares[label], &sums[label]);
        same_pairs += pairs(counts[label]);
    }
    let n: f64 = counts.iter().sum();
    let sum: Vec<f64> = (0..taxels)
        .map(|taxel| sums.iter().map(|s| s[taxel]).sum())
        .collect();
    let other = over_pairs(n, squares.iter().sum(), &sum) - same;
    let other_pairs = pairs(n) - same_pairs;
    [(same, same_pairs), (other, other_pairs)]
        .map(|(sum, pairs)| (sum / pairs / taxels as f64).sqrt())
}

/// Returns the 50th, 95th and 99th percentile by nearest rank, and the largest value.
fn percentiles(samples: &Samples) -> ([f64; 3], f64) {
    /// Shares of the percentiles.
    const SHARES: [f64; 3] = [0.50, 0.95, 0.99];
    let rank = |share: f64| (share * samples.len() as f64).ceil().max(1.0) as usize - 1;
    let of_histogram = |histogram: Vec<usize>| {
        let at = |rank: usize| {
            let mut below = 0;
            let reached = histogram.iter().position(|&n| {
                below += n;
                below > rank
            });
            reached.map_or(f64::NAN, |value| value as f64)
        };
        (SHARES.map(|share| at(rank(share))), at(samples.len() - 1))
    };
    match samples {
        Samples::U8(values) => of_histogram(histogram(values)),
        Samples::U16(values) => of_histogram(histogram(values)),
        Samples::F32(values) => {
            let mut sorted = values.clone();
            sorted.sort_unstable_by(f32::total_cmp);
            (
                SHARES.map(|share| f64::from(sorted[rank(share)])),
                f64::from(sorted[sorted.len() - 1]),
            )
        }
    }
}

fn histogram<T: Copy + Into<u32>>(values: &[T]) -> Vec<usize> {
    let mut counts = vec![0; 1 << 16];
    for &value in values {
        counts[value.into() as usize] += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LabelSet, SweepRecord, SweepShape};

    /// Returns two taxels at 100 Hz for 8 steps; two sweeps of one material and one of another.
    fn small() -> Dataset {
        let sweep = |a: [u16; 8], b: [u16; 8]| {
            a.into_iter()
                .zip(b)
                .flat_map(|(a, b)| [a, b])
                .collect::<Vec<_>>()
        };
        let values = [
            sweep([0, 0, 1, 3, 3, 3, 5, 1], [4; 8]),
            sweep([0; 8], [6; 8]),
            sweep([2; 8], [9; 8]),
        ];
        let record = SweepRecord::new;
        Dataset::new(
            "small",
            100.0,
            SweepShape {
                steps: 8,
                rows: 1,
                cols: 2,
            },
            LabelSet::new(["cork", "denim"]).unwrap(),
            vec![record(0, 0), record(0, 1), record(1, 0)],
            Samples::U16(values.concat()),
        )
        .unwrap()
    }

    #[test]
    fn figures_of_values_and_steps_are_counted() {
        let found = measure(&small());
        assert_eq!(found.mean, (16.0 + 32.0 + 48.0 + 16.0 + 72.0) / 48.0);
        assert_eq!((found.percentiles, found.max), ([4.0, 9.0, 9.0], 9.0));
        assert_eq!(
            (found.zeros, found.ones_and_twos),
            (10.0 / 48.0, 10.0 / 48.0)
        );
        // The 42 differences contain +1, +2, +2 and -4.
        assert_eq!(found.steps, [38.0 / 42.0, 1.0 / 42.0, 2.0 / 42.0, 0.0]);
        let variance: f64 = 25.0 / 42.0 - (1.0f64 / 42.0).powi(2);
        assert!((found.step_std - variance.sqrt()).abs() < 1e-12);
        // The levels are (2, 4), (0, 6) and (2, 9).
        assert!((found.level_rms_same - 2.0).abs() < 1e-12);
        assert!((found.level_rms_other - ((25.0 + 13.0) / 4.0f64).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn figures_do_not_depend_on_the_element_type() {
        let small = small();
        let values = (0..3).flat_map(|index| small.sweep(index)).collect();
        let records = small.records().to_vec();
        let float = Dataset::new(
            "float",
            100.0,
            small.shape(),
            small.labels().clone(),
            records,
            Samples::F32(values),
        )
        .unwrap();
        // Figures that the data cannot give are NaN.
        assert_eq!(
            format!("{:?}", measure(&small)),
            format!("{:?}", measure(&float))
        );
    }
}
