//! Transforms and complex products compared with `rustfft` and `gemm` on one thread: `cargo bench -p tactnet-conv --bench crates`.
//!
//! The shapes are those of layers 2 and 3 at batch 36. `rustfft` transforms the same 16 maps one after another, in its own layout.

use divan::Bencher;
use divan::counter::ItemsCount;
use gemm::{Parallelism, c32};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use tactnet_conv::timing;

fn main() {
    divan::main();
}

const LENGTHS: [usize; 3] = [18, 108, 120];
/// Rows, inner size, columns: forward, input gradient and weight gradient of layer 2, forward of layer 3.
const PRODUCTS: [[usize; 3]; 4] = [[36, 32, 64], [36, 64, 32], [32, 36, 64], [36, 64, 128]];

#[divan::bench(args = LENGTHS)]
fn transform_of_16_maps_ours(bencher: Bencher, length: usize) {
    bencher.bench_local(timing::transform(length));
}

#[divan::bench(args = LENGTHS)]
fn transform_of_16_maps_rustfft(bencher: Bencher, length: usize) {
    let plan = FftPlanner::<f32>::new().plan_fft_forward(length);
    let mut values = vec![Complex::new(0.0f32, 0.0); 16 * length];
    let mut scratch = vec![Complex::new(0.0f32, 0.0); plan.get_inplace_scratch_len()];
    bencher.bench_local(|| plan.process_with_scratch(&mut values, &mut scratch));
}

/// Returns the number of real multiplications and additions in a complex product.
fn operations([rows, inner, columns]: [usize; 3]) -> ItemsCount {
    ItemsCount::new(8 * rows * inner * columns)
}

#[divan::bench(args = 0..PRODUCTS.len())]
fn product_ours(bencher: Bencher, shape: usize) {
    let [rows, inner, columns] = PRODUCTS[shape];
    bencher
        .counter(operations(PRODUCTS[shape]))
        .bench_local(timing::product(rows, inner, columns));
}

#[divan::bench(args = 0..PRODUCTS.len())]
fn product_gemm(bencher: Bencher, shape: usize) {
    let [rows, inner, columns] = PRODUCTS[shape];
    let left = vec![c32::new(1.0, 0.5); rows * inner];
    let right = vec![c32::new(0.5, 1.0); inner * columns];
    let mut out = vec![c32::new(0.0, 0.0); rows * columns];
    let zero = c32::new(0.0, 0.0);
    bencher
        .counter(operations(PRODUCTS[shape]))
        .bench_local(|| {
            // SAFETY: the strides describe three row-major matrices of exactly these sizes.
            unsafe {
                gemm::gemm(
                    rows,
                    columns,
                    inner,
                    out.as_mut_ptr(),
                    1,
                    columns as isize,
                    false,
                    left.as_ptr(),
                    1,
                    inner as isize,
                    right.as_ptr(),
                    1,
                    columns as isize,
                    zero,
                    c32::new(1.0, 0.0),
                    false,
                    false,
                    false,
                    Parallelism::None,
                );
            }
        });
}
