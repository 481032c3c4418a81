//! Data sets whose sample rate nobody named.

use crate::Summary;

impl Summary {
    /// Returns a line for each data set whose rate nobody named; `own` stands for `own, labels permuted`, too.
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

/// Returns the warning of a data set whose sample rate nobody named.
///
/// - `rate_hz`: the rate that is assumed
pub fn assumed_rate_text(name: &str, rate_hz: f64) -> String {
    format!(
        "{name} does not say its sample rate; {rate_hz} Hz is assumed, `--set rate_hz=HZ` names it"
    )
}
