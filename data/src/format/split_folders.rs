//! Folders `train`, `test` and `val` at the top of a data set: a split, whose folders are the materials.

use std::path::{Path, PathBuf};

use super::named_sweeps::some_names;
use crate::{Finding, FindingKind, Severity};

/// Part of a split.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Train,
    Validation,
    Test,
}

impl Part {
    /// Returns the part that a folder of this name holds; `None` for a material.
    pub(super) fn of_folder(folder: &Path) -> Option<Self> {
        let name = folder.file_name()?.to_string_lossy().to_lowercase();
        match name.as_str() {
            "train" | "training" => Some(Self::Train),
            "val" | "valid" | "validation" => Some(Self::Validation),
            "test" | "testing" => Some(Self::Test),
            _ => None,
        }
    }
}

/// Folders of a split.
#[derive(Debug, Clone)]
pub(super) struct SplitFolders(Vec<(PathBuf, Part)>);

impl SplitFolders {
    /// Returns the folders of a split among the folders at the top of a data set; `None` if these are materials.
    ///
    /// - `has_sweeps`: returns true for a folder with files of sweeps
    /// - `has_materials`: returns true for a folder that has folders with files of sweeps
    pub(super) fn among(
        folders: &[PathBuf],
        has_sweeps: impl Fn(&Path) -> bool,
        has_materials: impl Fn(&Path) -> bool,
    ) -> Option<Self> {
        let part = |folder: &PathBuf| Some((folder.clone(), Part::of_folder(folder)?));
        let parts: Vec<(PathBuf, Part)> = folders.iter().filter_map(part).collect();
        let are_materials =
            |folder: &PathBuf| Part::of_folder(folder).is_none() && has_sweeps(folder);
        if folders.iter().any(are_materials) {
            return None;
        }
        let filled = parts
            .iter()
            .filter(|(folder, _)| has_sweeps(folder))
            .count();
        let is_split = parts.iter().any(|(folder, _)| has_materials(folder)) || filled > 1;
        is_split.then_some(Self(parts))
    }

    /// Returns the folders with their parts.
    pub(super) fn parts(&self) -> &[(PathBuf, Part)] {
        &self.0
    }

    /// Returns true for test sweeps; `None` if the split has no test sweeps or no others.
    pub(super) fn test_flag(&self, part: Part) -> Option<bool> {
        let is_test = |(_, part): &(PathBuf, Part)| *part == Part::Test;
        let is_split = self.0.iter().any(is_test) && !self.0.iter().all(is_test);
        is_split.then_some(part == Part::Test)
    }

    /// Returns a note on the split.
    pub(super) fn note(&self) -> Finding {
        let names = |wanted: fn(Part) -> bool| -> Option<String> {
            let names = self.0.iter().filter(|(_, part)| wanted(*part));
            let names: Vec<String> = names.map(|(folder, _)| file_name(folder)).collect();
            let listed = some_names(names.iter().map(String::as_str));
            (!names.is_empty()).then_some(listed)
        };
        let all = names(|_| true).unwrap_or_default();
        let mut message = format!("{all}: read as a split; the folders in them name the materials");
        if let (Some(test), Some(_)) =
            (names(|part| part == Part::Test), self.test_flag(Part::Test))
        {
            message.push_str(&format!("; sweeps in {test} are test sweeps"));
        }
        if let Some(validation) = names(|part| part == Part::Validation) {
            message.push_str(&format!("; sweeps in {validation} are training sweeps"));
        }
        Finding::new(Severity::Note, FindingKind::FolderLayout, message)
    }
}

fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(folders: &[&str], filled: &[&str], nested: &[&str]) -> Option<SplitFolders> {
        let paths: Vec<PathBuf> = folders.iter().map(PathBuf::from).collect();
        let is_in =
            |folder: &Path, names: &[&str]| names.iter().any(|name| folder == Path::new(name));
        SplitFolders::among(&paths, |of| is_in(of, filled), |of| is_in(of, nested))
    }

    #[test]
    fn a_split_has_folders_of_materials_or_two_parts_without() {
        assert!(split(&["Train", "TEST"], &[], &["Train", "TEST"]).is_some());
        assert!(split(&["training"], &[], &["training"]).is_some());
        assert!(split(&["train", "test"], &["train", "test"], &[]).is_some());
        // A material with this name.
        assert!(split(&["cork", "test"], &["cork", "test"], &[]).is_none());
        assert!(split(&["cork", "test"], &["cork"], &["test"]).is_none());
        assert!(split(&["test"], &["test"], &[]).is_none());
        assert!(split(&["cork", "felt"], &[], &["cork"]).is_none());
    }

    #[test]
    fn a_split_without_test_sweeps_has_no_flags() {
        let all = ["train", "valid", "test"];
        let split_of = |names: &[&str]| split(names, &[], names).unwrap();
        let whole = split_of(&all);
        assert_eq!(whole.test_flag(Part::Test), Some(true));
        assert_eq!(whole.test_flag(Part::Validation), Some(false));
        assert_eq!(
            whole.note().message,
            "`train`, `valid`, `test`: read as a split; the folders in them name the materials; sweeps in `test` are test sweeps; sweeps in `valid` are training sweeps"
        );
        assert_eq!(split_of(&["train"]).test_flag(Part::Train), None);
        assert_eq!(split_of(&["test"]).test_flag(Part::Test), None);
        assert!(!split_of(&["test"]).note().message.contains("test sweeps"));
    }
}
