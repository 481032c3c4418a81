//! Square roots of covariances: lower triangular matrices with a non-negative diagonal.

use nalgebra::{SMatrix, SVector};

/// Returns the lower triangular `L` with `L L' = M M'`, by Householder reflections of the rows (the QR decomposition of
/// `M'`).
pub(super) fn lower<const R: usize, const C: usize>(
    mut m: SMatrix<f64, R, C>,
) -> SMatrix<f64, R, R> {
    const { assert!(C >= R, "needs as many columns as rows") };
    let mut mirror = [0.0; C];
    for i in 0..R {
        let norm = (i..C).map(|j| m[(i, j)] * m[(i, j)]).sum::<f64>().sqrt();
        if norm == 0.0 {
            continue;
        }
        // Reflects the row onto its diagonal, with the sign that avoids cancellation.
        let end = if m[(i, i)] > 0.0 { -norm } else { norm };
        for j in i..C {
            mirror[j] = m[(i, j)];
        }
        mirror[i] -= end;
        let square = (i..C).map(|j| mirror[j] * mirror[j]).sum::<f64>();
        for row in i + 1..R {
            let dot = (i..C).map(|j| m[(row, j)] * mirror[j]).sum::<f64>();
            let factor = 2.0 * dot / square;
            for j in i..C {
                m[(row, j)] -= factor * mirror[j];
            }
        }
        m[(i, i)] = end;
    }
    SMatrix::from_fn(|i, j| match j.cmp(&i) {
        std::cmp::Ordering::Greater => 0.0,
        _ if m[(j, j)] < 0.0 => -m[(i, j)],
        _ => m[(i, j)],
    })
}

/// Replaces `L` by the root of `L L' + x x'`.
pub(super) fn add<const N: usize>(l: &mut SMatrix<f64, N, N>, mut x: SVector<f64, N>) {
    for i in 0..N {
        let r = l[(i, i)].hypot(x[i]);
        if r == 0.0 {
            continue;
        }
        let (c, s) = (l[(i, i)] / r, x[i] / r);
        l[(i, i)] = r;
        for j in i + 1..N {
            let below = l[(j, i)];
            l[(j, i)] = c * below + s * x[j];
            x[j] = c * x[j] - s * below;
        }
    }
}

/// Replaces `L` by the root of `L L' - x x'`. Returns `None` if that is not positive definite; `L` is then invalid.
#[must_use]
pub(super) fn subtract<const N: usize>(
    l: &mut SMatrix<f64, N, N>,
    mut x: SVector<f64, N>,
) -> Option<()> {
    for i in 0..N {
        let diagonal = l[(i, i)];
        let left = (diagonal - x[i]) * (diagonal + x[i]);
        if !(left > 0.0 && left.is_finite()) {
            return None;
        }
        let r = left.sqrt();
        let (c, s) = (diagonal / r, x[i] / r);
        l[(i, i)] = r;
        for j in i + 1..N {
            let below = c * l[(j, i)] - s * x[j];
            x[j] = (x[j] - s * below) / c;
            l[(j, i)] = below;
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn matrix<const R: usize, const C: usize>() -> impl Strategy<Value = SMatrix<f64, R, C>> {
        proptest::collection::vec(-3.0..3.0f64, R * C).prop_map(SMatrix::from_iterator)
    }

    proptest! {
        #[test]
        fn roots_are_roots(m in matrix::<5, 8>(), x in matrix::<5, 1>(), zero in 0..5usize) {
            let l = lower(m);
            prop_assert!((l * l.transpose() - m * m.transpose()).amax() < 1e-12 * 100.0);
            prop_assert!((0..5).all(|i| l[(i, i)] >= 0.0 && (i + 1..5).all(|j| l[(i, j)] == 0.0)));
            let mut more = l;
            add(&mut more, x);
            let expected = l * l.transpose() + x * x.transpose();
            prop_assert!((more * more.transpose() - expected).amax() < 1e-10);
            subtract(&mut more, x).unwrap();
            prop_assert!((more * more.transpose() - l * l.transpose()).amax() < 1e-6);
            let mut singular = m;
            singular.row_mut(zero).fill(0.0);
            let l = lower(singular);
            prop_assert!((l * l.transpose() - singular * singular.transpose()).amax() < 1e-10);
        }

        #[test]
        fn indefinite_matrices_have_no_root(m in matrix::<4, 6>(), i in 0..4usize) {
            let mut l = lower(m);
            let x = l.column(i) * 1.01;
            prop_assert!(subtract(&mut l, x).is_none());
        }
    }
}
