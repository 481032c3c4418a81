//! Eight f32 lanes: AVX2 + FMA where the processor has them, plain arrays elsewhere. The only module with `unsafe` code.
//!
//! A kernel is a type that implements [`Kernel`]; [`Isa::run`] calls it with the lanes that were detected at run time. Everything a
//! kernel calls must be `#[inline(always)]`, so that it is compiled with the features of the function it is inlined into.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod rows;
mod walk;

use std::fmt::Debug;

pub(super) use rows::{NOWHERE, Reader, Rows, Table, Writer};
pub(super) use walk::Walk;

/// Eight values in memory, aligned for one vector load.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(32))]
pub(super) struct Octet(pub(super) [f32; 8]);

impl Octet {
    /// All lanes zero.
    pub(super) const ZERO: Self = Self([0.0; 8]);
}

/// The values of a row of octets.
#[inline(always)]
pub(super) fn floats(octets: &[Octet]) -> &[f32] {
    // SAFETY: an octet is exactly eight f32 without padding, and its alignment is stricter.
    unsafe { std::slice::from_raw_parts(octets.as_ptr().cast(), octets.len() * 8) }
}

/// The values of a row of octets, to write.
#[cfg(test)]
pub(super) fn floats_mut(octets: &mut [Octet]) -> &mut [f32] {
    // SAFETY: as in `floats`; every bit pattern is a valid f32.
    unsafe { std::slice::from_raw_parts_mut(octets.as_mut_ptr().cast(), octets.len() * 8) }
}

/// Arithmetic on eight lanes.
pub(super) trait Lanes: Copy + Debug {
    fn splat(value: f32) -> Self;
    fn load(from: &Octet) -> Self;
    fn load_slice(from: &[f32; 8]) -> Self;
    fn store(self, to: &mut Octet);
    fn store_slice(self, to: &mut [f32; 8]);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    /// `self * factor + term`
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// `term - self * factor`
    fn mul_sub_from(self, factor: Self, term: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// Lane by lane `then` where `self > other`, else `otherwise`.
    fn if_greater(self, other: Self, then: Self, otherwise: Self) -> Self;
    /// Lane by lane `then` where `self == other`, else zero.
    fn if_equal(self, other: Self, then: Self) -> Self;
    /// Turns eight rows into eight columns.
    fn transpose(rows: [Self; 8]) -> [Self; 8];
    /// Small whole numbers as bytes.
    fn to_bytes(self) -> [u8; 8];
    /// Bytes as numbers.
    fn from_bytes(bytes: &[u8; 8]) -> Self;
}

/// Work that is written once for all lanes.
pub(super) trait Kernel {
    type Output;
    /// Must be `#[inline(always)]`.
    fn run<L: Lanes>(self) -> Self::Output;
}

/// The instruction set found at run time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Isa {
    /// Plain arrays.
    Portable,
    /// AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// The same with twice the registers.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// The best that this processor has.
    pub(super) fn detect() -> Self {
        Self::all().pop().unwrap_or(Self::Portable)
    }

    /// All that this processor has, the best last.
    pub(super) fn all() -> Vec<Self> {
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

    /// Runs a kernel.
    pub(super) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Self::Portable => kernel.run::<Portable>(),
            // SAFETY: `all` gives this only where both features were detected.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { avx2::run(kernel) },
            // SAFETY: as above, with the features of AVX-512.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { avx2::run_avx512(kernel) },
        }
    }
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
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; 8])
    }
    #[inline(always)]
    fn load(from: &Octet) -> Self {
        Self(from.0)
    }
    #[inline(always)]
    fn load_slice(from: &[f32; 8]) -> Self {
        Self(*from)
    }
    #[inline(always)]
    fn store(self, to: &mut Octet) {
        to.0 = self.0;
    }
    #[inline(always)]
    fn store_slice(self, to: &mut [f32; 8]) {
        *to = self.0;
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
    fn transpose(rows: [Self; 8]) -> [Self; 8] {
        let mut out = rows;
        for (row, out) in out.iter_mut().enumerate() {
            for lane in 0..8 {
                out.0[lane] = rows[lane].0[row];
            }
        }
        out
    }
    #[inline(always)]
    fn to_bytes(self) -> [u8; 8] {
        self.0.map(|value| value as u8)
    }
    #[inline(always)]
    fn from_bytes(bytes: &[u8; 8]) -> Self {
        Self(bytes.map(f32::from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Turn([[f32; 8]; 8]);
    impl Kernel for Turn {
        type Output = ([[f32; 8]; 8], [u8; 8], [f32; 8]);
        #[inline(always)]
        fn run<L: Lanes>(self) -> Self::Output {
            let mut rows = [L::splat(0.0); 8];
            for (row, values) in rows.iter_mut().zip(&self.0) {
                *row = L::load_slice(values);
            }
            let mut out = self.0;
            for (out, row) in out.iter_mut().zip(L::transpose(rows)) {
                row.store_slice(out);
            }
            let mut back = [0.0; 8];
            L::from_bytes(&[0, 1, 2, 127, 128, 200, 254, 255]).store_slice(&mut back);
            (out, rows[2].to_bytes(), back)
        }
    }

    #[test]
    fn lanes_turn_and_convert() {
        let mut rows = [[0f32; 8]; 8];
        for (at, value) in rows.as_flattened_mut().iter_mut().enumerate() {
            *value = at as f32;
        }
        for isa in Isa::all() {
            let (turned, bytes, numbers) = isa.run(Turn(rows));
            for i in 0..8 {
                for j in 0..8 {
                    assert_eq!(turned[i][j], rows[j][i]);
                }
            }
            assert_eq!(bytes, [16, 17, 18, 19, 20, 21, 22, 23]);
            assert_eq!(numbers, [0.0, 1.0, 2.0, 127.0, 128.0, 200.0, 254.0, 255.0]);
        }
    }
}
