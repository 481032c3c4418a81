//! Data sets whose sample rate nobody named.

use tactnet_data::DataSource;

use crate::{ExperimentRecipe, Summary};

impl ExperimentRecipe {
    /// Reads the data sets, and returns a line for each whose rate nobody named; one that cannot be read is left to its tasks.
    pub fn assumed_rates(&self) -> Vec<String> {
        if self.rate_hz.is_some() {
            return Vec::new();
        }
        let files = self.data.iter().filter(|data| !DataSource::is_twin(data));
        files
            .filter_map(|file| DataSource::named(file).read().ok())
            .filter(|dataset| dataset.is_rate_assumed())
            .map(|dataset| line(dataset.name(), dataset.sample_rate_hz()))
            .collect()
    }
}

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
            .filter_map(|(name, data)| Some(line(name, data.assumed_rate_hz?)))
            .collect()
    }
}

fn line(name: &str, rate_hz: f64) -> String {
    format!(
        "{name} does not say its sample rate; {rate_hz} Hz is assumed, `--set rate_hz=HZ` names it"
    )
}
