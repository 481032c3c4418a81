//! Folders of data sets.

use std::path::Path;

use tactnet_data::{DataSource, format};

use crate::ExperimentRecipe;

impl ExperimentRecipe {
    /// Replaces each folder that holds data sets, and is none itself, by the data sets in it, sorted by name.
    pub fn open_folders(&mut self) {
        let sets_of = |name: &String| {
            let sets = match DataSource::is_twin(name) {
                true => Vec::new(),
                false => format::data_sets_in(Path::new(name)),
            };
            // Tasks read the files that links stand for, so data sets are named after these.
            let sets = sets
                .into_iter()
                .map(|set| set.canonicalize().unwrap_or(set));
            let sets: Vec<String> = sets.map(|set| set.display().to_string()).collect();
            match sets.is_empty() {
                true => vec![name.clone()],
                false => sets,
            }
        };
        self.data = self.data.iter().flat_map(sets_of).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_of_data_sets_stands_for_all_of_them() {
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().canonicalize().unwrap();
        let path = |name: &str| whole.join(name).display().to_string();
        for name in ["b.npz", "a.h5", "README.md"] {
            std::fs::write(path(name), "").unwrap();
        }
        let settings = [format!("data=[\"twin\", {:?}]", path(""))];
        let mut recipe = ExperimentRecipe::load("crossval_baselines", &settings).unwrap();
        recipe.open_folders();
        assert_eq!(
            recipe.data,
            ["twin".to_string(), path("a.h5"), path("b.npz")]
        );

        // A folder of sweeps is one data set.
        std::fs::create_dir(path("felt")).unwrap();
        std::fs::write(path("felt/1.csv"), "a\n1\n").unwrap();
        let mut recipe = ExperimentRecipe::load("crossval_baselines", &settings).unwrap();
        recipe.open_folders();
        assert_eq!(recipe.data, ["twin".to_string(), path("")]);
    }
}
