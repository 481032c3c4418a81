//! Work on rayon's thread pool.

use burn::tensor::Device;
use tactnet_models::is_cpu;

/// Runs `work` for `device` on a thread of rayon's pool and waits for it.
///
/// Called from another thread, each of some thirty parallel parts of a training step would be handed to the pool and waited for, and one sweep
/// through a small network takes 50 % longer. GPU work stays on the calling thread: CubeCL has a queue for each thread and orders work
/// better within one queue than between several.
pub(crate) fn in_pool<R: Send>(device: &Device, work: impl FnOnce() -> R + Send) -> R {
    if is_cpu(device) {
        rayon::scope(|_| work())
    } else {
        work()
    }
}
