//! Faults of the simulated skin, as options.

use anyhow::bail;
use clap::{Args, ValueEnum};
use tactnet_pipeline::{DeadTaxels, TaxelOrder};
use tactnet_simulation::SkinFault;

/// Order of the taxels that a skin sends.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum OrderChoice {
    /// Rows and columns exchanged
    Transposed,
    /// Every row reversed
    MirroredColumns,
    /// Every column reversed
    MirroredRows,
    /// Rotated clockwise by 90 degrees
    #[value(name = "rotated-90")]
    Rotated90,
    /// Rotated by 180 degrees: all taxels in reverse order
    #[value(name = "rotated-180")]
    Rotated180,
    /// Rotated clockwise by 270 degrees
    #[value(name = "rotated-270")]
    Rotated270,
}

impl OrderChoice {
    fn order(self) -> TaxelOrder {
        match self {
            Self::Transposed => TaxelOrder::Transposed,
            Self::MirroredColumns => TaxelOrder::MirroredColumns,
            Self::MirroredRows => TaxelOrder::MirroredRows,
            Self::Rotated90 => TaxelOrder::Rotated { degrees: 90 },
            Self::Rotated180 => TaxelOrder::Rotated { degrees: 180 },
            Self::Rotated270 => TaxelOrder::Rotated { degrees: 270 },
        }
    }
}

#[derive(Args)]
pub struct FaultArgs {
    /// Send the taxels in another order, as after a wrong assembly
    #[arg(long, value_enum, value_name = "ORDER")]
    taxel_order: Option<OrderChoice>,
    /// Factor on all values, such as 1.5, or -1 for the opposite sign
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, allow_negative_numbers = true, value_parser = gain)]
    gain: f32,
    /// Taxels that read 0, counted from 0 row by row
    #[arg(long, value_name = "TAXEL,…", value_delimiter = ',')]
    dead: Vec<usize>,
}

fn gain(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(gain) if f32::is_finite(gain) => Ok(gain),
        _ => Err("expected a number".into()),
    }
}

impl FaultArgs {
    /// Returns the faults.
    ///
    /// - `taxels`: number of taxels of the skin
    pub fn fault(&self, taxels: usize) -> anyhow::Result<SkinFault> {
        if let Some(taxel) = self.dead.iter().find(|taxel| **taxel >= taxels) {
            bail!(
                "--dead: expected numbers from 0 to {}, found {taxel}",
                taxels - 1
            );
        }
        Ok(SkinFault {
            order: self.taxel_order.map(OrderChoice::order),
            gain: self.gain,
            dead: DeadTaxels(self.dead.iter().map(|taxel| (*taxel, 0.0)).collect()),
        })
    }

    /// Returns the options as words, for a child process.
    pub fn words(&self) -> Vec<String> {
        let order = self.taxel_order.and_then(|order| order.to_possible_value());
        let order = order.map(|order| format!("--taxel-order={}", order.get_name()));
        let gain = (self.gain != 1.0).then(|| format!("--gain={}", self.gain));
        let dead: Vec<String> = self.dead.iter().map(usize::to_string).collect();
        let dead = (!dead.is_empty()).then(|| format!("--dead={}", dead.join(",")));
        [order, gain, dead].into_iter().flatten().collect()
    }
}
