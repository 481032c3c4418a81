//! Names that somebody mistyped: which one was meant, and which there are.

/// How alike two names must be that one is proposed for the other, as Jaro measures it: 0 to 1.
const ALIKE: f64 = 0.7;
/// Lists up to this length are given whole.
const SHORT: usize = 16;
/// Names given of a longer list.
const SHOWN: usize = 5;

/// Returns which of the `known` names there are, and which of them `name` is nearest to, to stand at the end of a message:
/// `fast, thesis; did you mean `fast`?`. Of more than 16 names only the five nearest are given.
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

/// Returns the one of the `known` names that was meant by `name`, if one is near enough; of equally near ones the first.
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

/// Returns true if two names differ in nothing but case and blanks.
pub fn is_same_name(one: &str, other: &str) -> bool {
    plain_name(one) == plain_name(other)
}

/// Returns a name in lower case, without blanks.
pub(crate) fn plain_name(name: &str) -> String {
    name.to_lowercase().split_whitespace().collect()
}

/// 1 for the same letters, 0 for nothing in common. Part of a name is more than any other spelling.
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
