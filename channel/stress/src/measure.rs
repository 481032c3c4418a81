//! Measurement of round trips.

use std::time::{Duration, Instant};

use tactnet_channel::temporary_bus_name;

use crate::clients::Clients;
use crate::plan::{Cell, Transport};
use crate::{ChildProgram, END, Failure, Master, PATIENCE, Row, channel, iceoryx};

/// Number of rounds before the measurement starts.
const WARM_UP: u32 = 20;
/// Minimum number of measured rounds.
const MIN_ROUNDS: u32 = 10;
/// Maximum number of measured rounds.
const MAX_ROUNDS: u32 = 20_000;
/// Timeout of an answer while warming up: the first packets may come before all clients are connected.
const WARM_UP_PATIENCE: Duration = Duration::from_millis(500);

/// Measured round trips.
#[derive(Debug, Clone, Default)]
pub struct RoundTrips {
    /// Durations of the successful rounds, in their order.
    pub trips: Vec<Duration>,
    /// Number of rounds without all answers.
    pub failures: usize,
}

/// Measures round trips for about `time`, then ends the clients.
///
/// - `clients`: number of clients
/// - `check`: fails if a client has ended early
///
/// # Errors
/// Errors of the transport and of `check`.
pub fn round_trips(
    master: &mut dyn Master,
    clients: usize,
    time: Duration,
    mut check: impl FnMut() -> Result<(), Failure>,
) -> Result<RoundTrips, Failure> {
    let mut measured = RoundTrips::default();
    let mut begun = Instant::now();
    for round in 0..WARM_UP + MAX_ROUNDS {
        if round == WARM_UP {
            measured.trips.clear();
            begun = Instant::now();
        }
        let patience = match round {
            0..WARM_UP => WARM_UP_PATIENCE,
            _ => PATIENCE,
        };
        match one_round(master, round, clients, patience)? {
            Some(trip) => measured.trips.push(trip),
            None if round < WARM_UP => {}
            None => measured.failures += 1,
        }
        let enough = round >= WARM_UP + MIN_ROUNDS && begun.elapsed() > time;
        if enough || measured.failures > 2 {
            break;
        }
        check()?;
    }
    master.broadcast(END)?;
    Ok(measured)
}

/// Returns the duration of a round; `None` if an answer is missing after `patience`.
fn one_round(
    master: &mut dyn Master,
    round: u32,
    clients: usize,
    patience: Duration,
) -> Result<Option<Duration>, Failure> {
    let begun = Instant::now();
    master.broadcast(round)?;
    let mut answers = 0;
    while answers < clients {
        match master.answer(patience)? {
            Some(number) if number == round => answers += 1,
            Some(_) => {}
            None => return Ok(None),
        }
    }
    Ok(Some(begun.elapsed()))
}

impl Cell {
    /// Measures the cell for about `time`, with new hubs and clients.
    pub fn measure(&self, time: Duration, program: ChildProgram<'_>) -> Row {
        match self.try_measure(time, program) {
            Ok(trips) => Row::measured(self, trips),
            Err(failure) => Row::failed(self, failure.to_string()),
        }
    }

    fn try_measure(
        &self,
        time: Duration,
        program: ChildProgram<'_>,
    ) -> Result<RoundTrips, Failure> {
        let name = temporary_bus_name("stress");
        let mut ends = MasterEnd::open(self, &name, program)?;
        let mut clients = Clients::start(self, &name, ends.bus.as_ref(), program)?;
        let trips = round_trips(&mut *ends.master, self.clients, time, || clients.check())?;
        clients.end();
        Ok(trips)
    }
}

/// The master with everything that must live as long.
struct MasterEnd {
    master: Box<dyn Master>,
    /// Bus that threads share.
    bus: Option<tactnet_channel::Bus>,
    _hubs: Option<channel::Hubs>,
}

impl MasterEnd {
    fn open(cell: &Cell, name: &str, program: ChildProgram<'_>) -> Result<Self, Failure> {
        let (mut bus, mut hubs) = (None, None);
        let master: Box<dyn Master> = match cell.transport {
            Transport::Tactnet => {
                hubs = Some(channel::Hubs::start(cell, name, program)?);
                let master = channel::ChannelMaster::open(cell, name)?;
                bus = Some(master.bus());
                Box::new(master)
            }
            Transport::Iceoryx2 => Box::new(iceoryx::IceoryxMaster::open(cell, name)?),
            #[cfg(feature = "zenoh")]
            Transport::Zenoh | Transport::ZenohShm => {
                Box::new(crate::zenoh::ZenohMaster::open(cell, name)?)
            }
            #[cfg(not(feature = "zenoh"))]
            Transport::Zenoh | Transport::ZenohShm => {
                return Err(crate::PlanError::WithoutZenoh.into());
            }
        };
        Ok(Self {
            master,
            bus,
            _hubs: hubs,
        })
    }
}
