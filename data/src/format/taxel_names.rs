//! Recognition of taxel columns by their names.

use std::path::Path;

use super::dialect::number;
use super::frame_table::{MATERIAL, MEANT_AS_MATERIAL, MEANT_AS_SWEEP, is_one_of};
use super::named_sweeps::{some_names, some_of};
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

/// Returns notes on columns without a name of their own: those that are ignored, as the index that pandas writes, and those
/// that are read as taxels.
///
/// - `names`: names of all columns
/// - `is_taxel`: returns true for the places of columns that are read
fn nameless(names: &[&str], is_taxel: impl Fn(usize) -> bool) -> Vec<Finding> {
    let is_nameless = |name: &str| {
        let name = name.trim().to_ascii_lowercase();
        name.is_empty() || name.starts_with("unnamed: ") || name.starts_with("__index_level_")
    };
    let shown = |place: usize| match names[place].trim() {
        "" => (place + 1).to_string(),
        name => format!("{} (`{name}`)", place + 1),
    };
    let (read, ignored): (Vec<usize>, Vec<usize>) = (0..names.len())
        .filter(|&place| is_nameless(names[place]))
        .partition(|&place| is_taxel(place));
    let note = |places: &[usize], what: &str| {
        let listed = some_of(places.iter().map(|&place| shown(place)).collect());
        let columns = if places.len() == 1 {
            "column"
        } else {
            "columns"
        };
        (!places.is_empty())
            .then(|| Finding::not_read(format!("{columns} {listed} without a name: {what}")))
    };
    let ignored = note(
        &ignored,
        "not read, as a number of the row; give it a name if it is a taxel",
    );
    let read = note(&read, "read as a taxel; leave it out if it is none");
    ignored.into_iter().chain(read).collect()
}

/// Returns a note on columns that are read as taxels although they have the name of a column of materials or sweeps.
fn misnamed(names: &[&str], is_taxel: impl Fn(usize) -> bool) -> Option<Finding> {
    // `y` is usually a direction.
    let known = [MATERIAL, MEANT_AS_MATERIAL, MEANT_AS_SWEEP].concat();
    let is_other = |name: &str| is_one_of(name, &known) && !is_one_of(name, &["y"]);
    let places = (0..names.len()).filter(|&place| is_taxel(place) && is_other(names[place]));
    let found: Vec<&str> = places.map(|place| names[place]).collect();
    let listed = some_names(found.iter().copied());
    (!found.is_empty()).then(|| {
        Finding::not_read(format!(
            "{listed}: read as a taxel, although columns of materials or sweeps have such names; leave it out if it is none"
        ))
    })
}

/// Returns notes on columns whose names leave their meaning open.
///
/// - `names`: names of all columns
/// - `is_taxel`: returns true for the places of columns that are read as taxels
pub(super) fn doubtful(names: &[&str], is_taxel: impl Fn(usize) -> bool) -> Vec<Finding> {
    let mut notes = nameless(names, &is_taxel);
    notes.extend(misnamed(names, is_taxel));
    notes
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
    fn columns_without_a_name_are_noted() {
        let notes = |names: &[&str], taxels: &[usize]| -> Vec<String> {
            let notes = nameless(names, |place| taxels.contains(&place));
            notes.into_iter().map(|note| note.message).collect()
        };
        assert!(notes(&["t0", "t1"], &[0, 1]).is_empty());
        let end =
            "without a name: not read, as a number of the row; give it a name if it is a taxel";
        assert_eq!(notes(&["", "t0"], &[1]), [format!("column 1 {end}")]);
        assert_eq!(
            notes(&["t0", "Unnamed: 3", " "], &[0, 1]),
            [
                format!("column 3 {end}"),
                "column 2 (`Unnamed: 3`) without a name: read as a taxel; leave it out if it is none".into()
            ]
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
