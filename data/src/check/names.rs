//! Checks of the materials' names.

use std::collections::BTreeMap;

use super::finding;
use crate::{Dataset, Finding, FindingKind, Place, Severity, plain_name};

/// Returns a note if all materials have numbers as names: classifiers find materials by their names.
pub(super) fn numbered(dataset: &Dataset) -> Option<Finding> {
    let is_number = |name: &str| !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_digit());
    let mut names = dataset.labels().names();
    let first = names.next().filter(|name| is_number(name))?;
    names.all(is_number).then(|| {
        let message = format!(
            "all names of materials are numbers, such as `{first}`; classifiers find materials by name, so use the same names \
             in all data sets"
        );
        let kind = FindingKind::NumberedMaterials;
        finding(Severity::Note, kind, Place::default(), message)
    })
}

/// Returns warnings about a single material and about names that differ only in case or white space.
pub(super) fn that_mislead(dataset: &Dataset) -> Vec<Finding> {
    let names: Vec<&str> = dataset.labels().names().collect();
    let warn = |kind, message| finding(Severity::Warning, kind, Place::default(), message);
    if let [only] = names[..] {
        let message = format!(
            "all sweeps are of `{only}`: a classifier of one material is always right; training needs at least two"
        );
        return vec![warn(FindingKind::SingleMaterial, message)];
    }
    let mut plain = BTreeMap::new();
    let mut findings = Vec::new();
    for name in names {
        if let Some(other) = plain.insert(plain_name(name), name) {
            let message = format!(
                "`{other}` and `{name}` are different materials: if they are the same, `y = np.char.lower(np.char.strip(y))` merges them"
            );
            findings.push(warn(FindingKind::AlikeNames, message));
        }
    }
    findings
}
