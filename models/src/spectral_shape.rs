//! Sizes of a network on spectra for sweeps of one shape.

use crate::ModelError;
use crate::architecture::{InputShape, Spectra, default_window};
use crate::log_spectra::{LogSpectra, SpectralTables, windows};
use crate::setting::{product, require};

/// Validated sizes of a network on spectra.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectralShape {
    pub(crate) window: usize,
    pub(crate) hop: usize,
    pub(crate) bands: usize,
    pub(crate) taxel_units: usize,
    pub(crate) units: usize,
    pub(crate) windows: usize,
    pub(crate) taxels: usize,
}

impl SpectralShape {
    pub(crate) fn new(settings: &Spectra, input: InputShape) -> Result<Self, ModelError> {
        let Spectra {
            window,
            hop,
            bands,
            taxel_units,
            units,
        } = *settings;
        require(
            input.steps >= 4,
            "input",
            "at least 4 steps, the shortest window",
            input.steps.to_string(),
        )?;
        let window = window.unwrap_or_else(|| default_window(input.steps));
        require(
            window.is_multiple_of(4) && (4..=input.steps).contains(&window),
            "spectra.window",
            &format!(
                "a multiple of four steps, at most the sweep's {}",
                input.steps
            ),
            window.to_string(),
        )?;
        let hop = hop.unwrap_or(window / 4);
        require(hop > 0, "spectra.hop", "at least one step", hop.to_string())?;
        for (setting, number) in [
            ("spectra.bands", bands),
            ("spectra.taxel_units", taxel_units),
            ("spectra.units", units),
        ] {
            require(number > 0, setting, "at least one", number.to_string())?;
        }
        Ok(Self {
            window,
            hop,
            bands: bands.min(window / 2),
            taxel_units,
            units,
            windows: windows(input.steps, window, hop),
            taxels: input.taxels,
        })
    }

    /// Returns the window length in steps.
    pub fn window(&self) -> usize {
        self.window
    }

    /// Returns the steps from one window to the next.
    pub fn hop(&self) -> usize {
        self.hop
    }

    /// Returns the number of frequency bands per taxel.
    pub fn bands(&self) -> usize {
        self.bands
    }

    /// Returns the spectra as matrices, for other programs.
    pub fn tables(&self) -> SpectralTables {
        LogSpectra::new(self.window, self.hop, self.bands, 1)
            .tables()
            .clone()
    }

    /// Returns the number of values per window and taxel: the bands and the mean.
    pub(crate) fn values(&self) -> usize {
        self.bands + 1
    }

    pub(crate) fn parameters(&self) -> Option<u64> {
        let taxel = product(&[self.values() + 2, self.taxel_units])?;
        let window = product(&[self.taxels, self.taxel_units, self.units])?;
        taxel
            .checked_add(window)?
            .checked_add(product(&[2, self.units])?)
    }

    /// Returns the multiply-adds for one sweep: Fourier transform by its definition, squares, two weights per bin, and both layers.
    pub(crate) fn multiply_adds(&self) -> Option<u64> {
        let half = self.window / 2;
        let transform = product(&[self.window, self.window])?.checked_add(product(&[4, half])?)?;
        let dense = product(&[self.values(), self.taxel_units])?;
        let units = product(&[self.taxel_units, self.units])?;
        let each = transform.checked_add(dense)?.checked_add(units)?;
        each.checked_mul(product(&[self.windows, self.taxels])?)
    }

    /// Returns the number of outputs of the widest layer for one sweep.
    pub(crate) fn widest_layer(&self) -> Option<u64> {
        let of_taxel = self.values().max(self.taxel_units).max(self.window);
        let of_window = product(&[self.taxels, of_taxel])?.max(self.units as u64);
        // The Fourier matrices hold about `window * window` numbers.
        let matrices = product(&[self.window, self.window])?;
        Some(of_window.checked_mul(self.windows as u64)?.max(matrices))
    }

    /// Returns the number of features: mean and deviation of each unit.
    pub(crate) fn features(&self) -> Option<u64> {
        product(&[2, self.units])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_follow_the_documented_rule() {
        assert_eq!(default_window(1000), 128);
        assert_eq!(default_window(400), 64);
        assert_eq!(default_window(8800), 128);
        assert_eq!(default_window(100), 16);
        assert_eq!(default_window(9), 8);
        assert_eq!(default_window(7), 4);
        assert_eq!(default_window(4), 4);
    }

    #[test]
    fn any_sweep_of_four_steps_or_more_has_a_window() {
        for steps in 0..300 {
            let shape = SpectralShape::new(&Spectra::default(), InputShape { steps, taxels: 3 });
            match shape {
                Ok(shape) => assert!(shape.windows > 0 && shape.bands > 0, "{steps}"),
                Err(error) => assert!(steps < 4, "{steps}: {error}"),
            }
        }
    }
}
