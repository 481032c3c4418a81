//! Complex matrix products, eight columns per octet.
//!
//! Real and imaginary parts are separate: a row of the right factor and of the result is `[2, columns]`. The left factor is read element by
//! element with any strides, so it may be transposed. A register block of 2 rows by 2 vectors needs sixteen registers: eight accumulators,
//! four vectors of the right factor and two broadcast parts. AVX-512 has room for 4 rows, or for 8 if a row is one vector.
//! During a product, the cache lines of the next product's factors are prefetched.

use super::simd::{Isa, Kernel, Lanes, Octet, Walk, prefetch};

/// Left factor: element `(i, k)` has its real part at `i * row + k * inner` and its imaginary part `imaginary` values later.
#[derive(Debug, Clone, Copy)]
pub(super) struct Left<'a> {
    pub(super) values: &'a [f32],
    pub(super) row: usize,
    pub(super) inner: usize,
    pub(super) imaginary: usize,
    pub(super) soon: Soon<'a>,
}

/// Number of f32 values in a cache line.
const LINE: usize = 16;

/// Factors of the next product, prefetched during this one with this product's strides.
#[derive(Debug, Clone, Copy)]
pub(super) struct Soon<'a> {
    pub(super) left: &'a [f32],
    pub(super) right: &'a [Octet],
}

impl Left<'_> {
    /// Computes `out = self * right`; `right` is `[inner, 2, columns]`, `out` is `[rows, 2, columns]`, with `columns` in octets.
    pub(super) fn times(self, isa: Isa, right: &[Octet], out: &mut [Octet], columns: usize) {
        self.run::<false, false>(isa, right, out, columns);
    }

    /// Computes `out += self * right`.
    pub(super) fn times_onto(self, isa: Isa, right: &[Octet], out: &mut [Octet], columns: usize) {
        self.run::<false, true>(isa, right, out, columns);
    }

    /// Computes `out = conj(self) * right`.
    pub(super) fn conjugate_times(
        self,
        isa: Isa,
        right: &[Octet],
        out: &mut [Octet],
        columns: usize,
    ) {
        self.run::<true, false>(isa, right, out, columns);
    }

    fn run<const CONJUGATE: bool, const ONTO: bool>(
        self,
        isa: Isa,
        right: &[Octet],
        out: &mut [Octet],
        columns: usize,
    ) {
        let product = Product::<CONJUGATE, ONTO> {
            left: self,
            right,
            out,
            columns,
        };
        isa.run(columns, product);
    }
}

struct Product<'a, const CONJUGATE: bool, const ONTO: bool> {
    left: Left<'a>,
    right: &'a [Octet],
    out: &'a mut [Octet],
    columns: usize,
}

impl<const CONJUGATE: bool, const ONTO: bool> Kernel for Product<'_, CONJUGATE, ONTO> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Product {
            left,
            right,
            out,
            columns,
        } = self;
        let rows = out.len() / (2 * columns);
        // Two rows by two vectors fill sixteen registers; four by two, or eight by one, fill thirty-two.
        let at_once = match (L::OCTETS, columns / L::OCTETS) {
            (2, 1) => 8,
            (2, _) => 4,
            _ => 2,
        };
        let mut row = 0;
        while row < rows {
            let soon = left.soon.left.as_ptr().wrapping_add(row * left.row);
            let left = Left {
                values: &left.values[row * left.row..],
                ..left
            };
            let out = &mut out[2 * row * columns..];
            let taken = match (rows - row).min(at_once) {
                8 => 8,
                few => few.min(4),
            };
            match taken {
                8 => row_block::<L, CONJUGATE, ONTO, 8>(left, right, out, columns, soon),
                4 => row_block::<L, CONJUGATE, ONTO, 4>(left, right, out, columns, soon),
                3 => row_block::<L, CONJUGATE, ONTO, 3>(left, right, out, columns, soon),
                2 => row_block::<L, CONJUGATE, ONTO, 2>(left, right, out, columns, soon),
                _ => row_block::<L, CONJUGATE, ONTO, 1>(left, right, out, columns, soon),
            }
            row += taken;
        }
    }
}

#[inline(always)]
fn row_block<L: Lanes, const CONJUGATE: bool, const ONTO: bool, const ROWS: usize>(
    left: Left<'_>,
    right: &[Octet],
    out: &mut [Octet],
    columns: usize,
    soon: *const f32,
) {
    let mut column = 0;
    while column + 2 * L::OCTETS <= columns {
        tile::<L, CONJUGATE, ONTO, ROWS, 2>(left, right, out, columns, column, soon);
        column += 2 * L::OCTETS;
    }
    while column < columns {
        tile::<L, CONJUGATE, ONTO, ROWS, 1>(left, right, out, columns, column, soon);
        column += L::OCTETS;
    }
}

#[inline(always)]
fn tile<
    L: Lanes,
    const CONJUGATE: bool,
    const ONTO: bool,
    const ROWS: usize,
    const WIDTH: usize,
>(
    left: Left<'_>,
    right: &[Octet],
    out: &mut [Octet],
    columns: usize,
    column: usize,
    mut next_left: *const f32,
) {
    let zero = L::splat(0.0);
    let mut sums = [[[zero; 2]; WIDTH]; ROWS];
    let inner = right.len() / (2 * columns);
    let mut offsets = [[0; 2]; WIDTH];
    for (v, offset) in offsets.iter_mut().enumerate() {
        let at = column + v * L::OCTETS;
        *offset = [at, columns + at];
    }
    let mut next_right = left.soon.right.as_ptr().wrapping_add(column);
    // Rows that are read value by value are prefetched line by line.
    let (imaginary, next_step) = (left.imaginary, left.inner.max(LINE));
    let mut right = Walk::<Octet, L, WIDTH>::new(right, 2 * columns, inner, offsets);
    let mut offsets = [[0; 2]; ROWS];
    for (r, offset) in offsets.iter_mut().enumerate() {
        *offset = [r * left.row, r * left.row + left.imaginary];
    }
    let mut left = Walk::<f32, L, ROWS>::new(left.values, left.inner, inner, offsets);
    while let (Some(left), Some(right)) = (left.step(), right.step()) {
        prefetch(next_left);
        prefetch(next_left.wrapping_add(imaginary));
        next_left = next_left.wrapping_add(next_step);
        for v in 0..WIDTH {
            prefetch(next_right.wrapping_add(v * L::OCTETS));
            prefetch(next_right.wrapping_add(v * L::OCTETS + columns));
        }
        next_right = next_right.wrapping_add(2 * columns);
        for r in 0..ROWS {
            let a = L::splat(left[r][0]);
            for v in 0..WIDTH {
                sums[r][v][0] = a.mul_add(right[v][0], sums[r][v][0]);
                sums[r][v][1] = a.mul_add(right[v][1], sums[r][v][1]);
            }
            let b = L::splat(left[r][1]);
            for v in 0..WIDTH {
                if CONJUGATE {
                    sums[r][v][0] = b.mul_add(right[v][1], sums[r][v][0]);
                    sums[r][v][1] = b.mul_sub_from(right[v][0], sums[r][v][1]);
                } else {
                    sums[r][v][0] = b.mul_sub_from(right[v][1], sums[r][v][0]);
                    sums[r][v][1] = b.mul_add(right[v][0], sums[r][v][1]);
                }
            }
        }
    }
    for r in 0..ROWS {
        for v in 0..WIDTH {
            let at = column + v * L::OCTETS;
            for part in 0..2 {
                let at = (2 * r + part) * columns + at;
                let sum = sums[r][v][part];
                let sum = if ONTO { sum.add(L::load(out, at)) } else { sum };
                sum.store(out, at);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise;
    use crate::simd::{floats, floats_mut};

    fn octets(len: usize, seed: u64) -> Vec<Octet> {
        let mut made = vec![Octet::ZERO; len];
        floats_mut(&mut made).copy_from_slice(&noise(len * 8, seed));
        made
    }

    #[test]
    fn products_are_sums_of_products() {
        for (rows, inner, columns) in [(36, 32, 8), (5, 7, 3), (7, 5, 2), (21, 3, 2), (1, 1, 1)] {
            for isa in Isa::all() {
                for (conjugate, onto) in [(false, false), (true, false), (false, true)] {
                    let left = noise(rows * inner * 2, 3);
                    let right = octets(inner * 2 * columns, 4);
                    let mut out = octets(rows * 2 * columns, 5);
                    let before = out.clone();
                    let a = Left {
                        values: &left,
                        row: 2 * inner,
                        inner: 1,
                        imaginary: inner,
                        soon: Soon {
                            left: &left,
                            right: &right,
                        },
                    };
                    if onto {
                        a.times_onto(isa, &right, &mut out, columns);
                    } else if conjugate {
                        a.conjugate_times(isa, &right, &mut out, columns);
                    } else {
                        a.times(isa, &right, &mut out, columns);
                    }
                    let (b, c, n) = (floats(&right), floats(&out), columns * 8);
                    let before = floats(&before);
                    for i in 0..rows {
                        for j in 0..n {
                            let [mut re, mut im] = [0, 1].map(|part| match onto {
                                true => before[(2 * i + part) * n + j],
                                false => 0.0,
                            });
                            for k in 0..inner {
                                let sign = if conjugate { -1.0 } else { 1.0 };
                                let (ar, ai) = (
                                    left[2 * inner * i + k],
                                    sign * left[2 * inner * i + inner + k],
                                );
                                let (br, bi) = (b[2 * k * n + j], b[(2 * k + 1) * n + j]);
                                re += ar * br - ai * bi;
                                im += ar * bi + ai * br;
                            }
                            assert!((c[2 * i * n + j] - re).abs() < 1e-4);
                            assert!((c[(2 * i + 1) * n + j] - im).abs() < 1e-4);
                        }
                    }
                }
            }
        }
    }
}
