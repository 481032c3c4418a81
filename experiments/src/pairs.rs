//! Random pairs of sweeps, half of them of the same material.

use rand::{Rng, RngExt};
use tactnet_pipeline::SweepPair;

/// Draws `count` pairs, alternately of the same and of two different materials. Materials and sweeps are drawn
/// uniformly, and no sweep is paired with itself.
///
/// - `labels`: label of each sweep
///
/// # Panics
/// If there are fewer than two materials, or a material has a single sweep.
pub(crate) fn random_pairs(labels: &[usize], count: usize, rng: &mut impl Rng) -> Vec<SweepPair> {
    let of_label = rows_of_label(labels);
    (0..count)
        .map(|index| {
            let first = rng.random_range(0..of_label.len());
            let second = if index % 2 == 0 {
                first
            } else {
                (first + rng.random_range(1..of_label.len())) % of_label.len()
            };
            let [a, b] = draw(&of_label, [first, second], 1, rng);
            SweepPair {
                first: a[0],
                second: b[0],
                different: first != second,
            }
        })
        .collect()
}

/// Returns the rows of each label that occurs.
pub(crate) fn rows_of_label(labels: &[usize]) -> Vec<Vec<usize>> {
    let count = labels.iter().max().map_or(0, |label| label + 1);
    let mut rows = vec![Vec::new(); count];
    for (row, label) in labels.iter().enumerate() {
        rows[*label].push(row);
    }
    rows.retain(|rows| !rows.is_empty());
    assert!(rows.len() > 1, "pairs need two materials");
    rows
}

/// Draws `sweeps` rows of each of two materials without repetition.
pub(crate) fn draw(
    of_label: &[Vec<usize>],
    materials: [usize; 2],
    sweeps: usize,
    rng: &mut impl Rng,
) -> [Vec<usize>; 2] {
    let mut taken: Vec<usize> = Vec::new();
    materials.map(|material| {
        let rows = &of_label[material];
        assert!(
            rows.len() >= 2 * sweeps,
            "a pair needs {} sweeps of a material",
            2 * sweeps
        );
        (0..sweeps)
            .map(|_| {
                loop {
                    let row = rows[rng.random_range(0..rows.len())];
                    if !taken.contains(&row) {
                        taken.push(row);
                        return row;
                    }
                }
            })
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactnet_data::Seed;

    #[test]
    fn half_of_the_pairs_differ_and_all_materials_take_part() {
        let labels: Vec<usize> = (0..60).map(|i| i % 6).collect();
        let pairs = random_pairs(&labels, 1200, &mut Seed(1).rng("pairs"));
        assert_eq!(pairs.iter().filter(|pair| pair.different).count(), 600);
        let mut seen = [[0; 6]; 6];
        for pair in &pairs {
            assert_ne!(pair.first, pair.second);
            let [a, b] = [pair.first, pair.second].map(|row| labels[row]);
            assert_eq!(pair.different, a != b);
            seen[a][b] += 1;
        }
        // Expected counts: 100 on the diagonal, 20 elsewhere.
        for (a, row) in seen.iter().enumerate() {
            for (b, count) in row.iter().enumerate() {
                let range = if a == b { 60..150 } else { 5..45 };
                assert!(range.contains(count), "{a} {b}: {count}");
            }
        }
    }
}
