//! Work on a thread of rayon's pool.

use burn::tensor::Device;
use tactnet_models::is_cpu;

/// Runs `work` for `device` on a thread of rayon's pool and waits for it.
///
/// From any other thread each parallel part within it, some thirty in a training step, would be handed over to the pool and waited for;
/// one sweep through a small network takes half as long again. What a GPU does stays on the thread that asks: CubeCL has a queue for each
/// thread, and orders work in one of them better than between them.
pub(crate) fn in_pool<R: Send>(device: &Device, work: impl FnOnce() -> R + Send) -> R {
    if is_cpu(device) {
        rayon::scope(|_| work())
    } else {
        work()
    }
}
