//! Notes on missing and wide 95 % intervals.

use crate::phrases::listed;
use crate::statistic::Statistic;

/// Largest number of folds or tasks whose interval counts as wide: Student's factor is 12.7 with two and 4.3 with
/// three.
const FEW: usize = 3;

/// Returns why an interval is missing or wide, as the end of a sentence; `None` for a usual interval.
///
/// - `noun`: unit of repetition, `fold` or `task`
pub(crate) fn interval_note(statistic: &Statistic, noun: &str) -> Option<String> {
    let count = statistic.values.len();
    match statistic.ci95 {
        None if count < 2 => Some(format!("none, since there is one {noun} only")),
        None => Some(format!("none, since all {count} {noun}s are equal")),
        Some(_) if count <= FEW => Some(format!("wide, since it rests on {count} {noun}s only")),
        Some(_) => None,
    }
}

/// Returns one line for each reason why intervals of a table are missing or wide. A line names its rows unless it
/// holds for all rows.
///
/// - `rows`: name and statistic
pub fn interval_notes<'a>(
    rows: impl Iterator<Item = (String, &'a Statistic)>,
    noun: &str,
) -> Vec<String> {
    let mut all = 0;
    let mut notes: Vec<(String, usize, Vec<String>)> = Vec::new();
    for (name, statistic) in rows {
        all += 1;
        let Some(note) = interval_note(statistic, noun) else {
            continue;
        };
        let known = notes.iter_mut().find(|(other, ..)| *other == note);
        match known {
            Some((_, count, names)) => {
                *count += 1;
                if !names.contains(&name) {
                    names.push(name);
                }
            }
            None => notes.push((note, 1, vec![name])),
        }
    }
    let shown = notes.into_iter().map(|(note, count, names)| {
        let of = match count == all {
            true => String::new(),
            false => format!(" of {}", listed(&names)),
        };
        format!("95 % interval{of}: {note}")
    });
    shown.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64]) -> Statistic {
        Statistic::of_shares(values.to_vec(), 0.25)
    }

    #[test]
    fn few_and_equal_folds_are_named_and_five_that_differ_are_not() {
        let note = |values: &[f64]| interval_note(&of(values), "fold");
        assert_eq!(note(&[0.5]).unwrap(), "none, since there is one fold only");
        assert_eq!(
            note(&[1.0, 1.0]).unwrap(),
            "none, since all 2 folds are equal"
        );
        assert_eq!(
            note(&[0.8, 0.9, 0.85]).unwrap(),
            "wide, since it rests on 3 folds only"
        );
        assert_eq!(note(&[0.8, 0.9, 0.85, 0.86]), None);
    }

    #[test]
    fn a_note_names_rows_where_it_does_not_hold_for_all() {
        let (wide, equal, usual) = (of(&[0.4, 0.6]), of(&[1.0, 1.0]), of(&[0.1, 0.2, 0.3, 0.4]));
        let notes = |rows: &[(&str, &Statistic)]| {
            let rows = rows.iter().map(|(name, of)| (name.to_string(), *of));
            interval_notes(rows, "fold")
        };
        assert_eq!(
            notes(&[("a", &wide), ("b", &wide)]),
            ["95 % interval: wide, since it rests on 2 folds only"]
        );
        assert_eq!(
            notes(&[("a", &equal), ("b", &wide), ("c", &equal), ("d", &usual)]),
            [
                "95 % interval of a and c: none, since all 2 folds are equal",
                "95 % interval of b: wide, since it rests on 2 folds only"
            ]
        );
        assert!(notes(&[("d", &usual)]).is_empty());
    }
}
