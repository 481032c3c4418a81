//! Warnings about data sets without a sample rate.

use crate::Summary;

impl Summary {
    /// Returns a warning for each data set that does not state its sample rate. The warning for `own` also covers
    /// `own, labels permuted`.
    pub fn assumed_rates(&self) -> Vec<String> {
        let is_treated = |name: &str| {
            self.data.keys().any(|whole| {
                name.strip_prefix(whole.as_str())
                    .is_some_and(|rest| rest.starts_with(", "))
            })
        };
        let whole = self.data.iter().filter(|(name, _)| !is_treated(name));
        whole
            .filter_map(|(name, data)| Some(assumed_rate_text(name, data.assumed_rate_hz?)))
            .collect()
    }
}

/// Returns the warning for a data set that does not state its sample rate.
///
/// - `rate_hz`: assumed rate, in Hz
pub fn assumed_rate_text(name: &str, rate_hz: f64) -> String {
    format!(
        "{name} does not say its sample rate; {rate_hz} Hz is assumed, `--set rate_hz=HZ` names it"
    )
}
