//! Checks of the materials' names.

use super::finding;
use crate::{Dataset, Finding, FindingKind, Place, Severity, is_invisible, plain_name, skeleton};

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

/// Returns warnings about a single material and about names that look alike: they differ only in case, white space, invisible
/// characters, or letters of another script.
pub(super) fn that_mislead(dataset: &Dataset) -> Vec<Finding> {
    let names: Vec<&str> = dataset.labels().names().collect();
    let warn = |kind, message| finding(Severity::Warning, kind, Place::default(), message);
    if let [only] = names[..] {
        let message = format!(
            "all sweeps are of `{only}`: a classifier of one material is always right; training needs at least two"
        );
        return vec![warn(FindingKind::SingleMaterial, message)];
    }
    let alike = |key: fn(&str) -> String, place: usize| {
        let own = key(names[place]);
        names[..place]
            .iter()
            .rev()
            .find(|name| key(name) == own)
            .copied()
    };
    let found = |(place, name): (usize, &&str)| {
        // Capitals of other scripts may look like Latin ones where their small letters do not.
        let other = alike(plain_name, place).or_else(|| alike(skeleton, place))?;
        let message = match hidden_difference(other, name) {
            Some(difference) => format!(
                "`{other}` and `{name}` look alike and are different materials: {difference}; if they are the same, give them one name"
            ),
            None => format!(
                "`{other}` and `{name}` are different materials: if they are the same, `y = np.char.lower(np.char.strip(y))` merges them"
            ),
        };
        Some(warn(FindingKind::AlikeNames, message))
    };
    names.iter().enumerate().filter_map(found).collect()
}

/// Returns the first characters in which two names differ, if these look the same or are invisible.
fn hidden_difference(one: &str, other: &str) -> Option<String> {
    let letters = [one, other].map(|name| name.chars().collect::<Vec<char>>());
    if let Some((whose, letter)) = [one, other].iter().find_map(|name| {
        let invisible = name.chars().find(|letter| is_invisible(*letter));
        Some((name, invisible?))
    }) {
        let code = u32::from(letter);
        let place = whose.chars().position(|found| found == letter)? + 1;
        return Some(format!(
            "character {place} of one of them is U+{code:04X}, which is invisible"
        ));
    }
    let mut pairs = letters[0].iter().zip(&letters[1]).enumerate();
    let differs = |(_, (a, b)): &(usize, (&char, &char))| {
        plain_name(&a.to_string()) != plain_name(&b.to_string())
    };
    let (place, (a, b)) = pairs.find(differs)?;
    let [a, b] = [*a, *b].map(u32::from);
    Some(format!(
        "character {} is U+{a:04X} and U+{b:04X}",
        place + 1
    ))
}
