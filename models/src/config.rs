//! Validated description of a network.

use crate::architecture::{Convolutions, InputShape, Trunk, default_pools};
use crate::setting::{product, require};
use crate::spectral_shape::SpectralShape;
use crate::{Architecture, ModelError};

/// Maximum number of parameters, and of outputs of one layer for one sweep: 8 GiB of 32-bit floats.
const MAX_NUMBERS: u64 = 1 << 31;

/// Validated description of a network.
#[derive(Debug, Clone, PartialEq)]
pub struct NetworkConfig {
    architecture: Architecture,
    input: InputShape,
    materials: usize,
    trunk: TrunkShape,
}

/// Sizes of the layers that extract features.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum TrunkShape {
    Convolutions(ConvolutionShape),
    Spectra(SpectralShape),
}

/// Sizes of the convolution blocks.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ConvolutionShape {
    pub(crate) maps: Vec<usize>,
    pub(crate) kernel: [usize; 2],
    /// Pool size of each block in steps.
    pub(crate) pools: Vec<usize>,
    pub(crate) input: InputShape,
}

impl ConvolutionShape {
    fn new(settings: &Convolutions, input: InputShape) -> Result<Self, ModelError> {
        let Convolutions {
            maps,
            kernel,
            pools,
        } = settings;
        require(
            !maps.is_empty() && maps.iter().all(|m| *m > 0),
            "maps",
            "at least one block of at least one map",
            format!("{maps:?}"),
        )?;
        require(
            kernel.iter().all(|k| k % 2 == 1),
            "kernel",
            "two odd extents",
            format!("{kernel:?}"),
        )?;
        let pools = pools
            .clone()
            .unwrap_or_else(|| default_pools(input.steps, maps.len()));
        require(
            pools.len() == maps.len() && pools.iter().all(|p| *p > 0),
            "pools",
            "one positive pool for each block",
            format!("{pools:?} for {} blocks", maps.len()),
        )?;
        Ok(Self {
            maps: maps.clone(),
            kernel: *kernel,
            pools,
            input,
        })
    }

    fn parameters(&self) -> Option<u64> {
        let mut all = 0u64;
        let mut maps_in = 1;
        for &maps_out in &self.maps {
            // Weights, then scale and shift of the normalisation.
            let weights = product(&[maps_in, maps_out, self.kernel[0], self.kernel[1]])?;
            all = all.checked_add(weights)?;
            all = all.checked_add(product(&[2, maps_out])?)?;
            maps_in = maps_out;
        }
        Some(all)
    }

    fn multiply_adds(&self) -> Option<u64> {
        let mut all = 0u64;
        let (mut maps_in, mut steps) = (1, self.input.steps);
        for (&maps_out, pool) in self.maps.iter().zip(&self.pools) {
            let each = product(&[maps_in, maps_out, self.kernel[0], self.kernel[1]])?;
            all = all.checked_add(each.checked_mul(product(&[steps, self.input.taxels])?)?)?;
            (maps_in, steps) = (maps_out, steps.div_ceil(*pool));
        }
        Some(all)
    }

    /// Returns the number of outputs of the widest block for one sweep.
    fn widest_layer(&self) -> Option<u64> {
        let maps = self.maps.iter().copied().max()?;
        product(&[self.input.steps, self.input.taxels, maps])
    }

    pub(crate) fn pooled_steps(&self) -> usize {
        self.pools
            .iter()
            .fold(self.input.steps, |steps, pool| steps.div_ceil(*pool))
    }

    fn features(&self) -> Option<u64> {
        let maps = self.maps.last().copied().unwrap_or(1);
        product(&[self.pooled_steps(), self.input.taxels, maps])
    }
}

impl NetworkConfig {
    /// Validates `architecture` for sweeps of shape `input` and `materials` output units.
    ///
    /// # Errors
    /// A setting is out of range.
    pub fn new(
        architecture: Architecture,
        input: InputShape,
        materials: usize,
    ) -> Result<Self, ModelError> {
        let Architecture {
            trunk,
            hidden,
            keep_probability,
        } = &architecture;
        require(
            input.steps > 0 && input.taxels > 0,
            "input",
            "at least one step of one taxel",
            format!("{} x {}", input.steps, input.taxels),
        )?;
        let trunk = match trunk {
            Trunk::Convolutions(settings) => {
                TrunkShape::Convolutions(ConvolutionShape::new(settings, input)?)
            }
            Trunk::Spectra(settings) => TrunkShape::Spectra(SpectralShape::new(settings, input)?),
        };
        require(
            *hidden > 0,
            "hidden",
            "at least one unit",
            hidden.to_string(),
        )?;
        require(
            *keep_probability > 0.0 && *keep_probability <= 1.0,
            "keep_probability",
            "a probability above 0 and at most 1",
            keep_probability.to_string(),
        )?;
        require(
            materials > 1,
            "materials",
            "at least two materials",
            materials.to_string(),
        )?;
        let config = Self {
            architecture,
            input,
            materials,
            trunk,
        };
        let [all, layer] = match &config.trunk {
            TrunkShape::Convolutions(_) => ["maps, hidden", "maps, steps, taxels"],
            TrunkShape::Spectra(_) => ["units, hidden", "bands, steps, taxels"],
        };
        for (setting, numbers) in [(all, config.parameters()), (layer, config.widest_layer())] {
            require(
                numbers.is_some_and(|numbers| numbers <= MAX_NUMBERS),
                setting,
                &format!("parameters, and outputs of each layer, of at most {MAX_NUMBERS} numbers"),
                numbers.map_or("more than 2^64".into(), |n| n.to_string()),
            )?;
        }
        Ok(config)
    }

    /// Returns the number of parameters; `None` on overflow.
    pub fn parameters(&self) -> Option<u64> {
        let trunk = match &self.trunk {
            TrunkShape::Convolutions(shape) => shape.parameters(),
            TrunkShape::Spectra(shape) => shape.parameters(),
        };
        trunk?
            .checked_add(self.head_multiply_adds()?)?
            .checked_add(product(&[2, self.architecture.hidden])?)?
            .checked_add(self.materials as u64)
    }

    /// Returns the number of multiply-adds of one prediction without dropout; `None` on overflow.
    ///
    /// Biases and normalisation are excluded. Convolutions and Fourier transforms count by their definition, not by the fast algorithm in use.
    pub fn multiply_adds(&self) -> Option<u64> {
        let trunk = match &self.trunk {
            TrunkShape::Convolutions(shape) => shape.multiply_adds(),
            TrunkShape::Spectra(shape) => shape.multiply_adds(),
        };
        trunk?.checked_add(self.head_multiply_adds()?)
    }

    /// Returns the multiply-adds of the hidden and the output layer, equal to their number of weights.
    fn head_multiply_adds(&self) -> Option<u64> {
        let hidden = self.architecture.hidden;
        let dense = self.trunk_features()?.checked_mul(hidden as u64)?;
        dense.checked_add(product(&[hidden, self.materials])?)
    }

    fn widest_layer(&self) -> Option<u64> {
        match &self.trunk {
            TrunkShape::Convolutions(shape) => shape.widest_layer(),
            TrunkShape::Spectra(shape) => shape.widest_layer(),
        }
    }

    fn trunk_features(&self) -> Option<u64> {
        match &self.trunk {
            TrunkShape::Convolutions(shape) => shape.features(),
            TrunkShape::Spectra(shape) => shape.features(),
        }
    }

    /// Returns the layers.
    pub fn architecture(&self) -> &Architecture {
        &self.architecture
    }

    /// Returns the shape of one sweep.
    pub fn input(&self) -> InputShape {
        self.input
    }

    /// Returns the number of output units.
    pub fn materials(&self) -> usize {
        self.materials
    }

    pub(crate) fn trunk(&self) -> &TrunkShape {
        &self.trunk
    }

    /// Returns the kernel size (time steps by taxels) and the pool size of each block in steps; `None` without convolution blocks.
    pub fn convolutions(&self) -> Option<([usize; 2], &[usize])> {
        match &self.trunk {
            TrunkShape::Convolutions(shape) => Some((shape.kernel, &shape.pools)),
            TrunkShape::Spectra(_) => None,
        }
    }

    /// Returns windows and bands of a network on spectra; `None` for other networks.
    pub fn spectra(&self) -> Option<&SpectralShape> {
        match &self.trunk {
            TrunkShape::Convolutions(_) => None,
            TrunkShape::Spectra(shape) => Some(shape),
        }
    }

    /// Returns the number of steps of the shortest sweep that the network can classify.
    pub fn least_steps(&self) -> usize {
        self.spectra().map_or(1, SpectralShape::window)
    }

    /// Returns the number of features in front of the dropout.
    ///
    /// Convolutions give pooled steps times taxels times maps (16 x 128 = 2048 for TactMat); spectra give two for each unit.
    pub fn features(&self) -> usize {
        self.trunk_features().unwrap_or(0) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Spectra;

    const TACTMAT: InputShape = InputShape {
        steps: 1000,
        taxels: 16,
    };

    #[test]
    fn multiply_adds_are_counted_by_definition() {
        let count = |architecture| {
            NetworkConfig::new(architecture, TACTMAT, 36)
                .unwrap()
                .multiply_adds()
                .unwrap()
        };
        let blocks = 16 * (1000 * 75 * 32 + 100 * 75 * 32 * 64 + 10 * 75 * 64 * 128);
        let head = 2048 * 512 + 512 * 36;
        assert_eq!(count(Architecture::default()), blocks + head);
        let spectra = Architecture {
            trunk: Trunk::Spectra(Spectra::default()),
            ..Architecture::default()
        };
        // 28 windows of 128 steps: transform, squares and bands, 13 values to 32 units, 32 to 64.
        let of_taxel = 128 * 128 + 4 * 64 + 13 * 32 + 32 * 64;
        let head = 128 * 512 + 512 * 36;
        assert_eq!(count(spectra), 28 * 16 * of_taxel + head);
    }

    #[test]
    fn tables_larger_than_memory_are_refused() {
        let input = InputShape {
            steps: 1_000_000,
            taxels: 1,
        };
        let spectra = Spectra {
            window: Some(1_000_000),
            ..Spectra::default()
        };
        let architecture = Architecture {
            trunk: Trunk::Spectra(spectra),
            ..Architecture::default()
        };
        let refused = NetworkConfig::new(architecture, input, 3).unwrap_err();
        assert!(refused.to_string().contains("numbers"), "{refused}");
    }

    #[test]
    fn pools_follow_the_documented_rule() {
        assert_eq!(default_pools(1000, 3), [10, 10, 10]);
        assert_eq!(default_pools(400, 3), [10, 10, 4]);
        assert_eq!(default_pools(8800, 3), [10, 10, 10]);
        assert_eq!(default_pools(100, 3), [10, 10, 1]);
        assert_eq!(default_pools(7, 3), [7, 1, 1]);
    }

    #[test]
    fn settings_out_of_range_are_named() {
        let input = InputShape {
            steps: 100,
            taxels: 4,
        };
        let refused = |architecture: Architecture| {
            NetworkConfig::new(architecture, input, 3)
                .unwrap_err()
                .to_string()
        };
        let convolutions = |change: fn(&mut Convolutions)| {
            let mut settings = Convolutions::default();
            change(&mut settings);
            refused(Architecture {
                trunk: Trunk::Convolutions(settings),
                ..Architecture::default()
            })
        };
        let keep_nothing = Architecture {
            keep_probability: 0.0,
            ..Architecture::default()
        };
        assert!(refused(keep_nothing).contains("keep_probability"));
        assert!(convolutions(|c| c.kernel = [14, 5]).contains("kernel"));
        assert!(
            convolutions(|c| c.pools = Some(vec![10])).contains("one positive pool for each block")
        );
        assert!(convolutions(|c| c.maps.clear()).contains("maps"));
        let spectra = |change: fn(&mut Spectra)| {
            let mut settings = Spectra::default();
            change(&mut settings);
            refused(Architecture {
                trunk: Trunk::Spectra(settings),
                ..Architecture::default()
            })
        };
        assert!(spectra(|s| s.window = Some(7)).contains("spectra.window"));
        assert!(spectra(|s| s.window = Some(10)).contains("a multiple of four"));
        assert!(spectra(|s| s.window = Some(104)).contains("spectra.window"));
        assert!(spectra(|s| s.hop = Some(0)).contains("spectra.hop"));
        assert!(spectra(|s| s.bands = 0).contains("spectra.bands"));
        assert!(spectra(|s| s.units = 0).contains("spectra.units"));
    }
}
