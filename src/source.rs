//! Reading data sets, with a word on the twin and on rates that nobody named.

use tactnet_data::{DataError, DataSource, Dataset};
use tactnet_pipeline::{LabelOrder, TrainSpec};

/// Says so where the twin is about to be generated, which takes a moment and is no recording.
pub fn announce(data: &str) {
    if DataSource::is_twin(data) {
        say!("generating the twin (synthetic sweeps, not TactMat) …");
    }
}

/// Generates the twin, or reads a file.
pub fn load(data: &str) -> Result<Dataset, DataError> {
    announce(data);
    DataSource::named(data).read()
}

/// Reads `data` as the run of `spec` read its own, with labels in `order`.
pub fn load_as(spec: &TrainSpec, data: &str, order: LabelOrder) -> Result<Dataset, DataError> {
    announce(data);
    spec.read_sweeps_of(data, order)
}

/// Says so where the sample rate is assumed.
pub fn warn_of_assumed_rate(assumed: bool, rate_hz: f64) {
    if assumed {
        say!(
            "warning: the data does not say its sample rate; {rate_hz} Hz is assumed, `--rate HZ` names it"
        );
    }
}
