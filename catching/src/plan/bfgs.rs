//! Quasi-Newton approximation of a Hessian from steps and gradient changes.

/// Updates the matrix by the formula of Broyden, Fletcher, Goldfarb and Shanno with Powell's damping, which keeps it
/// positive definite. A step without information changes nothing.
///
/// - `b`: approximation of the Hessian, symmetric
/// - `s`: step
/// - `y`: change of the gradient
pub(crate) fn update<const N: usize>(b: &mut [[f64; N]; N], s: &[f64; N], y: &[f64; N]) {
    let bs: [f64; N] = std::array::from_fn(|i| (0..N).map(|k| b[i][k] * s[k]).sum());
    let sbs: f64 = (0..N).map(|i| s[i] * bs[i]).sum();
    let sy: f64 = (0..N).map(|i| s[i] * y[i]).sum();
    if sbs.is_nan() || sbs <= 1e-14 || !sy.is_finite() {
        return;
    }
    let theta = if sy >= 0.2 * sbs {
        1.0
    } else {
        0.8 * sbs / (sbs - sy)
    };
    let r: [f64; N] = std::array::from_fn(|i| theta * y[i] + (1.0 - theta) * bs[i]);
    let sr: f64 = (0..N).map(|i| s[i] * r[i]).sum();
    for i in 0..N {
        for k in 0..N {
            b[i][k] += r[i] * r[k] / sr - bs[i] * bs[k] / sbs;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(b: &[[f64; 3]; 3], s: &[f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| (0..3).map(|k| b[i][k] * s[k]).sum())
    }

    #[test]
    fn a_step_along_which_the_gradient_grows_is_learnt_exactly() {
        let mut b = [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let (s, y) = ([1.0, -0.5, 0.25], [3.0, 0.5, 1.0]);
        update(&mut b, &s, &y);
        for (found, expected) in times(&b, &s).iter().zip(y) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }

    #[test]
    fn a_gradient_that_falls_leaves_the_matrix_positive_definite() {
        let mut b = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let s = [1.0, 0.0, 0.0];
        update(&mut b, &s, &[-5.0, 0.3, 0.0]);
        let along: f64 = s.iter().zip(times(&b, &s)).map(|(s, bs)| s * bs).sum();
        let off = along - 0.2;
        assert!(off.abs() < 1e-12, "Powell's share of before: {along}");
        let before = b;
        update(&mut b, &[0.0; 3], &[1.0; 3]);
        assert_eq!(b, before);
    }
}
