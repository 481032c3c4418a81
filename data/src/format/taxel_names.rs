//! Recognition of taxel columns by their names.

use std::path::Path;

use super::dialect::number;
use super::named_sweeps::some_names;
use crate::{DataError, Finding, near_name};

/// Minimum number of taxels that are numbered alike for other columns to be ignored.
const NUMBERED: usize = 4;

/// Returns the columns without the common name pattern, such as a force, a row number or a position. There is a pattern
/// if at least four columns, and two thirds of all, differ only in their numbers (`t0`, `t1` or `s_0_1`); without one the
/// result is empty.
pub(super) fn unlike_the_others(names: &[&str]) -> Vec<usize> {
    // Returns the name without its digits; `None` for a name without digits.
    let pattern = |name: &str| -> Option<String> {
        let name = name.trim();
        name.contains(|c: char| c.is_ascii_digit()).then(|| {
            let words = name.chars().filter(|c| !c.is_ascii_digit());
            words.flat_map(char::to_lowercase).collect()
        })
    };
    let patterns: Vec<Option<String>> = names.iter().map(|name| pattern(name)).collect();
    let alike = |wanted: &Option<String>| patterns.iter().filter(|other| *other == wanted).count();
    let Some(usual) = patterns
        .iter()
        .filter(|pattern| pattern.is_some())
        .max_by_key(|pattern| alike(pattern))
    else {
        return Vec::new();
    };
    let count = alike(usual);
    if count < NUMBERED || 3 * count < 2 * names.len() {
        return Vec::new();
    }
    (0..names.len())
        .filter(|place| patterns[*place] != *usual)
        .collect()
}

/// Returns the columns that the caller chose as taxels, in the caller's order.
///
/// # Errors
/// A name that is not the table's.
pub(super) fn chosen(
    path: &Path,
    names: &[&str],
    wanted: &[String],
) -> Result<Vec<usize>, DataError> {
    let place = |wanted: &String| {
        let place = names.iter().position(|name| name.trim() == wanted.trim());
        place.ok_or_else(|| {
            let meant = match near_name(wanted, names.iter().copied()) {
                Some(meant) => format!("; did you mean `{meant}`?"),
                None => String::new(),
            };
            let found = format!("{}{meant}", some_names(names.iter().copied()));
            DataError::format(
                path,
                "columns",
                format!("a taxel `{}`", wanted.trim()),
                found,
            )
        })
    };
    wanted.iter().map(place).collect()
}

/// Returns a finding about the columns that are not read as taxels.
pub(super) fn left_out(names: &[&str], unlike: &[usize]) -> Vec<Finding> {
    if unlike.is_empty() {
        return Vec::new();
    }
    let named = some_names(unlike.iter().map(|place| names[*place]));
    let example = (0..names.len()).find(|place| !unlike.contains(place));
    let example = example.map_or("", |place| names[place]);
    vec![Finding::not_read(format!(
        "{named}: not read as a taxel, since taxels have names like `{example}`; rename it if it is a taxel"
    ))]
}

/// Returns true if the first line of a table contains names: words, or the numbers 0, 1, 2 and so on.
pub(super) fn is_line_of_names(cells: &[String]) -> bool {
    let counts = cells.len() > 2
        && cells
            .iter()
            .enumerate()
            .all(|(place, cell)| cell.trim().parse() == Ok(place));
    counts || cells.iter().any(|cell| number(cell).is_none())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_next_to_numbered_taxels_is_not_a_taxel() {
        let numbered = ["t0", "t1", "T2", "t3"];
        assert!(unlike_the_others(&numbered).is_empty());
        let with = |more: &[&'static str]| [&numbered[..], more].concat();
        assert_eq!(unlike_the_others(&with(&["force"])), [4]);
        assert_eq!(unlike_the_others(&with(&["row", "force"])), [4, 5]);
        // Three of seven are too many for columns that are not taxels.
        assert!(unlike_the_others(&with(&["a", "b", "c"])).is_empty());
        assert!(unlike_the_others(&["a", "b", "c", "d", "e"]).is_empty());
        assert!(unlike_the_others(&["a0", "a1", "a2", "a3", "b0", "b1", "b2", "b3"]).is_empty());
        assert_eq!(unlike_the_others(&["0", "1", "2", "3", "x"]), [4]);
        assert_eq!(
            unlike_the_others(&["s_0_0", "s_0_1", "s_1_0", "s_1_1", "x1"]),
            [4]
        );
        assert!(
            left_out(&["t0", "force"], &[1])[0]
                .message
                .starts_with("`force`: not read as a taxel")
        );
    }

    #[test]
    fn a_line_of_numbers_from_0_holds_names() {
        let line = |cells: &[&str]| {
            is_line_of_names(&cells.iter().map(|c| c.to_string()).collect::<Vec<_>>())
        };
        assert!(line(&["0", "1", "2"]) && line(&["a", "1"]) && line(&["0", " 1", "2", "3"]));
        assert!(!line(&["0", "1"]) && !line(&["0", "1", "3"]) && !line(&["0.0", "1.0", "2.0"]));
    }
}
