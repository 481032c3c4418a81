//! Reading and sending of packets in the steps of processes.

use std::time::Duration;

use tactnet_channel::{ChannelError, GetPort, Packet, PutPort, Wait};
pub use tactnet_channel::{LatestValue, NewPackets, drain};

/// Maximum sleep of a process, which bounds its reaction time to a stop request.
pub(crate) const PATIENCE: Wait = at_most(50);

/// Packets of one output of a step, each of which may be missing.
pub(crate) trait Packets<T> {
    fn all(self) -> impl Iterator<Item = T>;
}

impl<T> Packets<T> for Option<T> {
    fn all(self) -> impl Iterator<Item = T> {
        self.into_iter()
    }
}

impl<T, const MOST: usize> Packets<T> for [Option<T>; MOST] {
    fn all(self) -> impl Iterator<Item = T> {
        self.into_iter().flatten()
    }
}

/// Sends those packets that there are.
pub(crate) fn send<T: Packet + Copy>(
    port: &PutPort<T>,
    packets: impl Packets<T>,
) -> Result<(), ChannelError> {
    packets
        .all()
        .try_for_each(|packet| port.put_copy(&[packet]).map(|_| ()))
}

/// Opens the channels of a step's outputs, and returns the function that sends the outputs on them.
macro_rules! sender {
    ($bus:expr, $outputs:ty { $($output:ident => $channel:ident),* $(,)? }) => {{
        $(let $output = $crate::channels::$channel.put($bus)?;)*
        move |outputs: $outputs| -> Result<(), $crate::RoleError> {
            $($crate::latest_value::send(&$output, outputs.$output)?;)*
            Ok(())
        }
    }};
}
pub(crate) use sender;

/// Waits for a packet and returns its first element; `None` if none arrives.
pub(crate) fn next<T: Packet + Copy>(port: &GetPort<T>) -> Result<Option<T>, ChannelError> {
    let packet = port.get(PATIENCE)?;
    Ok(packet.and_then(|packet| packet.first().copied()))
}

/// Returns a wait that ends after the given number of milliseconds.
pub(crate) const fn at_most(ms: u64) -> Wait {
    Wait::Block {
        timeout: Duration::from_millis(ms),
    }
}
