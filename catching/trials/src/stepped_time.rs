//! Ticks and seeds of throws in stepped time.

use tactnet_catching_world::TICK_NS;

/// Returns the seed of the world of throw `number` of a series.
pub(crate) fn world_seed(seed: u64, number: u64) -> u64 {
    seed.wrapping_mul(1_000_003).wrapping_add(number)
}

/// Returns a time in s as ns.
pub(crate) fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

/// Returns the number of whole ticks of a time in s.
pub(crate) fn ticks(seconds: f64) -> u64 {
    nanoseconds(seconds) / TICK_NS
}
