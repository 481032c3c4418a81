//! Description of a sweep in three numbers a taxel and a coarse spectrum.

use realfft::RealFftPlanner;
use tactnet_data::{SweepShape, SweepView};
use tactnet_models::Features;

/// Number of frequency bands, with widths in geometric progression.
const BANDS: usize = 8;
/// Maximum number of groups of taxels; the taxels of larger skins are averaged in groups of neighbours.
const MAX_GROUPS: usize = 64;
/// Floor of the power of a band, as a share of the power of all bands.
pub(super) const LEAST_POWER: f64 = 1e-9;
/// Floor of a standard deviation, as a share of the median one of the training sweeps.
const FLOOR_SHARE: f64 = 1e-3;

/// Part of a description.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DescriptionPart {
    /// Mean of a taxel.
    Level,
    /// Logarithm of the standard deviation of a taxel.
    Spread,
    /// Logarithm of the standard deviation of a taxel's changes, relative to its spread.
    Change,
    /// Logarithms of the powers of the frequency bands of all taxels.
    Spectrum,
}

/// Extractor of descriptions for sweeps of one number of taxels.
pub(super) struct Descriptor {
    shape: SweepShape,
    /// Added to standard deviations before the logarithm, in digits.
    floor: f64,
    /// First frequency bins of the bands of a training sweep, and the bin after the last band.
    edges: Vec<usize>,
}

impl Descriptor {
    /// Creates an extractor.
    ///
    /// - `shape`: shape of the training sweeps; sweeps of other lengths use the same frequencies
    /// - `floor`: result of [`Descriptor::floor_of`] for the training sweeps
    pub fn new(shape: SweepShape, floor: f64) -> Self {
        let last = (shape.steps / 2 + 1) as f64;
        let edge = |band: usize| last.powf(band as f64 / BANDS as f64).round() as usize;
        let mut edges: Vec<usize> = (0..=BANDS).map(edge).collect();
        edges.dedup();
        Self {
            shape,
            floor,
            edges,
        }
    }

    /// Returns the floor of standard deviations, in digits: a thousandth of the median over sweeps and taxels.
    pub fn floor_of(view: &SweepView<'_>) -> f64 {
        let taxels = view.shape().taxels();
        let mut spreads = Vec::with_capacity(view.len() * taxels);
        for position in 0..view.len() {
            let sweep = view.sweep(position);
            let spread = (0..taxels).map(|taxel| Moments::of(&sweep, taxel, taxels).spread);
            spreads.extend(spread.filter(|spread| *spread > 0.0));
        }
        spreads.sort_unstable_by(f64::total_cmp);
        let median = spreads.get(spreads.len() / 2).copied().unwrap_or(1.0);
        // Rounded as it is stored.
        f64::from((FLOOR_SHARE * median) as f32)
    }

    /// Returns the floor of standard deviations, in digits.
    pub fn floor(&self) -> f64 {
        self.floor
    }

    /// Returns the shape of the training sweeps.
    pub fn shape(&self) -> SweepShape {
        self.shape
    }

    /// Returns the number of taxels.
    pub fn taxels(&self) -> usize {
        self.shape.taxels()
    }

    /// Returns the number of groups of taxels with numbers of their own.
    pub fn groups(&self) -> usize {
        self.taxels().min(MAX_GROUPS)
    }

    /// Returns the number of values of a description.
    pub fn width(&self) -> usize {
        3 * self.groups() + self.bands()
    }

    /// Returns the part that a value belongs to.
    pub fn part(&self, value: usize) -> DescriptionPart {
        match value / self.groups() {
            0 => DescriptionPart::Level,
            1 => DescriptionPart::Spread,
            2 => DescriptionPart::Change,
            _ => DescriptionPart::Spectrum,
        }
    }

    /// Returns the descriptions of all sweeps.
    pub fn of_view(&self, view: &SweepView<'_>) -> Features {
        let mut planner = RealFftPlanner::new();
        let mut values = Vec::with_capacity(view.len() * self.width());
        for position in 0..view.len() {
            self.describe(&view.sweep(position), &mut planner, &mut values);
        }
        Features::new(self.width(), values)
    }

    /// Returns the descriptions of sweeps of any length, `[steps][taxels]` each.
    pub fn of_sweeps(&self, sweeps: &[Vec<f32>]) -> Features {
        let mut planner = RealFftPlanner::new();
        let mut values = Vec::with_capacity(sweeps.len() * self.width());
        for sweep in sweeps {
            self.describe(sweep, &mut planner, &mut values);
        }
        Features::new(self.width(), values)
    }

    /// Appends the description of one sweep to `values`.
    fn describe(&self, sweep: &[f32], planner: &mut RealFftPlanner<f64>, values: &mut Vec<f32>) {
        let (taxels, groups) = (self.taxels(), self.groups());
        let steps = sweep.len() / taxels;
        let transform = planner.plan_fft_forward(steps);
        let mut series = transform.make_input_vec();
        let mut bins = transform.make_output_vec();
        let mut sums = vec![[0.0; 4]; groups];
        let mut bands = vec![0.0; self.bands()];
        for taxel in 0..taxels {
            let moments = Moments::of(sweep, taxel, taxels);
            let spread = (moments.spread + self.floor).ln();
            let change = (moments.change + self.floor).ln() - spread;
            let of_group = &mut sums[self.group(taxel)];
            for (sum, value) in of_group
                .iter_mut()
                .zip([moments.level, spread, change, 1.0])
            {
                *sum += value;
            }
            let column = sweep[taxel..].iter().step_by(taxels);
            for (value, digit) in series.iter_mut().zip(column) {
                *value = f64::from(*digit) - moments.level;
            }
            // The lengths are those of the plan.
            if transform.process(&mut series, &mut bins).is_ok() {
                for (band, power) in bands.iter_mut().enumerate() {
                    let [start, end] = self.bins(band, steps, bins.len());
                    *power += bins[start..end]
                        .iter()
                        .map(|bin| bin.norm_sqr())
                        .sum::<f64>();
                }
            }
        }
        for part in 0..3 {
            values.extend(sums.iter().map(|of| (of[part] / of[3]) as f32));
        }
        let least = LEAST_POWER * bands.iter().sum::<f64>() + self.floor * self.floor;
        bands
            .iter_mut()
            .for_each(|power| *power = (*power + least).ln());
        let mean = bands.iter().sum::<f64>() / bands.len() as f64;
        values.extend(bands.iter().map(|band| (band - mean) as f32));
    }

    /// Returns 1 for the frequency bins of every band, else 0, for sweeps as long as the training sweeps: `[bands][steps / 2 + 1]`.
    pub fn band_bins(&self) -> Vec<Vec<f32>> {
        let bins = self.shape.steps / 2 + 1;
        (0..self.bands())
            .map(|band| {
                let [start, end] = self.bins(band, self.shape.steps, bins);
                (0..bins)
                    .map(|bin| f32::from(u8::from((start..end).contains(&bin))))
                    .collect()
            })
            .collect()
    }

    /// Returns the group of a taxel.
    pub fn group(&self, taxel: usize) -> usize {
        taxel * self.groups() / self.taxels()
    }

    fn bands(&self) -> usize {
        self.edges.len() - 1
    }

    /// Returns start and end of the frequency bins of a band in a sweep of `steps` steps with `bins` bins.
    fn bins(&self, band: usize, steps: usize, bins: usize) -> [usize; 2] {
        let at =
            |edge: usize| (edge as f64 * steps as f64 / self.shape.steps as f64).round() as usize;
        let start = at(self.edges[band]).clamp(1, bins.max(2) - 1).min(bins);
        [
            start,
            at(self.edges[band + 1]).clamp((start + 1).min(bins), bins),
        ]
    }
}

/// Mean, standard deviation, and standard deviation of the changes of one taxel.
struct Moments {
    level: f64,
    spread: f64,
    change: f64,
}

impl Moments {
    fn of(sweep: &[f32], taxel: usize, taxels: usize) -> Self {
        let column = || sweep[taxel..].iter().step_by(taxels).map(|v| f64::from(*v));
        let steps = (sweep.len() / taxels) as f64;
        let level = column().sum::<f64>() / steps;
        let variance = column().map(|value| (value - level).powi(2)).sum::<f64>() / steps;
        let changes = || {
            column()
                .skip(1)
                .zip(column())
                .map(|(after, before)| after - before)
        };
        let pairs = (steps - 1.0).max(1.0);
        let mean = changes().sum::<f64>() / pairs;
        let of_changes = changes().map(|change| (change - mean).powi(2)).sum::<f64>() / pairs;
        Self {
            level,
            spread: variance.sqrt(),
            change: of_changes.sqrt(),
        }
    }
}
