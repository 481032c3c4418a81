//! Asking for memory before it is used. Transforms and products go through it in strides that a processor's own prefetching does not
//! follow far.

use super::Octet;

/// Octets of a cache line.
const LINE: usize = 2;

/// Asks for the cache line at `line`, which need not be valid, since it will be read.
#[inline(always)]
pub(in crate::conv) fn prefetch(line: *const Octet) {
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
pub(in crate::conv) fn prefetch_to_write(line: *const Octet) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_ET0, _mm_prefetch};
        // SAFETY: as in `prefetch`; processors without it take this instruction for none.
        unsafe { _mm_prefetch::<_MM_HINT_ET0>(line.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = line;
}

/// What will be read next: asked for line by line while there is something else to do.
#[derive(Debug, Clone)]
pub(in crate::conv) struct Soon<'a> {
    parts: [&'a [Octet]; 2],
    at: usize,
}

impl<'a> Soon<'a> {
    #[inline(always)]
    pub(in crate::conv) fn new(parts: [&'a [Octet]; 2]) -> Self {
        Self { parts, at: 0 }
    }

    /// Asks for the next line of each part.
    #[inline(always)]
    pub(in crate::conv) fn ask(&mut self) {
        for part in self.parts {
            if self.at < part.len() {
                prefetch(part.as_ptr().wrapping_add(self.at));
            }
        }
        self.at += LINE;
    }
}
