//! Confusion matrices published for TactMat, and their correlation with measured ones.

/// The materials of TactMat in the order of their id; the published confusion groups are consecutive in it.
pub use tactnet_data::twin::NAMES as TACTMAT_MATERIALS;

/// Returns the `[36][36]` confusion matrix of TactNet-II for one sweep, as shares of each row: `[true][predicted]`.
///
/// Source: Tulbure and Bäuml, Humanoids 2018, and chapter 4 of Bäuml's thesis (figure 4.7), measured from the figure's
/// pixels (8-bit grey, +-0.004, so rows add up to 0.97-1.00).
pub fn robot() -> Vec<Vec<f64>> {
    tactnet_data::twin::published_confusions()
        .iter()
        .map(|row| row.to_vec())
        .collect()
}

/// Returns the `[36][36]` confusion matrix of 15 human subjects for one sweep, as shares of each row:
/// `[true][predicted]`.
///
/// Source: Tulbure and Bäuml, Humanoids 2018, and chapter 4 of Bäuml's thesis (figure 4.9), measured from the figure's
/// pixels (8-bit grey, +-0.004, so rows add up to 0.97-1.00).
pub fn human() -> Vec<Vec<f64>> {
    parse(include_str!("published/human_confusion.csv"))
}

/// Returns Pearson's correlation between measured and published row shares over all off-diagonal cells.
///
/// Returns `None` if the sizes differ or one side is constant. Rows without counts are left out.
///
/// - `counts`: `[true][predicted]`
/// - `published`: `[true][predicted]`, shares of the row
pub fn off_diagonal_correlation(counts: &[Vec<usize>], published: &[Vec<f64>]) -> Option<f64> {
    let size = counts.len();
    let square = published.len() == size
        && counts.iter().all(|row| row.len() == size)
        && published.iter().all(|row| row.len() == size);
    if !square {
        return None;
    }
    let mut pairs = Vec::new();
    for (truth, (ours, theirs)) in counts.iter().zip(published).enumerate() {
        let total: usize = ours.iter().sum();
        if total == 0 {
            continue;
        }
        for (predicted, (&count, &share)) in ours.iter().zip(theirs).enumerate() {
            if predicted != truth {
                pairs.push((count as f64 / total as f64, share));
            }
        }
    }
    correlation(&pairs)
}

fn correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    if pairs.is_empty() {
        return None;
    }
    let count = pairs.len() as f64;
    let mean_x = pairs.iter().map(|(x, _)| x).sum::<f64>() / count;
    let mean_y = pairs.iter().map(|(_, y)| y).sum::<f64>() / count;
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (x, y) in pairs {
        let (x, y) = (x - mean_x, y - mean_y);
        xx += x * x;
        yy += y * y;
        xy += x * y;
    }
    (xx > 0.0 && yy > 0.0).then(|| xy / (xx * yy).sqrt())
}

fn parse(csv: &str) -> Vec<Vec<f64>> {
    let rows: Vec<Vec<f64>> = csv
        .lines()
        .map(|line| {
            line.split(',')
                .map(|text| text.trim().parse().unwrap_or(f64::NAN))
                .collect()
        })
        .collect();
    let size = TACTMAT_MATERIALS.len();
    assert!(
        rows.len() == size
            && rows.iter().all(|row| row.len() == size)
            && rows.iter().flatten().all(|share| share.is_finite()),
        "an embedded confusion matrix has {size} rows of {size} numbers"
    );
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean_diagonal(matrix: &[Vec<f64>]) -> f64 {
        let sum: f64 = matrix.iter().enumerate().map(|(k, row)| row[k]).sum();
        sum / matrix.len() as f64
    }

    /// Diagonal means 0.867 and 0.342, measured when the figures were digitised.
    #[test]
    fn the_published_matrices_are_the_ones_that_were_read() {
        assert!((mean_diagonal(&robot()) - 0.867).abs() < 5e-4);
        assert!((mean_diagonal(&human()) - 0.342).abs() < 5e-4);
    }

    #[test]
    fn a_matrix_correlates_fully_with_itself_whatever_its_diagonal() {
        let counts: Vec<Vec<usize>> = robot()
            .iter()
            .map(|row| {
                row.iter()
                    .map(|share| (share * 1e4).round() as usize)
                    .collect()
            })
            .collect();
        let correlation = off_diagonal_correlation(&counts, &robot()).unwrap();
        // Rows only add up to 0.97-1.00, so row shares differ from the published ones by up to 3 %.
        assert!(correlation > 0.999, "{correlation}");
    }

    /// numpy.corrcoef([.1, .2, .3, 0, 0, .5], [.2, .1, .4, .1, 0, .3])[0, 1] = 0.758433
    #[test]
    fn the_correlation_is_pearsons_over_row_shares_off_the_diagonal() {
        let counts = vec![vec![7, 1, 2], vec![6, 14, 0], vec![0, 5, 5]];
        let published = vec![
            vec![0.7, 0.2, 0.1],
            vec![0.4, 0.5, 0.1],
            vec![0.0, 0.3, 0.7],
        ];
        let correlation = off_diagonal_correlation(&counts, &published).unwrap();
        assert!((correlation - 0.758_433).abs() < 1e-6, "{correlation}");
    }

    #[test]
    fn nothing_to_correlate_is_none() {
        let diagonal = vec![vec![5, 0], vec![0, 5]];
        assert_eq!(
            off_diagonal_correlation(&diagonal, &[vec![0.9, 0.1], vec![0.2, 0.8]]),
            None
        );
        assert_eq!(off_diagonal_correlation(&diagonal, &[vec![1.0]]), None);
        assert_eq!(off_diagonal_correlation(&[], &[]), None);
    }
}
