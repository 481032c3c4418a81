//! The library's public interface.

use tactnet::{Classifier, Dataset, Recipe, Seed, TwinConfig};
use tactnet_data::DataError;
use tactnet_pipeline::ModelRecipe;

fn twin(sweeps: usize) -> Result<Dataset, DataError> {
    Dataset::twin(&TwinConfig {
        materials: 3,
        sweeps,
        steps: 60,
        ..TwinConfig::default()
    })
}

#[test]
fn every_sweep_is_tested_once_and_never_trained_on_then() {
    for (sweeps, folds) in [(2, 2), (4, 4), (12, 5)] {
        let dataset = twin(sweeps).unwrap();
        let all = dataset.folds(Seed(4));
        assert_eq!(all.count(), folds);
        let mut tested: Vec<usize> = Vec::new();
        for fold in all.iter() {
            assert_eq!(fold.train.len() + fold.test.len(), dataset.len());
            tested.extend(fold.test.indices());
        }
        tested.sort_unstable();
        assert!(tested.into_iter().eq(0..dataset.len()));
    }
}

#[test]
fn a_single_sweep_of_a_material_cannot_be_split() {
    let refused = twin(1).unwrap_err();
    assert!(refused.is_usage());
    assert!(
        refused.to_string().contains("found 1 of the 2 sweeps"),
        "{refused}"
    );
}

#[test]
fn names_are_those_of_the_library_and_files_are_read() {
    assert!(Recipe::named("minirocket").is_ok());
    let refused = Recipe::named("fats").unwrap_err();
    assert!(refused.is_usage() && refused.to_string().contains("thesis"));
    assert!(
        Recipe::named("Cargo.toml")
            .unwrap_err()
            .to_string()
            .contains("fast")
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.toml");
    let fast = ModelRecipe::load("fast").unwrap().to_toml();
    std::fs::write(&path, fast).unwrap();
    assert!(Recipe::read(&path).is_ok());
}

#[test]
fn a_saved_classifier_predicts_the_same_bits() {
    let dataset = Dataset::twin(&TwinConfig {
        materials: 3,
        sweeps: 10,
        steps: 120,
        ..TwinConfig::default()
    })
    .unwrap();
    let fold = dataset.folds(Seed(2)).first();
    let folder = tempfile::tempdir().unwrap();
    for (name, recipe) in [
        ("network", Recipe::named("fast").unwrap().epochs(2)),
        ("baseline", Recipe::named("knn-l").unwrap()),
    ] {
        let classifier = recipe.fit(&fold.train).unwrap();
        let path = folder.path().join(name);
        classifier.save(&path).unwrap();
        assert!(classifier.save(&path).is_err(), "a taken folder");
        let again = Classifier::load(&path).unwrap();
        assert!(again.materials().eq(classifier.materials()));
        let (a, b) = (classifier.predict(&fold.test), again.predict(&fold.test));
        assert_eq!(a.unwrap(), b.unwrap());
        assert_eq!(again.online().is_ok(), name == "network");
    }
}

#[test]
fn whoever_says_stop_gets_nothing() {
    let dataset = Dataset::twin(&TwinConfig {
        materials: 2,
        sweeps: 5,
        steps: 60,
        ..TwinConfig::default()
    })
    .unwrap();
    let fold = dataset.folds(Seed(1)).first();
    let stopped = Recipe::named("fast")
        .unwrap()
        .fit_while(&fold.train, |_| false);
    assert!(stopped.unwrap().is_none());
}

#[test]
fn the_readme_shows_the_snippet_that_is_compiled() {
    let shown = include_str!("../../README.md");
    let (_, shown) = shown.split_once("```rust\n").unwrap();
    let (shown, _) = shown.split_once("```").unwrap();
    let library = include_str!("../../src/lib.rs");
    let (_, compiled) = library.split_once("//! ```\n").unwrap();
    let (compiled, _) = compiled.split_once("//! ```\n").unwrap();
    let compiled: String = compiled
        .lines()
        .filter_map(|line| line.strip_prefix("//! "))
        .filter(|line| !line.starts_with('#'))
        .map(|line| format!("{line}\n"))
        .collect();
    assert_eq!(shown, compiled);
}
