//! Work on a thread of rayon's pool.

/// Runs `work` on a thread of rayon's pool and waits for it.
///
/// From any other thread each parallel part within it, some thirty in a training step, would be handed over to the pool and waited for;
/// one sweep through a small network takes half as long again.
pub(crate) fn in_pool<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    rayon::scope(|_| work())
}
