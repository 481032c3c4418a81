//! Suggestions for mistyped names.

use crate::plain_name;

/// Minimum Jaro similarity, 0 to 1, of a suggested name.
const ALIKE: f64 = 0.7;
/// Maximum length of a list that is shown whole.
const SHORT: usize = 20;
/// Number of names shown of a longer list.
const SHOWN: usize = 5;

/// Returns the `known` names and the one most similar to `name`, for the end of a message: `fast, thesis; did you mean
/// `fast`?`. Of more than 20 names only the five most similar are named.
///
/// ```
/// let text = tactnet_data::known_names("fats", ["fast", "thesis"]);
/// assert_eq!(text, "fast, thesis; did you mean `fast`?");
/// ```
pub fn known_names<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let mut known: Vec<&str> = known.into_iter().collect();
    let meant = near_name(name, known.iter().copied());
    let hidden = match known.len() {
        0..=SHORT => 0,
        all => {
            known.sort_by(|a, b| likeness(name, b).total_cmp(&likeness(name, a)));
            all - SHOWN
        }
    };
    let mut list = known[..known.len() - hidden].join(", ");
    if hidden > 0 {
        list.push_str(&format!(" and {hidden} more"));
    }
    match meant {
        Some(meant) => format!("{list}; did you mean `{meant}`?"),
        None => list,
    }
}

/// Returns the most similar of the `known` names, if it is similar enough; the first of equally similar ones.
///
/// ```
/// assert_eq!(tactnet_data::near_name("crok", ["denim", "cork"]), Some("cork"));
/// assert_eq!(tactnet_data::near_name("felt", ["denim", "cork"]), None);
/// ```
pub fn near_name<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let mut nearest = (ALIKE, None);
    for known in known {
        let alike = likeness(name, known);
        if alike > nearest.0 {
            nearest = (alike, Some(known));
        }
    }
    nearest.1
}

/// Returns true if two names differ only in case, white space and invisible characters.
///
/// ```
/// assert!(tactnet_data::is_same_name("Linen Fabric", "linenfabric"));
/// ```
pub fn is_same_name(one: &str, other: &str) -> bool {
    plain_name(one) == plain_name(other)
}

/// Returns the similarity of two names: 1 for the same letters, 0 for no common letter. A part of a name scores 1.
fn likeness(name: &str, known: &str) -> f64 {
    let [name, known] = [name, known].map(str::to_lowercase);
    if name.chars().count() > 2 && known.contains(&name) {
        return 1.0;
    }
    strsim::jaro(&name, &known)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECIPES: [&str; 4] = ["fast", "thesis", "knn-l", "knn-h"];

    #[test]
    fn the_nearest_name_is_proposed_and_nothing_for_another_word() {
        for (typed, meant) in [
            ("fats", "fast"),
            ("Fast", "fast"),
            ("tesis", "thesis"),
            ("knnh", "knn-h"),
        ] {
            assert_eq!(
                known_names(typed, RECIPES),
                format!("fast, thesis, knn-l, knn-h; did you mean `{meant}`?")
            );
        }
        assert_eq!(
            known_names("xyz", RECIPES),
            "fast, thesis, knn-l, knn-h",
            "nothing is near"
        );
        assert_eq!(known_names("fast", []), "");
    }

    #[test]
    fn of_a_long_list_the_nearest_are_given() {
        let names: Vec<String> = (0..36)
            .map(|number| format!("synthetic stuff {number}"))
            .chain(["synthetic leather rough".into()])
            .collect();
        let said = known_names("leather", names.iter().map(String::as_str));
        assert!(said.starts_with("synthetic leather rough, "), "{said}");
        assert!(
            said.ends_with("and 32 more; did you mean `synthetic leather rough`?"),
            "{said}"
        );
    }
}
