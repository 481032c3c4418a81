//! Agreement of two groupings.

/// Returns the adjusted Rand index (Hubert & Arabie, 1985): 1 for the same groups under any names, 0 on average for
/// random groups of the same sizes.
///
/// - `a`, `b`: `[materials]`, index of each material's group
///
/// # Panics
/// If the lengths differ.
pub fn adjusted_rand_index(a: &[usize], b: &[usize]) -> f64 {
    assert_eq!(a.len(), b.len(), "two groupings of the same materials");
    // Pairs of materials in the same group in both, only in `a`, only in `b`, and in neither.
    let (mut both, mut only_a, mut only_b, mut neither) = (0.0, 0.0, 0.0, 0.0);
    for i in 0..a.len() {
        for j in 0..i {
            match (a[i] == a[j], b[i] == b[j]) {
                (true, true) => both += 1.0,
                (true, false) => only_a += 1.0,
                (false, true) => only_b += 1.0,
                (false, false) => neither += 1.0,
            }
        }
    }
    if only_a + only_b == 0.0 {
        return 1.0;
    }
    let expected = (both + only_a) * (only_a + neither) + (both + only_b) * (only_b + neither);
    2.0 * (both * neither - only_a * only_b) / expected
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tolerance: both sides are a ratio of small integers in double precision.
    ///
    /// ```python
    /// from sklearn.metrics import adjusted_rand_score  # scikit-learn 1.9.1
    /// print(repr(adjusted_rand_score([0, 0, 1, 1, 2, 2], [0, 0, 1, 2, 2, 2])))
    /// ```
    #[test]
    fn adjusted_rand_index_is_scikit_learns() {
        let golden: [(&[usize], &[usize], f64); 6] = [
            (&[0, 0, 1, 1, 2, 2], &[0, 0, 1, 2, 2, 2], 0.4444444444444444),
            (
                &[0, 1, 2, 0, 1, 2, 0, 1],
                &[1, 1, 0, 0, 2, 2, 1, 0],
                -0.14285714285714285,
            ),
            (&[0, 0, 0, 0], &[0, 1, 2, 3], 0.0),
            (&[0, 0, 0], &[1, 1, 1], 1.0),
            (&[0, 1, 2], &[2, 1, 0], 1.0),
            (
                &[0, 0, 0, 1, 1, 1, 2, 2, 2, 2],
                &[0, 0, 0, 1, 1, 2, 2, 2, 2, 2],
                0.6762589928057554,
            ),
        ];
        for (a, b, expected) in golden {
            assert!(
                (adjusted_rand_index(a, b) - expected).abs() < 1e-12,
                "{a:?} {b:?}"
            );
            assert!(
                (adjusted_rand_index(b, a) - expected).abs() < 1e-12,
                "{b:?} {a:?}"
            );
        }
        assert_eq!(adjusted_rand_index(&[], &[]), 1.0);
    }
}
