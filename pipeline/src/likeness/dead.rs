//! Taxels that are most likely dead.

use tactnet_data::SweepView;

use super::Likeness;
use super::constant_taxels::constant_taxels;

/// Maximum share of training sweeps in which a taxel does not change that counts as dead if it never does. A larger share may be that of a
/// material which the taxel does not touch.
const MAX_CONSTANT_SHARE: f64 = 0.01;
/// Maximum share of dead taxels. If more do not change, nothing is touched, or the sensor stands still.
const MAX_DEAD_SHARE: f64 = 0.25;

impl Likeness {
    /// Returns the taxels that are most likely dead: they change in none of the sweeps, but in at least 99 % of the training sweeps.
    /// Returns nothing if these are more than a quarter of all taxels.
    ///
    /// # Panics
    /// If the sweeps have another number of taxels than the training sweeps.
    pub fn dead_taxels(&self, view: &SweepView<'_>) -> Vec<usize> {
        let (constant, taxels) = (constant_taxels(view), self.descriptor.taxels());
        // The shares count one more sweep.
        let least_share = 1.0 / (1 + self.constant.sweeps()) as f64;
        let most = MAX_CONSTANT_SHARE.max(least_share) * (1.0 + 1e-6);
        let dead: Vec<usize> = (0..taxels)
            .filter(|taxel| constant.iter().all(|of| of[*taxel]))
            .filter(|taxel| !constant.is_empty() && self.constant.share(*taxel) <= most)
            .collect();
        match dead.len() as f64 <= MAX_DEAD_SHARE * taxels as f64 {
            true => dead,
            false => Vec::new(),
        }
    }
}
