//! Sixteen lanes of AVX-512, and eight lanes with its 32 registers.

use std::arch::x86_64::*;

use super::avx2::Avx2;
use super::{Kernel, Lanes, NarrowKernel, Octet};

/// AVX-512 vector; used only inside [`run`], on processors with AVX-512 F, VL, BW and DQ.
#[derive(Debug, Clone, Copy)]
struct Avx512(__m512);

/// Runs a kernel with two octets per vector.
///
/// # Safety
/// The processor must have AVX2, FMA and AVX-512 F, VL, BW and DQ.
#[target_feature(enable = "avx2,fma,avx512f,avx512vl,avx512bw,avx512dq")]
pub(super) unsafe fn run<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx512>()
}

/// Runs a kernel with one octet per vector.
///
/// # Safety
/// As for [`run`].
#[target_feature(enable = "avx2,fma,avx512f,avx512vl,avx512bw,avx512dq")]
pub(super) unsafe fn run_octet<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

/// Runs a kernel on single octets.
///
/// # Safety
/// As for [`run`].
#[target_feature(enable = "avx2,fma,avx512f,avx512vl,avx512bw,avx512dq")]
pub(super) unsafe fn run_narrow<K: NarrowKernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

// SAFETY of every block below: `Avx512` is only used in `run`, whose caller has detected the features. Loads and stores use
// slices of sixteen values or memory that the caller guarantees.
impl Lanes for Avx512 {
    const OCTETS: usize = 2;
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm512_set1_ps(value) })
    }
    #[inline(always)]
    fn load_equal(from: &Octet) -> Self {
        Self::splat(from.0[0])
    }
    #[inline(always)]
    unsafe fn load_from(from: *const f32) -> Self {
        Self(unsafe { _mm512_loadu_ps(from) })
    }
    #[inline(always)]
    unsafe fn store_to(self, to: *mut f32) {
        unsafe { _mm512_storeu_ps(to, self.0) }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(unsafe { _mm512_add_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(unsafe { _mm512_sub_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(unsafe { _mm512_mul_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(unsafe { _mm512_fmadd_ps(self.0, factor.0, term.0) })
    }
    #[inline(always)]
    fn mul_sub_from(self, factor: Self, term: Self) -> Self {
        Self(unsafe { _mm512_fnmadd_ps(self.0, factor.0, term.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn if_greater(self, other: Self, then: Self, otherwise: Self) -> Self {
        Self(unsafe {
            let greater = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, other.0);
            _mm512_mask_blend_ps(greater, otherwise.0, then.0)
        })
    }
    #[inline(always)]
    fn if_equal(self, other: Self, then: Self) -> Self {
        Self(unsafe {
            let equal = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(self.0, other.0);
            _mm512_maskz_mov_ps(equal, then.0)
        })
    }
    #[inline(always)]
    fn store_bytes(self, to: &mut [u8], at: usize) {
        let to = &mut to[8 * at..8 * at + 16];
        unsafe {
            let bytes = _mm512_cvtepi32_epi8(_mm512_cvttps_epi32(self.0));
            _mm_storeu_si128(to.as_mut_ptr().cast(), bytes);
        }
    }
    #[inline(always)]
    fn load_bytes(from: &[u8], at: usize) -> Self {
        let from = &from[8 * at..8 * at + 16];
        Self(unsafe {
            let bytes = _mm_loadu_si128(from.as_ptr().cast());
            _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(bytes))
        })
    }
}
