//! Reading and sending of packets in the steps of processes.

use std::time::Duration;

use tactnet_channel::{ChannelError, GetPort, Packet, PutPort, Wait};
pub use tactnet_channel::{LatestValue, NewPackets, drain};

/// Maximum sleep of a process, which bounds its reaction time to a stop request.
pub(crate) const PATIENCE: Wait = at_most(50);

/// Sends those packets of an output that there are: of an option, or of an array of options.
pub(crate) fn send<T: Packet + Copy>(
    port: &PutPort<T>,
    packets: impl IntoIterator<Item = impl Into<Option<T>>>,
) -> Result<(), ChannelError> {
    let mut packets = packets.into_iter().filter_map(Into::into);
    packets.try_for_each(|packet| port.put_copy(&[packet]).map(|_| ()))
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
