//! Default folders of runs.

use std::path::{Path, PathBuf};

use tactnet_data::{Fold, Scheme};

use crate::{MeanRemoval, RunConfig};

/// Returns `runs/DATA-RECIPE-FOLD-SEED`, or the first of `…-2`, `…-3` that does not exist.
pub(crate) fn free_folder(dataset: &str, config: &RunConfig, fold: &Fold<'_>) -> PathBuf {
    let part = match fold.scheme() {
        Scheme::HoldOut { .. } => format!("holdout{}", fold.repeat()),
        Scheme::TestFlag => "test_flag".to_string(),
        Scheme::TrainOnAll => "all".to_string(),
        Scheme::LeaveBlockOut => format!("block{}", fold.fold()),
        Scheme::GroupKFold { .. } => format!("run{}_groups{}", fold.repeat(), fold.fold()),
        Scheme::StratifiedKFold { .. } if fold.repeat() == 0 => format!("fold{}", fold.fold()),
        Scheme::StratifiedKFold { .. } => format!("run{}_fold{}", fold.repeat(), fold.fold()),
    };
    let levels = match config.recipe.levels() {
        MeanRemoval::None => "",
        MeanRemoval::PerSweep => "-no_levels",
    };
    let (recipe, seed) = (config.recipe.name(), config.spec.seed.0);
    let name: String = format!("{dataset}-{recipe}{levels}-{part}-{seed}")
        .chars()
        .map(|c| {
            if c.is_alphanumeric() || "-_.".contains(c) {
                c
            } else {
                '_'
            }
        })
        .collect();
    let first = Path::new("runs").join(&name);
    if !first.exists() {
        return first;
    }
    let mut number = 2;
    loop {
        let folder = Path::new("runs").join(format!("{name}-{number}"));
        if !folder.exists() {
            return folder;
        }
        number += 1;
    }
}
