//! Asking for memory before it is used. Transforms and products go through it in strides that a processor's own prefetching does not
//! follow far.

/// Asks for the cache line at `line`, which need not be valid, since it will be read.
#[inline(always)]
pub(in crate::conv) fn prefetch<T>(line: *const T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a prefetch reads nothing and never faults; every x86-64 processor has the instruction.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = line;
}

/// Asks for the cache line at `line`, which need not be valid, since it will be written.
#[inline(always)]
pub(in crate::conv) fn prefetch_to_write<T>(line: *const T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_ET0, _mm_prefetch};
        // SAFETY: as in `prefetch`; processors without it take this instruction for none.
        unsafe { _mm_prefetch::<_MM_HINT_ET0>(line.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = line;
}
