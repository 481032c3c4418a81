//! Lengths to which sweeps are cut.

use serde::{Deserialize, Serialize};
use tactnet_data::DataSource;
use tactnet_data::format::{Keep, ReadOptions};
use tactnet_pipeline::{PipelineError, SweepLengths};

use crate::{ExperimentError, ExperimentRecipe};

/// Number of time steps to which sweeps are cut: a number, `"shortest"` or `"all"`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum SweepLength {
    /// This many time steps.
    Steps(usize),
    /// A length that depends on the data.
    Named(NamedLength),
}

/// Length that depends on the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NamedLength {
    /// That of the shortest sweep of all data sets.
    Shortest,
    /// Every sweep has its own length.
    All,
}

impl SweepLength {
    /// Returns the number of time steps; `None` if sweeps differ, or if it is that of a sweep which has not been read.
    pub fn steps(self) -> Option<usize> {
        match self {
            Self::Steps(steps) => Some(steps),
            Self::Named(_) => None,
        }
    }

    /// Returns the lengths of sweeps of which all steps are kept.
    pub(crate) fn lengths(self) -> SweepLengths {
        match self {
            Self::Named(NamedLength::All) => SweepLengths::Own,
            Self::Steps(_) | Self::Named(NamedLength::Shortest) => SweepLengths::Equal,
        }
    }
}

impl ExperimentRecipe {
    /// Replaces the length `shortest` by the number of time steps of the shortest sweep of all data sets.
    ///
    /// # Errors
    /// Data that cannot be read.
    pub fn measure_lengths(&mut self) -> Result<(), ExperimentError> {
        let unknown = SweepLength::Named(NamedLength::Shortest);
        if !self.steps.contains(&unknown) {
            return Ok(());
        }
        let mut shortest = usize::MAX;
        for data in &self.data {
            let options = ReadOptions {
                keep: Keep::Shortest,
                rate_hz: self.rate_hz,
                ..ReadOptions::default()
            };
            let read = DataSource::named(data).read_with(&options);
            let dataset = read.map_err(PipelineError::from)?;
            shortest = shortest.min(dataset.shape().steps);
        }
        let measured = self.steps.iter_mut().filter(|length| **length == unknown);
        measured.for_each(|length| *length = SweepLength::Steps(shortest));
        Ok(())
    }

    /// Returns the frames of the data sets that the experiment reads: the longest of its lengths.
    pub(crate) fn kept_frames(&self) -> Keep {
        if self
            .steps
            .iter()
            .any(|length| length.lengths() == SweepLengths::Own)
        {
            return Keep::All;
        }
        let lengths = self.steps.iter().filter_map(|length| length.steps());
        lengths.max().into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_sweep_sets_the_number_of_steps() {
        let dir = tempfile::tempdir().unwrap();
        let mut table = String::from("sweep,material,a\n");
        for (sweep, frames) in [30, 25, 40, 33].into_iter().enumerate() {
            for frame in 0..frames {
                table.push_str(&format!(
                    "{sweep},{},{frame}\n",
                    ["cork", "felt"][sweep % 2]
                ));
            }
        }
        let path = dir.path().join("own.csv");
        std::fs::write(&path, table).unwrap();
        let settings = [
            format!("data=[{:?}]", path.display().to_string()),
            "steps=[10, \"shortest\"]".into(),
        ];
        let mut recipe = ExperimentRecipe::load("crossval_baselines", &settings).unwrap();
        recipe.measure_lengths().unwrap();
        assert_eq!(recipe.steps, [10, 25].map(SweepLength::Steps));
        assert_eq!(recipe.kept_frames(), Keep::First(25));
        let one = ["steps=shortest".into(), settings[0].clone()];
        let mut recipe = ExperimentRecipe::load("crossval_baselines", &one).unwrap();
        assert_eq!(recipe.kept_frames(), Keep::Equal);
        recipe.measure_lengths().unwrap();
        assert_eq!(recipe.steps, [SweepLength::Steps(25)]);
        let all = ["steps=all".into(), settings[0].clone()];
        let mut recipe = ExperimentRecipe::load("crossval_baselines", &all).unwrap();
        recipe.measure_lengths().unwrap();
        assert_eq!(recipe.steps, [SweepLength::Named(NamedLength::All)]);
        assert_eq!(recipe.kept_frames(), Keep::All);
        assert!(ExperimentRecipe::load("crossval_baselines", &["steps=longest".into()]).is_err());
    }
}
