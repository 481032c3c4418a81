//! Triangular frequency bands over the bins of a spectrum, as in a mel filter bank (Davis & Mermelstein, 1980).

/// Weights of neighbouring bins, which sum to one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Band {
    /// Index of the first weight's bin; 0 is bin 1 of the spectrum.
    pub(crate) first: usize,
    pub(crate) weights: Vec<f32>,
}

/// Returns triangular bands over bins 1 to `bins`.
///
/// Each triangle reaches from the centre of the previous band to that of the next, and at least one bin to either side.
pub(crate) fn triangles(bins: usize, bands: usize) -> Vec<Band> {
    if bands >= bins {
        let own = |first| Band {
            first,
            weights: vec![1.0],
        };
        return (0..bins).map(own).collect();
    }
    let centre = |band: usize| {
        if bands == 1 {
            return (bins as f64).sqrt();
        }
        (bins as f64).powf(band as f64 / (bands - 1) as f64)
    };
    let triangle = |band: usize| {
        let middle = centre(band);
        let below = if band > 0 { centre(band - 1) } else { 0.0 };
        let above = if band + 1 < bands {
            centre(band + 1)
        } else {
            bins as f64 + 1.0
        };
        let (below, above) = if bands == 1 {
            (0.0, bins as f64 + 1.0)
        } else {
            (below.min(middle - 1.0), above.max(middle + 1.0))
        };
        let weight = |bin: usize| {
            let bin = bin as f64;
            ((bin - below) / (middle - below)).min((above - bin) / (above - middle))
        };
        let met: Vec<usize> = (1..=bins).filter(|bin| weight(*bin) > 0.0).collect();
        let total: f64 = met.iter().map(|bin| weight(*bin)).sum();
        Band {
            first: met[0] - 1,
            weights: met
                .iter()
                .map(|bin| (weight(*bin) / total) as f32)
                .collect(),
        }
    };
    (0..bands).map(triangle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_cover_every_bin_and_weigh_one() {
        for (bins, bands) in [
            (32, 24),
            (32, 32),
            (32, 99),
            (16, 5),
            (2, 1),
            (256, 24),
            (9, 8),
        ] {
            let found = triangles(bins, bands);
            assert_eq!(found.len(), bands.min(bins));
            let mut met = vec![false; bins];
            for band in &found {
                assert!((band.weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
                met[band.first..][..band.weights.len()].fill(true);
            }
            assert!(met.iter().all(|met| *met), "{bins} {bands}: {met:?}");
        }
    }
}
