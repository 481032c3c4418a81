//! Layers of a network, as a recipe describes them.

use serde::{Deserialize, Serialize};

/// Layers of a network, as a recipe describes them: a trunk that extracts features, a hidden layer and dropout.
///
/// Source of the defaults: Tulbure & Bäuml, Humanoids 2018, figure 4 and table II.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Table", into = "Table")]
pub struct Architecture {
    /// Layers that extract features from a sweep.
    pub trunk: Trunk,
    /// Units of the fully connected layer.
    pub hidden: usize,
    /// Probability that the dropout in front of the fully connected layer keeps a feature, in `(0, 1]`.
    pub keep_probability: f64,
}

/// Layers that extract features from a sweep.
#[derive(Debug, Clone, PartialEq)]
pub enum Trunk {
    /// Convolution blocks of TactNet-II.
    Convolutions(Convolutions),
    /// Layers on the spectra of short windows.
    Spectra(Spectra),
}

/// Settings of the convolution blocks.
#[derive(Debug, Clone, PartialEq)]
pub struct Convolutions {
    /// Maps of each block.
    pub maps: Vec<usize>,
    /// Kernel size, time steps by taxels; both are odd.
    pub kernel: [usize; 2],
    /// Pool size of each block in steps; [`default_pools`] when absent.
    pub pools: Option<Vec<usize>>,
}

impl Default for Convolutions {
    fn default() -> Self {
        Self {
            maps: vec![32, 64, 128],
            kernel: [15, 5],
            pools: None,
        }
    }
}

/// Settings of a network on the spectra of short windows, as a recipe describes them.
///
/// Sizes in steps depend on the sweep length by default, see [`default_window`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Spectra {
    /// Window length in steps, a multiple of four; [`default_window`] when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window: Option<usize>,
    /// Steps from one window to the next; a quarter of a window when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hop: Option<usize>,
    /// Number of frequency bands per taxel, limited to half the window length.
    pub bands: usize,
    /// Number of units of the layer that combines the bands of a taxel, with weights shared by all taxels.
    pub taxel_units: usize,
    /// Number of units of the layer that combines the taxels of a window.
    pub units: usize,
}

impl Default for Spectra {
    fn default() -> Self {
        Self {
            window: None,
            hop: None,
            bands: 12,
            taxel_units: 32,
            units: 64,
        }
    }
}

/// Returns the window length for sweeps of `steps` steps.
///
/// It is the largest power of two that is at most a sixth of the sweep, between 8 and 128, and never longer than the sweep.
/// 1000 steps give 128, 400 steps give 64, 8800 steps give 128.
pub fn default_window(steps: usize) -> usize {
    let sixth = (steps / 6).clamp(8, 128);
    let window = 1 << sixth.ilog2();
    window.min(steps - steps % 4)
}

impl Default for Architecture {
    fn default() -> Self {
        Self {
            trunk: Trunk::Convolutions(Convolutions::default()),
            hidden: 512,
            keep_probability: 0.8,
        }
    }
}

impl Architecture {
    /// Returns the readable name of the kind of network.
    pub fn kind(&self) -> &'static str {
        match self.trunk {
            Trunk::Convolutions(_) => "TactNet-II",
            Trunk::Spectra(_) => "network on spectra",
        }
    }

    /// Returns TactNet-II with the given feature maps and number of hidden units.
    pub fn tactnet2(maps: &[usize], hidden: usize) -> Self {
        Self {
            trunk: Trunk::Convolutions(Convolutions {
                maps: maps.to_vec(),
                ..Convolutions::default()
            }),
            hidden,
            ..Self::default()
        }
    }
}

/// Serialised form of [`Architecture`]: one table in which `spectra` excludes the keys of convolutions.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    #[serde(skip_serializing_if = "Option::is_none")]
    maps: Option<Vec<usize>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    kernel: Option<[usize; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pools: Option<Vec<usize>>,
    hidden: Option<usize>,
    keep_probability: Option<f64>,
    // This field comes last because TOML writes tables after plain values.
    #[serde(skip_serializing_if = "Option::is_none")]
    spectra: Option<Spectra>,
}

impl TryFrom<Table> for Architecture {
    type Error = String;

    fn try_from(table: Table) -> Result<Self, String> {
        let usual = Self::default();
        let trunk = match table.spectra {
            Some(spectra) => {
                let foreign = [
                    ("maps", table.maps.is_some()),
                    ("kernel", table.kernel.is_some()),
                    ("pools", table.pools.is_some()),
                ];
                if let Some((name, _)) = foreign.iter().find(|(_, given)| *given) {
                    return Err(format!(
                        "`network.{name}` is a setting of convolutions and excludes `network.spectra`"
                    ));
                }
                Trunk::Spectra(spectra)
            }
            None => {
                let usual = Convolutions::default();
                Trunk::Convolutions(Convolutions {
                    maps: table.maps.unwrap_or(usual.maps),
                    kernel: table.kernel.unwrap_or(usual.kernel),
                    pools: table.pools,
                })
            }
        };
        Ok(Self {
            trunk,
            hidden: table.hidden.unwrap_or(usual.hidden),
            keep_probability: table.keep_probability.unwrap_or(usual.keep_probability),
        })
    }
}

impl From<Architecture> for Table {
    fn from(architecture: Architecture) -> Self {
        let (convolutions, spectra) = match architecture.trunk {
            Trunk::Convolutions(convolutions) => (Some(convolutions), None),
            Trunk::Spectra(spectra) => (None, Some(spectra)),
        };
        let (maps, kernel, pools) = match convolutions {
            Some(all) => (Some(all.maps), Some(all.kernel), all.pools),
            None => (None, None, None),
        };
        Self {
            maps,
            kernel,
            pools,
            hidden: Some(architecture.hidden),
            keep_probability: Some(architecture.keep_probability),
            spectra,
        }
    }
}

/// Shape of one sweep: `steps` by flattened `taxels`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputShape {
    /// Time steps.
    pub steps: usize,
    /// Taxels, rows and columns flattened.
    pub taxels: usize,
}

/// Returns the pool sizes of `blocks` blocks for sweeps of `steps` steps: ten steps each, or all remaining steps if there are fewer.
///
/// 1000 steps give 10, 10, 10 as published. 400 steps give 10, 10, 4.
/// 8800 steps give 10, 10, 10, which leaves nine pooled steps for the fully connected layer.
pub fn default_pools(steps: usize, blocks: usize) -> Vec<usize> {
    let mut left = steps;
    (0..blocks)
        .map(|_| {
            let pool = left.min(10);
            left = left.div_ceil(pool);
            pool
        })
        .collect()
}
