//! Data sets of an experiment, each read once.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;

use tactnet_data::format::ReadOptions;
use tactnet_data::{
    Confounding, DataError, DataSource, Dataset, Finding, Scheme, refuse_errors,
    shared_within_blocks,
};
use tactnet_pipeline::{PipelineError, SplitKind};

use crate::{DataProbes, ExperimentError, ExperimentRecipe};

/// A recipe with its data sets in memory, except the twin.
pub struct RecipeWithData<'a> {
    pub(super) recipe: &'a ExperimentRecipe,
    /// Data sets by absolute path.
    files: BTreeMap<String, DataFile>,
}

/// A data set with what the plan needs to know of it.
pub(super) struct DataFile {
    pub(super) dataset: Dataset,
    /// Number of folds of whole blocks; `None` if they are not possible or not usual.
    group_folds: Option<usize>,
    shared: OnceLock<Vec<Finding>>,
}

impl ExperimentRecipe {
    /// Reads the data sets; the twin is skipped.
    ///
    /// # Errors
    /// Data that cannot be read.
    pub fn with_data(&self) -> Result<RecipeWithData<'_>, ExperimentError> {
        let files = self.data.iter().filter(|data| !DataSource::is_twin(data));
        let files = files.map(|name| DataFile::read(self, name).map(|file| (absolute(name), file)));
        let files: Result<_, DataError> = files.collect();
        Ok(RecipeWithData {
            recipe: self,
            files: files.map_err(PipelineError::from)?,
        })
    }
}

impl DataFile {
    fn read(recipe: &ExperimentRecipe, name: &str) -> Result<Self, DataError> {
        let dataset = DataSource::named(name).read_with(&ReadOptions {
            keep: recipe.kept_frames(),
            rate_hz: recipe.rate_hz,
            ..ReadOptions::default()
        })?;
        let is_usual = !dataset.origin().is_comparable_to_published();
        let scheme = Scheme::group_folds_of(&dataset).filter(|_| is_usual);
        Ok(Self {
            group_folds: scheme.and_then(|scheme| scheme.folds(&dataset).ok()),
            dataset,
            shared: OnceLock::new(),
        })
    }

    /// Returns the findings about sweeps of one block that share frames.
    pub(super) fn shared(&self) -> &[Finding] {
        self.shared
            .get_or_init(|| shared_within_blocks(&self.dataset))
    }
}

impl RecipeWithData<'_> {
    /// Checks the data sets and reports findings that are not errors.
    ///
    /// - `on_finding`: receives the data set and the finding; its error ends the review
    ///
    /// # Errors
    /// Data that has errors.
    pub fn review(
        &self,
        mut on_finding: impl FnMut(&Dataset, &Finding) -> Result<(), PipelineError>,
    ) -> Result<(), ExperimentError> {
        let files = self.recipe.data.iter();
        for (name, file) in files.filter_map(|name| Some((name, self.file(name)?))) {
            let findings = refuse_errors(&file.dataset, name).map_err(PipelineError::from)?;
            findings
                .iter()
                .try_for_each(|finding| on_finding(&file.dataset, finding))?;
        }
        Ok(())
    }

    /// Returns a data set; `None` for the twin.
    pub(super) fn file(&self, data: &str) -> Option<&DataFile> {
        self.files.get(&absolute(data))
    }

    /// Returns the number of folds of a split by blocks; `None` for other splits and unsuitable data.
    pub(super) fn folds(&self, data: &str, split: SplitKind) -> Option<usize> {
        let file = self.file(data)?;
        file.group_folds.filter(|_| split == SplitKind::GroupKFold)
    }

    /// Returns the warnings about materials that coincide with recording blocks.
    pub(super) fn warnings(&self) -> Vec<String> {
        let files = self.recipe.data.iter();
        let warning = |name: &String| {
            let dataset = &self.file(name)?.dataset;
            let message = Confounding::of(dataset)?.message(dataset);
            Some(format!("{name}: {message}."))
        };
        files.filter_map(warning).collect()
    }

    /// Returns the probes of the data sets that need no training.
    pub(super) fn probes(&self) -> Vec<DataProbes> {
        let files = self.files.values();
        let probes = files.filter_map(|file| DataProbes::of(&file.dataset, self.recipe.seed));
        probes.collect()
    }
}

/// Returns the absolute path of a file or folder, since tasks may run in another folder; other names stay unchanged.
pub(super) fn absolute(name: &str) -> String {
    let path = Path::new(name);
    path.canonicalize()
        .ok()
        .filter(|_| !DataSource::is_twin(name))
        .map_or_else(|| name.to_string(), |path| path.display().to_string())
}

#[cfg(test)]
mod tests {
    use tactnet_data::format::Format;
    use tactnet_data::twin;

    use super::*;
    use crate::ExperimentDir;

    #[test]
    fn data_is_found_from_any_folder_whether_file_or_folder() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("here/../sweeps");
        std::fs::create_dir_all(dir.path().join("here")).unwrap();
        std::fs::create_dir(dir.path().join("sweeps")).unwrap();
        let found = absolute(&folder.display().to_string());
        let expected = dir.path().canonicalize().unwrap().join("sweeps");
        assert_eq!(found, expected.display().to_string());
        assert_eq!(absolute("twin"), "twin");
        assert_eq!(absolute("no/such/data.h5"), "no/such/data.h5");
    }

    #[test]
    fn data_is_read_once() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("twin.npz");
        Format::Npz
            .write(&path, &twin::small(3, 6, 100).unwrap())
            .unwrap();
        let settings = [
            format!("data=[{:?}]", path.display().to_string()),
            "models=[\"knn-h\"]".into(),
        ];
        let recipe = ExperimentRecipe::load("crossval_baselines", &settings).unwrap();
        let read = recipe.with_data().unwrap();
        std::fs::remove_file(&path).unwrap();
        let mut findings = 0;
        let count = |_: &Dataset, _: &Finding| {
            findings += 1;
            Ok(())
        };
        read.review(count).unwrap();
        assert!(findings > 0);
        let out = ExperimentDir::place_in(dir.path(), &read).unwrap();
        let planned = ExperimentDir::create(&out, &read, "call").unwrap();
        assert_eq!(planned.plan.tasks.len(), 5 * 5);
    }
}
