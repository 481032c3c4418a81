//! Short Fourier transforms in registers, one map per lane.
//!
//! Radices 3 and 5 use the symmetry of their roots of unity; 6, 8, 9, 10 and 12 combine two shorter transforms.

use super::simd::Lanes;

/// Vector of complex values.
#[derive(Debug, Clone, Copy)]
pub(super) struct Complex<L> {
    pub(super) re: L,
    pub(super) im: L,
}

impl<L: Lanes> Complex<L> {
    #[inline(always)]
    pub(super) fn zero() -> Self {
        Self {
            re: L::splat(0.0),
            im: L::splat(0.0),
        }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self {
            re: self.re.add(other.re),
            im: self.im.add(other.im),
        }
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        Self {
            re: self.re.sub(other.re),
            im: self.im.sub(other.im),
        }
    }

    /// Returns `self + factor * other` for a real factor.
    #[inline(always)]
    fn plus_scaled(self, other: Self, factor: f32) -> Self {
        let factor = L::splat(factor);
        Self {
            re: other.re.mul_add(factor, self.re),
            im: other.im.mul_add(factor, self.im),
        }
    }

    /// Returns `self + i * other`.
    #[inline(always)]
    fn plus_turned(self, other: Self) -> Self {
        Self {
            re: self.re.sub(other.im),
            im: self.im.add(other.re),
        }
    }

    /// Returns `self - i * other`.
    #[inline(always)]
    fn minus_turned(self, other: Self) -> Self {
        Self {
            re: self.re.add(other.im),
            im: self.im.sub(other.re),
        }
    }

    /// Returns the product with `factor[0] + i factor[1]`.
    #[inline(always)]
    pub(super) fn rotated(self, factor: [f32; 2]) -> Self {
        let (cos, sin) = (L::splat(factor[0]), L::splat(factor[1]));
        Self {
            re: self.im.mul_sub_from(sin, self.re.mul(cos)),
            im: self.im.mul_add(cos, self.re.mul(sin)),
        }
    }
}

/// Transforms `RADIX` values in place: forward (`exp(-i ...)`), natural order.
#[inline(always)]
pub(super) fn butterfly<L: Lanes, const RADIX: usize>(x: &mut [Complex<L>; RADIX]) {
    match RADIX {
        2 => [x[0], x[1]] = two([x[0], x[1]]),
        3 => [x[0], x[1], x[2]] = three([x[0], x[1], x[2]]),
        4 => [x[0], x[1], x[2], x[3]] = four([x[0], x[1], x[2], x[3]]),
        5 => [x[0], x[1], x[2], x[3], x[4]] = five([x[0], x[1], x[2], x[3], x[4]]),
        6 => {
            let roots = [[0.5, -HALF_ROOT_3], [-0.5, -HALF_ROOT_3]];
            let [a0, a1] = two([x[0], x[3]]);
            let [b0, b1] = two([x[1], x[4]]);
            let [c0, c1] = two([x[2], x[5]]);
            [x[0], x[2], x[4]] = three([a0, b0, c0]);
            [x[1], x[3], x[5]] = three([a1, b1.rotated(roots[0]), c1.rotated(roots[1])]);
        }
        8 => {
            let [a0, a1, a2, a3] = four([x[0], x[2], x[4], x[6]]);
            let [b0, b1, b2, b3] = four([x[1], x[3], x[5], x[7]]);
            [x[0], x[4]] = two([a0, b0]);
            [x[1], x[5]] = two([a1, b1.rotated([HALF_ROOT_2, -HALF_ROOT_2])]);
            [x[2], x[6]] = [a2.minus_turned(b2), a2.plus_turned(b2)];
            [x[3], x[7]] = two([a3, b3.rotated([-HALF_ROOT_2, -HALF_ROOT_2])]);
        }
        9 => {
            let [a0, a1, a2] = three([x[0], x[3], x[6]]);
            let [b0, b1, b2] = three([x[1], x[4], x[7]]);
            let [c0, c1, c2] = three([x[2], x[5], x[8]]);
            let [w1, w2, w4] = NINTH;
            [x[0], x[3], x[6]] = three([a0, b0, c0]);
            [x[1], x[4], x[7]] = three([a1, b1.rotated(w1), c1.rotated(w2)]);
            [x[2], x[5], x[8]] = three([a2, b2.rotated(w2), c2.rotated(w4)]);
        }
        10 => {
            // Good-Thomas: 2 and 5 have no common factor, so no twiddle factors are needed.
            let [a0, a1, a2, a3, a4] = five([x[0], x[2], x[4], x[6], x[8]]);
            let [b0, b1, b2, b3, b4] = five([x[5], x[7], x[9], x[1], x[3]]);
            [x[0], x[5]] = two([a0, b0]);
            [x[6], x[1]] = two([a1, b1]);
            [x[2], x[7]] = two([a2, b2]);
            [x[8], x[3]] = two([a3, b3]);
            [x[4], x[9]] = two([a4, b4]);
        }
        12 => {
            // Good-Thomas with 3 and 4.
            let [a0, a1, a2, a3] = four([x[0], x[3], x[6], x[9]]);
            let [b0, b1, b2, b3] = four([x[4], x[7], x[10], x[1]]);
            let [c0, c1, c2, c3] = four([x[8], x[11], x[2], x[5]]);
            [x[0], x[4], x[8]] = three([a0, b0, c0]);
            [x[9], x[1], x[5]] = three([a1, b1, c1]);
            [x[6], x[10], x[2]] = three([a2, b2, c2]);
            [x[3], x[7], x[11]] = three([a3, b3, c3]);
        }
        _ => unreachable!("no butterfly of {RADIX}"),
    }
}

const HALF_ROOT_2: f32 = std::f32::consts::FRAC_1_SQRT_2;
const HALF_ROOT_3: f32 = 0.866_025_4;
/// `exp(-2 pi i k / 9)` for k = 1, 2, 4.
const NINTH: [[f32; 2]; 3] = [
    [0.766_044_44, -0.642_787_6],
    [0.173_648_18, -0.984_807_8],
    [-0.939_692_6, -0.342_020_14],
];
/// Cosine and sine of one and of two fifths of a turn.
const FIFTH: [[f32; 2]; 2] = [[0.309_017, 0.951_056_5], [-0.809_017, 0.587_785_24]];

#[inline(always)]
fn two<L: Lanes>([a, b]: [Complex<L>; 2]) -> [Complex<L>; 2] {
    [a.plus(b), a.minus(b)]
}

#[inline(always)]
fn three<L: Lanes>([a, b, c]: [Complex<L>; 3]) -> [Complex<L>; 3] {
    let (sum, difference) = (b.plus(c), b.minus(c));
    let middle = a.plus_scaled(sum, -0.5);
    let root = L::splat(HALF_ROOT_3);
    let plus = Complex {
        re: difference.im.mul_add(root, middle.re),
        im: difference.re.mul_sub_from(root, middle.im),
    };
    let minus = Complex {
        re: difference.im.mul_sub_from(root, middle.re),
        im: difference.re.mul_add(root, middle.im),
    };
    [a.plus(sum), plus, minus]
}

#[inline(always)]
fn four<L: Lanes>([a, b, c, d]: [Complex<L>; 4]) -> [Complex<L>; 4] {
    let (s, t) = (a.plus(c), a.minus(c));
    let (u, v) = (b.plus(d), b.minus(d));
    [s.plus(u), t.minus_turned(v), s.minus(u), t.plus_turned(v)]
}

#[inline(always)]
fn five<L: Lanes>([a, b, c, d, e]: [Complex<L>; 5]) -> [Complex<L>; 5] {
    let (s, t) = (b.plus(e), b.minus(e));
    let (u, v) = (c.plus(d), c.minus(d));
    let [[c1, s1], [c2, s2]] = FIFTH;
    let near = a.plus_scaled(s, c1).plus_scaled(u, c2);
    let far = a.plus_scaled(s, c2).plus_scaled(u, c1);
    let zero = Complex::zero();
    let near_turn = zero.plus_scaled(t, s1).plus_scaled(v, s2);
    let far_turn = zero.plus_scaled(t, s2).plus_scaled(v, -s1);
    [
        a.plus(s).plus(u),
        near.minus_turned(near_turn),
        far.minus_turned(far_turn),
        far.plus_turned(far_turn),
        near.plus_turned(near_turn),
    ]
}
