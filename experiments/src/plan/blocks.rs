//! Recording blocks of the data sets of an experiment.

use std::collections::BTreeMap;

use tactnet_data::format::ReadOptions;
use tactnet_data::{Confounding, DataSource, Scheme};
use tactnet_pipeline::SplitKind;

use crate::ExperimentRecipe;

/// Folds of whole blocks and warnings, by the path of the data set.
pub(super) struct Blocks {
    of_data: BTreeMap<String, OfData>,
}

struct OfData {
    /// Number of folds of whole blocks; `None` if they are not possible or not usual.
    group_folds: Option<usize>,
    /// Warning about materials that were recorded in one block each.
    warning: Option<String>,
}

impl Blocks {
    /// Reads the data sets of a recipe. Data that cannot be read is left out here; the checks of the plan report it.
    pub(super) fn of(recipe: &ExperimentRecipe) -> Self {
        let files = recipe.data.iter().filter(|data| !DataSource::is_twin(data));
        let of_data = files.filter_map(|data| {
            let options = ReadOptions {
                keep: recipe.kept_frames(),
                rate_hz: recipe.rate_hz,
                ..ReadOptions::default()
            };
            let dataset = DataSource::named(data).read_with(&options).ok()?;
            let scheme = Scheme::group_folds_of(&dataset);
            let is_usual =
                !dataset.origin().is_comparable_to_published() && !dataset.has_test_flag();
            let warning = Confounding::of(&dataset);
            let of = OfData {
                group_folds: scheme
                    .filter(|_| is_usual)
                    .and_then(|scheme| scheme.folds(&dataset).ok()),
                warning: warning.map(|found| format!("{data}: {}.", found.message(&dataset))),
            };
            Some((data.clone(), of))
        });
        Self {
            of_data: of_data.collect(),
        }
    }

    /// Returns the number of folds of a split by blocks; `None` for other splits and unsuitable data.
    pub(super) fn folds(&self, data: &str, split: SplitKind) -> Option<usize> {
        let of = self.of_data.get(data)?;
        of.group_folds.filter(|_| split == SplitKind::GroupKFold)
    }

    /// Returns the warnings about all data sets.
    pub(super) fn warnings(&self) -> Vec<String> {
        let of_data = self.of_data.values();
        of_data.filter_map(|of| of.warning.clone()).collect()
    }
}
