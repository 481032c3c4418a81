//! Confusion matrix as data.

use std::fmt;

use serde::Serialize;

use crate::Predictions;

/// Maximum number of pairs of materials in the text.
const MOST: usize = 5;

/// Confusion matrix.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Confusion {
    /// Names of the materials, in the order of rows and columns.
    pub materials: Vec<String>,
    /// Numbers of sweeps, `[true][predicted]`.
    pub counts: Vec<Vec<usize>>,
}

impl From<&Predictions> for Confusion {
    fn from(predictions: &Predictions) -> Self {
        Self {
            materials: predictions.labels.names().map(String::from).collect(),
            counts: predictions.confusion(),
        }
    }
}

impl fmt::Display for Confusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut mistakes: Vec<(usize, usize, usize)> = Vec::new();
        for (truth, row) in self.counts.iter().enumerate() {
            for (predicted, count) in row.iter().enumerate() {
                if truth != predicted && *count > 0 {
                    mistakes.push((*count, truth, predicted));
                }
            }
        }
        if mistakes.is_empty() {
            return f.write_str("no sweep was taken for another material");
        }
        // The sort is stable: equal counts stay in the order of the materials.
        mistakes.sort_by_key(|(count, _, _)| std::cmp::Reverse(*count));
        f.write_str("most frequent mistakes:")?;
        for (position, (count, truth, predicted)) in mistakes.iter().take(MOST).enumerate() {
            let of: usize = self.counts[*truth].iter().sum();
            write!(
                f,
                "{} {} taken for {} ({count} of {of})",
                if position == 0 { "" } else { "," },
                self.materials[*truth],
                self.materials[*predicted]
            )?;
        }
        match mistakes.len().saturating_sub(MOST) {
            0 => Ok(()),
            1 => f.write_str(" and 1 other pair"),
            more => write!(f, " and {more} other pairs"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn confusion(counts: &[&[usize]]) -> String {
        let names = (0..counts.len()).map(|label| format!("m{label}"));
        Confusion {
            materials: names.collect(),
            counts: counts.iter().map(|row| row.to_vec()).collect(),
        }
        .to_string()
    }

    #[test]
    fn the_most_frequent_mistakes_come_first_with_how_many_sweeps_there_were() {
        assert_eq!(
            confusion(&[&[9, 1, 0], &[0, 7, 3], &[1, 0, 9]]),
            "most frequent mistakes: m1 taken for m2 (3 of 10), m0 taken for m1 (1 of 10), m2 taken for m0 (1 of 10)"
        );
        assert_eq!(
            confusion(&[&[9, 0], &[0, 9]]),
            "no sweep was taken for another material"
        );
        assert!(confusion(&[&[1, 1, 1], &[1, 1, 1], &[1, 1, 1]]).ends_with(" and 1 other pair"));
    }
}
