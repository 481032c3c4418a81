//! Numbers behind the p-value of a sweep, for other runtimes.

use super::Likeness;
use super::descriptor::LEAST_POWER;
use super::distances::Distance;

/// Numbers behind the p-value of a sweep that is as long as the training sweeps.
pub(crate) struct LikenessTables {
    /// Added to standard deviations before the logarithm, in digits.
    pub floor: f32,
    /// Floor of the power of a band, as a share of the power of all bands.
    pub least_power: f32,
    /// Weight of every taxel in the means of the groups: `[taxels][groups]`.
    pub groups: Vec<Vec<f32>>,
    /// 1 for the frequency bins of every band, else 0: `[bands][bins]`.
    pub band_bins: Vec<Vec<f32>>,
    /// Description that is mapped to zero: `[width]`.
    pub centre: Vec<f32>,
    /// Map of descriptions to whitened ones: `[width][width]`.
    pub map: Vec<Vec<f32>>,
    /// Whitened means of the materials: `[materials][width]`.
    pub means: Vec<Vec<f32>>,
    /// Typical logarithmic distance from every mean: `[materials]`.
    pub typical: Vec<f32>,
    /// Surprise about a taxel that does not change: `[taxels]`.
    pub surprise: Vec<f32>,
    /// Logarithmic distances of the reference sweeps, relative to the typical one.
    pub excesses: Vec<f32>,
    /// Surprises about constant taxels in the reference sweeps.
    pub surprises: Vec<f32>,
    /// Smaller p-value of every reference sweep, times their number plus one.
    pub smaller_ranks: Vec<f32>,
}

impl Likeness {
    /// Returns the numbers behind the p-value of a sweep.
    pub(crate) fn tables(&self) -> LikenessTables {
        let (descriptor, distances) = (&self.descriptor, &self.distances);
        let (taxels, groups) = (descriptor.taxels(), descriptor.groups());
        let mut sizes = vec![0.0f32; groups];
        (0..taxels).for_each(|taxel| sizes[descriptor.group(taxel)] += 1.0);
        let of_group = |taxel: usize, group: usize| match descriptor.group(taxel) == group {
            true => 1.0 / sizes[group],
            false => 0.0,
        };
        let scale = |at: usize| f64::from(distances.scale()[at]);
        let (whitening, width) = (distances.whitening(), descriptor.width());
        let narrow = |values: &[f64]| values.iter().map(|v| *v as f32).collect::<Vec<f32>>();
        let typical = |nearest: &usize| {
            let distance = Distance {
                log: 0.0,
                nearest: *nearest,
                stuck: 0.0,
            };
            -self.within.excess_of(&distance) as f32
        };
        let references = self.within.smaller_p_values().len();
        LikenessTables {
            floor: descriptor.floor() as f32,
            least_power: LEAST_POWER as f32,
            groups: (0..taxels)
                .map(|taxel| (0..groups).map(|group| of_group(taxel, group)).collect())
                .collect(),
            band_bins: descriptor.band_bins(),
            centre: (0..width)
                .map(|at| (whitening.centre()[at] * scale(at)) as f32)
                .collect(),
            map: (0..width)
                .map(|from| {
                    let weight = |to| (whitening.weight(from, to) / scale(from)) as f32;
                    (0..width).map(weight).collect()
                })
                .collect(),
            means: distances.means().iter().map(|mean| narrow(mean)).collect(),
            typical: distances.labels().iter().map(typical).collect(),
            surprise: (0..self.descriptor.taxels())
                .map(|taxel| -self.constant.share(taxel).ln() as f32)
                .collect(),
            excesses: narrow(self.within.excesses()),
            surprises: narrow(self.within.constant_surprises()),
            smaller_ranks: (self.within.smaller_p_values().iter())
                .map(|p| (p * (1 + references) as f64).round() as f32)
                .collect(),
        }
    }
}
