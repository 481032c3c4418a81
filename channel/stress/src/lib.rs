//! The thesis's stress test (section 2.4.1): a master sends to C clients, each answers with a packet of the same size, and the next round
//! begins when all answers are there. No pause, no work: what is measured is the transport.
//!
//! ```text
//!            ┌─ there ─> client 1 ─┐
//!  master ───┤            …        ├─ back ─> master      round trip = put … last answer
//!            └─ there ─> client C ─┘
//! ```

mod channel;
mod chart;
mod futex;
mod iceoryx;
mod measure;
mod plan;
mod put_numbered;
mod report;
mod unix;
#[cfg(feature = "zenoh")]
mod zenoh;

use std::time::Duration;

pub use measure::{Row, Rows};
pub use plan::{Cell, Configuration, Plan, StressDomain, Transport};
pub use put_numbered::put_numbered;
pub use report::page;

/// An error of a stress test, one line for people.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Number of the round that ends the clients.
const END: u32 = u32::MAX;
/// How long an answer may take before the round has failed.
const PATIENCE: Duration = Duration::from_secs(10);

/// The master's end of a transport.
trait Master {
    /// Sends a packet with the round's number to all clients.
    fn broadcast(&mut self, round: u32) -> Result<(), Failure>;
    /// The round of the next answer; `None` if none comes in time.
    fn answer(&mut self, patience: Duration) -> Result<Option<u32>, Failure>;
}

/// A client's end.
trait Client {
    /// The round of the next packet; `None` if none comes in time.
    fn round(&mut self, patience: Duration) -> Result<Option<u32>, Failure>;
    /// Sends that number back in a packet of the same size.
    fn answer(&mut self, round: u32) -> Result<(), Failure>;
}

/// The task of a client process, from its standard input.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct ClientTask {
    cell: Cell,
    number: usize,
    /// Distinguishes this test from others on the machine.
    name: String,
}

/// Runs a client in this process until the master ends it or has been silent for long. `ready` is called when it listens.
///
/// # Errors
/// Errors of the transport.
pub fn run_client(task: &ClientTask, ready: impl FnOnce()) -> Result<(), Failure> {
    let ClientTask { cell, number, name } = task;
    let mut client: Box<dyn Client> = match cell.transport {
        Transport::Tactnet => Box::new(channel::ChannelClient::open(cell, name, *number, None)?),
        Transport::Iceoryx2 => Box::new(iceoryx::IceoryxClient::open(cell, name)?),
        Transport::Unix => Box::new(unix::UnixClient::open(cell, name)?),
        Transport::Futex => Box::new(futex::FutexClient::open(name)?),
        #[cfg(feature = "zenoh")]
        Transport::Zenoh | Transport::ZenohShm => Box::new(zenoh::ZenohClient::open(cell, name)?),
        #[cfg(not(feature = "zenoh"))]
        Transport::Zenoh | Transport::ZenohShm => return Err(plan::WITHOUT_ZENOH.into()),
    };
    serve(&mut *client, ready)
}

fn serve(client: &mut dyn Client, ready: impl FnOnce()) -> Result<(), Failure> {
    ready();
    while let Some(round) = client.round(Duration::from_secs(60))? {
        if round == END {
            break;
        }
        client.answer(round)?;
    }
    Ok(())
}
