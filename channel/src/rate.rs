//! Rate, latency and losses of a channel.

use std::time::{Duration, Instant};

use serde::Serialize;

use crate::{ChannelError, GetPort, Wait, now_ns, percentile};

/// Statistics of the packets received in some time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PacketRate {
    /// Number of packets.
    pub packets: usize,
    /// Packets per second.
    pub hz: f64,
    /// Megabytes (10⁶ bytes) per second.
    pub megabytes_per_s: f64,
    /// Median of the latency from put to get, in microseconds. Valid for packets of this host only, since the clocks
    /// of hosts differ.
    pub latency_p50_us: f64,
    /// 99th percentile of the latency, in microseconds.
    pub latency_p99_us: f64,
    /// Maximum latency, in microseconds.
    pub latency_max_us: f64,
    /// Packets that were put and did not arrive.
    pub lost: u64,
}

/// Gets packets for `time`, or until `stopped` returns true, and returns their statistics.
///
/// # Errors
/// The transport has failed.
pub fn measure_rate(
    port: &GetPort<u8>,
    time: Duration,
    stopped: &dyn Fn() -> bool,
) -> Result<PacketRate, ChannelError> {
    let begun = Instant::now();
    let (mut latencies_us, mut bytes) = (Vec::new(), 0);
    while !stopped() && begun.elapsed() < time {
        let Some(packet) = port.get(Wait::Block {
            timeout: Duration::from_millis(100),
        })?
        else {
            continue;
        };
        latencies_us.push(now_ns().saturating_sub(packet.header().put_ns) as f64 / 1e3);
        bytes += packet.len();
    }
    let seconds = begun.elapsed().as_secs_f64();
    latencies_us.sort_by(f64::total_cmp);
    let at = |share| percentile(&latencies_us, share).unwrap_or(0.0);
    Ok(PacketRate {
        packets: latencies_us.len(),
        hz: latencies_us.len() as f64 / seconds,
        megabytes_per_s: bytes as f64 / seconds / 1e6,
        latency_p50_us: at(0.5),
        latency_p99_us: at(0.99),
        latency_max_us: at(1.0),
        lost: port.lost(),
    })
}
