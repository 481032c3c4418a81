//! The thesis's stress test of the channels (section 2.4.1).
//!
//! A master sends a packet to C clients, and each answers with a packet of the same size. The next round begins when all answers have
//! arrived. There is neither a pause nor work, so the test measures the transport alone.
//!
//! ```text
//!            ┌─ there ─> client 1 ─┐
//!  master ───┤            …        ├─ back ─> master      round trip = put … last answer
//!            └─ there ─> client C ─┘
//! ```
//!
//! The example `lower_bounds` measures a bare futex wake-up and Unix sockets in the same way.

mod channel;
mod chart;
mod child;
mod clients;
mod figures;
mod iceoryx;
mod measure;
mod plan;
mod put_numbered;
mod report;
mod row;
#[cfg(feature = "zenoh")]
mod zenoh;

use std::time::Duration;

pub(crate) use child::Role;
pub use child::{ChildProgram, ChildTask, enter_namespaces, run_child};
pub use measure::{RoundTrips, round_trips};
pub use plan::{Cell, Configuration, Plan, PlanError, StressDomain, Transport};
pub use put_numbered::put_numbered;
pub use report::{Origin, page, picture};
pub use row::{Row, Rows};

/// An error of a stress test, with a text of one line.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Number of the round that ends the clients.
const END: u32 = u32::MAX;
/// Timeout of an answer, after which the round has failed.
const PATIENCE: Duration = Duration::from_secs(10);
/// Timeout of a client without packets, after which it ends.
const CLIENT_PATIENCE: Duration = Duration::from_secs(60);

/// The master's end of a transport.
pub trait Master {
    /// Sends a packet with the number of the round to all clients.
    ///
    /// # Errors
    /// Errors of the transport.
    fn broadcast(&mut self, round: u32) -> Result<(), Failure>;
    /// Returns the round of the next answer; `None` after the timeout.
    ///
    /// # Errors
    /// Errors of the transport.
    fn answer(&mut self, patience: Duration) -> Result<Option<u32>, Failure>;
}

/// A client's end of a transport.
pub trait Client {
    /// Returns the round of the next packet; `None` after the timeout.
    ///
    /// # Errors
    /// Errors of the transport.
    fn round(&mut self, patience: Duration) -> Result<Option<u32>, Failure>;
    /// Sends the number back in a packet of the same size.
    ///
    /// # Errors
    /// Errors of the transport.
    fn answer(&mut self, round: u32) -> Result<(), Failure>;
}

/// Answers the master's packets until it ends the client or is silent for a minute.
///
/// - `ready`: called before the first packet
///
/// # Errors
/// Errors of the transport.
pub fn serve(client: &mut dyn Client, ready: impl FnOnce()) -> Result<(), Failure> {
    ready();
    while let Some(round) = client.round(CLIENT_PATIENCE)? {
        if round == END {
            break;
        }
        client.answer(round)?;
    }
    Ok(())
}

/// Returns the first four bytes of a packet as a number, little-endian.
fn first_word(packet: &[u8]) -> u32 {
    u32::from_le_bytes([packet[0], packet[1], packet[2], packet[3]])
}
