//! Vectors of f32 lanes: eight with AVX2 and FMA, sixteen with AVX-512, else plain arrays. The only module with `unsafe` code.
//!
//! Data is stored in octets, that is eight neighbouring maps. A vector is one or two neighbouring octets, so one layout serves all
//! instruction sets.
//!
//! A kernel is a type that implements [`Kernel`]; [`Isa::run`] calls it with the lanes that were detected at run time. Everything that a
//! kernel calls must be `#[inline(always)]`, so that it is compiled with the features of the enclosing function.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod prefetch;
mod rows;
mod walk;

use std::fmt::Debug;
use std::ops::{Deref, DerefMut};

pub(super) use prefetch::prefetch;
pub(super) use rows::{NOTHING, NOWHERE, Reader, Rows, Sequence, Table, WRITTEN, Writer, unrolled};
pub(super) use walk::Walk;

/// Eight values in memory, aligned for one vector load.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(32))]
pub(super) struct Octet(pub(super) [f32; 8]);

impl Octet {
    /// Octet of zeros.
    pub(super) const ZERO: Self = Self([0.0; 8]);
}

/// Octets that begin at a cache line, so that no vector of two crosses one.
#[derive(Clone)]
pub(super) struct Octets {
    lines: Vec<Line>,
    len: usize,
}

/// A cache line.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Line([Octet; 2]);

impl Octets {
    pub(super) fn zeros(len: usize) -> Self {
        Self {
            lines: vec![Line([Octet::ZERO; 2]); len.div_ceil(2)],
            len,
        }
    }

    /// Returns the capacity in octets.
    pub(super) fn room(&self) -> usize {
        2 * self.lines.len()
    }

    /// Sets the length to `len` octets.
    ///
    /// # Panics
    /// If `len` exceeds the capacity.
    pub(super) fn set_len(&mut self, len: usize) {
        assert!(len <= self.room(), "room for {len} octets");
        self.len = len;
    }
}

impl Debug for Octets {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Octets({})", self.len)
    }
}

impl Deref for Octets {
    type Target = [Octet];
    #[inline(always)]
    fn deref(&self) -> &[Octet] {
        // SAFETY: a line is two octets without padding, and there are at least `len` octets.
        unsafe { std::slice::from_raw_parts(self.lines.as_ptr().cast(), self.len) }
    }
}

impl DerefMut for Octets {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [Octet] {
        // SAFETY: as in `deref`.
        unsafe { std::slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.len) }
    }
}

/// Returns the values of octets.
#[inline(always)]
pub(super) fn floats(octets: &[Octet]) -> &[f32] {
    // SAFETY: an octet is exactly eight f32 without padding, and its alignment is stricter.
    unsafe { std::slice::from_raw_parts(octets.as_ptr().cast(), octets.len() * 8) }
}

/// Returns the values of octets for writing.
pub(super) fn floats_mut(octets: &mut [Octet]) -> &mut [f32] {
    // SAFETY: as in `floats`; every bit pattern is a valid f32.
    unsafe { std::slice::from_raw_parts_mut(octets.as_mut_ptr().cast(), octets.len() * 8) }
}

/// Arithmetic on a vector of one or more octets.
pub(super) trait Lanes: Copy + Debug {
    /// Number of octets in a vector.
    const OCTETS: usize;
    fn splat(value: f32) -> Self;
    /// Copies an octet of equal lanes to all lanes.
    fn load_equal(from: &Octet) -> Self;
    /// Loads the octets from `at` on.
    #[inline(always)]
    fn load(from: &[Octet], at: usize) -> Self {
        // SAFETY: the slice that is taken has as many octets as are read.
        unsafe { Self::load_from(from[at..at + Self::OCTETS].as_ptr().cast()) }
    }
    /// Stores to the octets from `at` on.
    #[inline(always)]
    fn store(self, to: &mut [Octet], at: usize) {
        // SAFETY: the slice that is taken has as many octets as are written.
        unsafe { self.store_to(to[at..at + Self::OCTETS].as_mut_ptr().cast()) }
    }
    /// Loads plain values; `at` counts octets.
    #[inline(always)]
    fn load_floats(from: &[f32], at: usize) -> Self {
        // SAFETY: the slice that is taken has as many values as are read.
        unsafe { Self::load_from(from[8 * at..8 * (at + Self::OCTETS)].as_ptr()) }
    }
    /// Stores to plain values; `at` counts octets.
    #[inline(always)]
    fn store_floats(self, to: &mut [f32], at: usize) {
        // SAFETY: the slice that is taken has as many values as are written.
        unsafe { self.store_to(to[8 * at..8 * (at + Self::OCTETS)].as_mut_ptr()) }
    }
    /// # Safety
    /// `from` must be valid for reads of a whole vector.
    unsafe fn load_from(from: *const f32) -> Self;
    /// # Safety
    /// `to` must be valid for writes of a whole vector.
    unsafe fn store_to(self, to: *mut f32);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    /// Returns `self * factor + term`.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// Returns `term - self * factor`.
    fn mul_sub_from(self, factor: Self, term: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// Returns `then` in lanes where `self > other`, else `otherwise`.
    fn if_greater(self, other: Self, then: Self, otherwise: Self) -> Self;
    /// Returns `then` in lanes where `self == other`, else zero.
    fn if_equal(self, other: Self, then: Self) -> Self;
    /// Stores small whole numbers as bytes; `at` counts octets.
    fn store_bytes(self, to: &mut [u8], at: usize);
    /// Loads bytes as numbers; `at` counts octets.
    fn load_bytes(from: &[u8], at: usize) -> Self;
}

/// Arithmetic on vectors of one octet.
pub(super) trait Narrow: Lanes {
    /// Transposes eight rows of eight lanes.
    fn transpose(rows: [Self; 8]) -> [Self; 8];
    #[inline(always)]
    fn load_slice(from: &[f32; 8]) -> Self {
        // SAFETY: eight values, as many as an octet has.
        unsafe { Self::load_from(from.as_ptr()) }
    }
    #[inline(always)]
    fn store_slice(self, to: &mut [f32; 8]) {
        // SAFETY: as in `load_slice`.
        unsafe { self.store_to(to.as_mut_ptr()) }
    }
}

/// Computation that is written once for vectors of any width.
pub(super) trait Kernel {
    type Output;
    /// Runs the computation; implementations must be `#[inline(always)]`.
    fn run<L: Lanes>(self) -> Self::Output;
}

/// Computation on single octets.
pub(super) trait NarrowKernel {
    type Output;
    /// Runs the computation; implementations must be `#[inline(always)]`.
    fn run<L: Narrow>(self) -> Self::Output;
}

/// Upper bound of [`Isa::detect`], set by [`Isa::limit`].
static LIMIT: std::sync::OnceLock<Isa> = std::sync::OnceLock::new();

/// Instruction set of the vector kernels, chosen when a block is planned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Isa {
    /// Plain arrays, for any processor.
    Portable,
    /// AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 F, VL, BW and DQ: two octets per vector and twice as many registers.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// Returns the fastest instruction set of this processor, up to the one that [`Isa::limit`] set.
    pub fn detect() -> Self {
        let limit = LIMIT.get().copied();
        let mut fitting = Self::all();
        fitting.retain(|isa| limit.is_none_or(|limit| *isa <= limit));
        fitting.pop().unwrap_or(Self::Portable)
    }

    /// Limits all later plans of this process to `self`, to compare instruction sets. Only the first call has an effect.
    pub fn limit(self) {
        LIMIT.get_or_init(|| self);
    }

    /// Returns all instruction sets of this processor, the fastest last.
    pub fn all() -> Vec<Self> {
        let mut found = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            found.push(Self::Avx2);
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512dq")
            {
                found.push(Self::Avx512);
            }
        }
        found
    }

    /// Returns the octets per vector that [`Isa::run`] uses for rows of `octets` octets; it divides `octets`.
    pub(super) fn group(self, octets: usize) -> usize {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if octets.is_multiple_of(2) => 2,
            _ => 1,
        }
    }

    /// Runs a kernel on rows of `octets` octets.
    ///
    /// It is inlined, so that the kernel's fields are created in the calling function. If they were copied there, wide loads would stall on
    /// the preceding narrow stores.
    #[inline(always)]
    pub(super) fn run<K: Kernel>(self, octets: usize, kernel: K) -> K::Output {
        match self {
            Self::Portable => run_portable(kernel),
            // SAFETY: `all` returns this variant only if both features were detected.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { avx2::run(kernel) },
            // SAFETY: as above, for the features of AVX-512.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if self.group(octets) == 2 => unsafe { avx512::run(kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { avx512::run_octet(kernel) },
        }
    }

    /// Runs a kernel on single octets; inlined like [`Isa::run`].
    #[inline(always)]
    pub(super) fn run_narrow<K: NarrowKernel>(self, kernel: K) -> K::Output {
        match self {
            Self::Portable => run_narrow_portable(kernel),
            // SAFETY: `all` returns this variant only if both features were detected.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { avx2::run_narrow(kernel) },
            // SAFETY: as above, for the features of AVX-512.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { avx512::run_narrow(kernel) },
        }
    }
}

#[inline(never)]
fn run_portable<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Portable>()
}

#[inline(never)]
fn run_narrow_portable<K: NarrowKernel>(kernel: K) -> K::Output {
    kernel.run::<Portable>()
}

#[derive(Debug, Clone, Copy)]
struct Portable([f32; 8]);

impl Portable {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = self.0;
        for (out, other) in out.iter_mut().zip(other.0) {
            *out = f(*out, other);
        }
        Self(out)
    }
}

impl Lanes for Portable {
    const OCTETS: usize = 1;
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; 8])
    }
    #[inline(always)]
    fn load_equal(from: &Octet) -> Self {
        Self(from.0)
    }
    #[inline(always)]
    unsafe fn load_from(from: *const f32) -> Self {
        // SAFETY: the caller guarantees eight values.
        Self(unsafe { from.cast::<[f32; 8]>().read() })
    }
    #[inline(always)]
    unsafe fn store_to(self, to: *mut f32) {
        // SAFETY: as in `load_from`.
        unsafe { to.cast::<[f32; 8]>().write(self.0) }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self.mul(factor).add(term)
    }
    #[inline(always)]
    fn mul_sub_from(self, factor: Self, term: Self) -> Self {
        term.sub(self.mul(factor))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn if_greater(self, other: Self, then: Self, otherwise: Self) -> Self {
        let mut out = otherwise.0;
        for lane in 0..8 {
            if self.0[lane] > other.0[lane] {
                out[lane] = then.0[lane];
            }
        }
        Self(out)
    }
    #[inline(always)]
    fn if_equal(self, other: Self, then: Self) -> Self {
        let mut out = [0.0; 8];
        for lane in 0..8 {
            if self.0[lane] == other.0[lane] {
                out[lane] = then.0[lane];
            }
        }
        Self(out)
    }
    #[inline(always)]
    fn store_bytes(self, to: &mut [u8], at: usize) {
        for (to, value) in to[8 * at..8 * at + 8].iter_mut().zip(self.0) {
            *to = value as u8;
        }
    }
    #[inline(always)]
    fn load_bytes(from: &[u8], at: usize) -> Self {
        let mut out = [0.0; 8];
        for (out, &byte) in out.iter_mut().zip(&from[8 * at..8 * at + 8]) {
            *out = f32::from(byte);
        }
        Self(out)
    }
}

impl Narrow for Portable {
    #[inline(always)]
    fn transpose(rows: [Self; 8]) -> [Self; 8] {
        let mut out = rows;
        for (row, out) in out.iter_mut().enumerate() {
            for lane in 0..8 {
                out.0[lane] = rows[lane].0[row];
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Turn([[f32; 8]; 8]);
    impl NarrowKernel for Turn {
        type Output = [[f32; 8]; 8];
        #[inline(always)]
        fn run<L: Narrow>(self) -> Self::Output {
            let mut rows = [L::splat(0.0); 8];
            for (row, values) in rows.iter_mut().zip(&self.0) {
                *row = L::load_slice(values);
            }
            let mut out = self.0;
            for (out, row) in out.iter_mut().zip(L::transpose(rows)) {
                row.store_slice(out);
            }
            out
        }
    }

    struct Convert<'a>(&'a [u8], &'a mut [f32], &'a mut [u8]);
    impl Kernel for Convert<'_> {
        type Output = ();
        #[inline(always)]
        fn run<L: Lanes>(self) {
            for at in (0..2).step_by(L::OCTETS) {
                let numbers = L::load_bytes(self.0, at);
                numbers.store_floats(self.1, at);
                numbers.store_bytes(self.2, at);
            }
        }
    }

    #[test]
    fn lanes_turn_and_convert() {
        let mut rows = [[0f32; 8]; 8];
        for (at, value) in rows.as_flattened_mut().iter_mut().enumerate() {
            *value = at as f32;
        }
        let bytes: Vec<u8> = (0..16).map(|i| i * 17).collect();
        for isa in Isa::all() {
            let turned = isa.run_narrow(Turn(rows));
            for i in 0..8 {
                for j in 0..8 {
                    assert_eq!(turned[i][j], rows[j][i]);
                }
            }
            let (mut numbers, mut back) = ([0.0; 16], [0; 16]);
            isa.run(2, Convert(&bytes, &mut numbers, &mut back));
            assert!(numbers.iter().zip(&bytes).all(|(&a, &b)| a == f32::from(b)));
            assert_eq!(back, *bytes);
        }
    }
}
