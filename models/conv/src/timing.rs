//! Single transforms and products for `benches/crates.rs`, which compares them with `rustfft` and `gemm`.

use super::fft::{TimePlan, Transform};
use super::product::{Left, Soon};
use super::simd::{Isa, NOTHING, Octets, Rows, Table};

/// Returns a function that runs one complex transform of `length` points of 16 maps.
pub fn transform(length: usize) -> impl FnMut() {
    let isa = Isa::detect();
    let plan = TimePlan::at_least(length);
    let rows = Table::new(0..plan.length() as u32);
    let source = Octets::zeros(4 * length);
    let mut target = Octets::zeros(4 * length);
    let mut scratch = Octets::zeros(plan.scratch(2));
    move || {
        for v in (0..2).step_by(isa.group(2)) {
            let at = Rows {
                table: &rows,
                stride: 4,
                parts: [v, 2 + v],
                ahead: NOTHING,
            };
            isa.run(
                2,
                Transform {
                    plan: &plan,
                    source: &source,
                    from: at,
                    target: &mut target,
                    to: at,
                    scratch: &mut scratch,
                },
            );
        }
    }
}

/// Returns a function that computes one complex product `[rows, inner] x [inner, columns]`; `columns` is a multiple of 8.
pub fn product(rows: usize, inner: usize, columns: usize) -> impl FnMut() {
    let isa = Isa::detect();
    let left = vec![1.0; rows * inner * 2];
    let right = Octets::zeros(inner * 2 * columns / 8);
    let mut out = Octets::zeros(rows * 2 * columns / 8);
    move || {
        let left = Left {
            values: &left,
            row: 2 * inner,
            inner: 1,
            imaginary: inner,
            soon: Soon {
                left: &left,
                right: &right,
            },
        };
        left.times(isa, &right, &mut out, columns / 8);
    }
}
