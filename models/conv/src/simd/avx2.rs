//! Eight lanes of AVX2 with fused multiply-add.

use std::arch::x86_64::*;

use super::{Kernel, Lanes, Narrow, NarrowKernel, Octet};

/// AVX2 vector; used only inside functions with `target_feature`, on processors with AVX2 and FMA.
#[derive(Debug, Clone, Copy)]
pub(super) struct Avx2(__m256);

/// # Safety
/// The processor must have AVX2 and FMA.
#[target_feature(enable = "avx2,fma")]
pub(super) unsafe fn run<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

/// # Safety
/// The processor must have AVX2 and FMA.
#[target_feature(enable = "avx2,fma")]
pub(super) unsafe fn run_narrow<K: NarrowKernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

// SAFETY of every block below: `Avx2` is only used in functions whose callers have detected the features. Loads and stores use
// slices of eight values or memory that the caller guarantees, and `Octet` is 32-byte aligned.
impl Lanes for Avx2 {
    const OCTETS: usize = 1;
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm256_set1_ps(value) })
    }
    #[inline(always)]
    fn load_equal(from: &Octet) -> Self {
        Self(unsafe { _mm256_load_ps(from.0.as_ptr()) })
    }
    #[inline(always)]
    unsafe fn load_from(from: *const f32) -> Self {
        Self(unsafe { _mm256_loadu_ps(from) })
    }
    #[inline(always)]
    unsafe fn store_to(self, to: *mut f32) {
        unsafe { _mm256_storeu_ps(to, self.0) }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(unsafe { _mm256_add_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(unsafe { _mm256_sub_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(unsafe { _mm256_mul_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, term.0) })
    }
    #[inline(always)]
    fn mul_sub_from(self, factor: Self, term: Self) -> Self {
        Self(unsafe { _mm256_fnmadd_ps(self.0, factor.0, term.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn if_greater(self, other: Self, then: Self, otherwise: Self) -> Self {
        Self(unsafe {
            let greater = _mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0);
            _mm256_blendv_ps(otherwise.0, then.0, greater)
        })
    }
    #[inline(always)]
    fn if_equal(self, other: Self, then: Self) -> Self {
        Self(unsafe { _mm256_and_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, other.0), then.0) })
    }
    #[inline(always)]
    fn store_bytes(self, to: &mut [u8], at: usize) {
        let bytes = unsafe {
            let whole = _mm256_cvttps_epi32(self.0);
            let (low, high) = (
                _mm256_castsi256_si128(whole),
                _mm256_extracti128_si256::<1>(whole),
            );
            let words = _mm_packus_epi32(low, high);
            _mm_cvtsi128_si64(_mm_packus_epi16(words, words)).to_le_bytes()
        };
        to[8 * at..8 * at + 8].copy_from_slice(&bytes);
    }
    #[inline(always)]
    fn load_bytes(from: &[u8], at: usize) -> Self {
        let from = &from[8 * at..8 * at + 8];
        Self(unsafe {
            let bytes = _mm_loadl_epi64(from.as_ptr().cast());
            _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(bytes))
        })
    }
}

impl Narrow for Avx2 {
    #[inline(always)]
    fn transpose(r: [Self; 8]) -> [Self; 8] {
        unsafe {
            let mut pairs = [r[0].0; 8];
            for i in 0..4 {
                pairs[2 * i] = _mm256_unpacklo_ps(r[2 * i].0, r[2 * i + 1].0);
                pairs[2 * i + 1] = _mm256_unpackhi_ps(r[2 * i].0, r[2 * i + 1].0);
            }
            let mut fours = [r[0].0; 8];
            for i in 0..2 {
                for half in 0..2 {
                    let (a, b) = (pairs[4 * i + half], pairs[4 * i + 2 + half]);
                    fours[4 * i + 2 * half] = _mm256_shuffle_ps::<0x44>(a, b);
                    fours[4 * i + 2 * half + 1] = _mm256_shuffle_ps::<0xEE>(a, b);
                }
            }
            let mut out = r;
            for i in 0..4 {
                out[i] = Self(_mm256_permute2f128_ps::<0x20>(fours[i], fours[i + 4]));
                out[i + 4] = Self(_mm256_permute2f128_ps::<0x31>(fours[i], fours[i + 4]));
            }
            out
        }
    }
}
