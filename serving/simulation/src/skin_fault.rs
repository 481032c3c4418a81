//! Faults of the simulated skin.

use tactnet_data::SweepShape;
use tactnet_pipeline::{DeadTaxels, TaxelOrder};

/// Faults of a skin: taxels in another order, then a gain, then dead taxels.
///
/// # Example
/// ```
/// use tactnet_data::SweepShape;
/// use tactnet_pipeline::{DeadTaxels, TaxelOrder};
/// use tactnet_simulation::SkinFault;
///
/// let fault = SkinFault {
///     order: Some(TaxelOrder::Reversed),
///     gain: 2.0,
///     dead: DeadTaxels([(0, 0.0)].into()),
/// };
/// let mut frame = [1.0, 2.0, 3.0];
/// fault.apply(&mut frame, SweepShape { steps: 1, rows: 1, cols: 3 });
/// assert_eq!(frame, [0.0, 4.0, 2.0]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SkinFault {
    /// Order of the taxels, relative to the data set.
    pub order: Option<TaxelOrder>,
    /// Factor on all values; negative for the opposite sign.
    pub gain: f32,
    /// Dead taxels, by their numbers in the order that is sent, with their readings in digits.
    pub dead: DeadTaxels,
}

impl Default for SkinFault {
    fn default() -> Self {
        Self {
            order: None,
            gain: 1.0,
            dead: DeadTaxels::default(),
        }
    }
}

impl SkinFault {
    /// Changes frames in place: `[frames][taxels]`, in digits.
    ///
    /// - `shape`: shape of the sweeps
    ///
    /// # Panics
    /// If a dead taxel does not exist.
    pub fn apply(&self, frames: &mut [f32], shape: SweepShape) {
        let taxels = shape.taxels();
        if let Some(order) = &self.order {
            let places = order.places(shape);
            for frame in frames.chunks_exact_mut(taxels) {
                let former = frame.to_vec();
                for (value, place) in former.into_iter().zip(&places) {
                    frame[*place] = value;
                }
            }
        }
        frames.iter_mut().for_each(|value| *value *= self.gain);
        self.dead.apply(frames, taxels);
    }
}
