//! One cell after the other, each with clients of its own.

use std::fmt;
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde::Serialize;

use tactnet_channel::percentile;
use tactnet_process::ReadyProcess;

use tactnet_channel::temporary_bus_name;

use crate::plan::{Cell, StressDomain, Transport};
use crate::{ClientTask, END, Failure, Master, PATIENCE, channel, futex, iceoryx, unix};

/// Rounds before the clock counts.
const WARM_UP: u32 = 20;
/// Fewest and most rounds of a cell.
const ROUNDS: (u32, u32) = (10, 20_000);

/// Measurements of one cell.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// Name of the transport.
    pub transport: &'static str,
    /// Where master and clients are.
    pub domain: StressDomain,
    /// Channels and sync groups.
    pub configuration: &'static str,
    /// Packet size, bytes.
    pub size: usize,
    /// Number of clients.
    pub clients: usize,
    /// Rounds counted.
    pub rounds: usize,
    /// Fastest round trip, microseconds.
    pub min_us: f64,
    /// Median round trip, microseconds.
    pub median_us: f64,
    /// 99 % of the round trips are faster, microseconds.
    pub p99_us: f64,
    /// Slowest round trip, microseconds.
    pub max_us: f64,
    /// Rounds in which an answer did not come within ten seconds, and cells that could not start.
    pub failures: usize,
    /// Bytes of all packets of a round over its median time: 2 C P / t, megabytes per second (thesis, section 2.4.2).
    pub bandwidth_mb_s: f64,
    /// Why there is nothing to see.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

/// All rows so far.
pub type Rows = Vec<Row>;

impl Row {
    /// Returns the line of names above rows that are printed with [`fmt::Display`].
    pub fn heading() -> String {
        format!(
            "{:<10} {:<12} {:>10} {:>7} {:>8} {:>10} {:>10} {:>10} {:>10}",
            "transport",
            "channels",
            "size [B]",
            "clients",
            "rounds",
            "median [us]",
            "p99 [us]",
            "max [us]",
            "MB/s"
        )
    }

    fn of(cell: &Cell, mut trips: Vec<Duration>, failures: usize, failure: Option<String>) -> Self {
        trips.sort();
        let at = |share| percentile(&trips, share).map_or(0.0, |trip| trip.as_secs_f64() * 1e6);
        let median = at(0.5);
        Self {
            transport: cell.transport.name(),
            domain: cell.domain,
            configuration: cell.configuration.name(),
            size: cell.size,
            clients: cell.clients,
            rounds: trips.len(),
            min_us: at(0.0),
            median_us: median,
            p99_us: at(0.99),
            max_us: at(1.0),
            failures,
            bandwidth_mb_s: if median > 0.0 {
                2.0 * cell.clients as f64 * cell.size as f64 / median
            } else {
                0.0
            },
            failure,
        }
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:<10} {:<12} {:>10} {:>7} {:>8} {:>10.1} {:>10.1} {:>10.1} {:>10.1}",
            self.transport,
            self.configuration,
            self.size,
            self.clients,
            self.rounds,
            self.median_us,
            self.p99_us,
            self.max_us,
            self.bandwidth_mb_s
        )?;
        match &self.failure {
            Some(failure) => write!(f, "  {failure}"),
            None => Ok(()),
        }
    }
}

impl Cell {
    /// Measures it for about `time`.
    ///
    /// - `program`: starts a client process, given `arguments`, and tells it its task on standard input
    pub fn measure(&self, time: Duration, program: &Path, arguments: &[&str]) -> Row {
        match self.try_measure(time, program, arguments) {
            Ok((trips, failures)) => Row::of(self, trips, failures, None),
            Err(failure) => Row::of(self, Vec::new(), 1, Some(failure.to_string())),
        }
    }

    fn try_measure(
        &self,
        time: Duration,
        program: &Path,
        arguments: &[&str],
    ) -> Result<(Vec<Duration>, usize), Failure> {
        let name = temporary_bus_name("stress");
        let mut open = Opened::open(self, &name)?;
        let mut clients = Clients::start(self, &name, &open, program, arguments)?;
        let master = &mut *open.master;
        let (mut trips, mut failures) = (Vec::new(), 0);
        let mut begun = Instant::now();
        for round in 0..WARM_UP + ROUNDS.1 {
            if round == WARM_UP {
                trips.clear();
                begun = Instant::now();
            }
            // Warming up also connects: a first packet may come before everybody listens.
            let patience = match round {
                0..WARM_UP => Duration::from_millis(500),
                _ => PATIENCE,
            };
            match one_round(master, round, self.clients, patience)? {
                Some(trip) => trips.push(trip),
                None if round < WARM_UP => {}
                None => failures += 1,
            }
            let enough = round >= WARM_UP + ROUNDS.0 && begun.elapsed() > time;
            if enough || failures > 2 {
                break;
            }
            if let Some(failure) = clients.failure() {
                return Err(failure);
            }
        }
        master.broadcast(END)?;
        clients.end();
        Ok((trips, failures))
    }
}

/// `None` if an answer did not come in time.
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

/// The master with everything that must live as long.
struct Opened {
    master: Box<dyn Master>,
    /// The bus that threads share.
    bus: Option<tactnet_channel::Bus>,
    _hubs: Option<channel::Hubs>,
}

impl Opened {
    fn open(cell: &Cell, name: &str) -> Result<Self, Failure> {
        let (mut bus, mut hubs) = (None, None);
        let master: Box<dyn Master> = match cell.transport {
            Transport::Tactnet => {
                hubs = Some(channel::Hubs::start(cell, name)?);
                let master = channel::ChannelMaster::open(cell, name)?;
                bus = Some(master.bus());
                Box::new(master)
            }
            Transport::Iceoryx2 => Box::new(iceoryx::IceoryxMaster::open(cell, name)?),
            Transport::Unix => Box::new(unix::UnixMaster::open(cell, name)?),
            Transport::Futex => Box::new(futex::FutexMaster::open(name)?),
            #[cfg(feature = "zenoh")]
            Transport::Zenoh | Transport::ZenohShm => {
                Box::new(super::zenoh::ZenohMaster::open(cell, name)?)
            }
            #[cfg(not(feature = "zenoh"))]
            Transport::Zenoh | Transport::ZenohShm => return Err(super::plan::WITHOUT_ZENOH.into()),
        };
        Ok(Self {
            master,
            bus,
            _hubs: hubs,
        })
    }
}

/// Threads in the process domain, else processes.
struct Clients {
    processes: Vec<ReadyProcess>,
    threads: Vec<JoinHandle<()>>,
}

impl Clients {
    fn start(
        cell: &Cell,
        name: &str,
        opened: &Opened,
        program: &Path,
        arguments: &[&str],
    ) -> Result<Self, Failure> {
        let mut clients = Self {
            processes: Vec::new(),
            threads: Vec::new(),
        };
        let task = |number| ClientTask {
            cell: *cell,
            number,
            name: name.into(),
        };
        if cell.domain == StressDomain::Process {
            let (ready, is_ready) = channel::<Result<(), Failure>>();
            for number in 0..cell.clients {
                let (ready, task, bus) = (ready.clone(), task(number), opened.bus.clone());
                clients.threads.push(std::thread::spawn(
                    move || match channel::ChannelClient::open(&task.cell, &task.name, number, bus)
                    {
                        Ok(mut client) => {
                            let told = ready.clone();
                            let served = super::serve(&mut client, || drop(told.send(Ok(()))));
                            if let Err(failure) = served {
                                let _ = ready.send(Err(failure));
                            }
                        }
                        Err(failure) => drop(ready.send(Err(failure))),
                    },
                ));
            }
            for _ in 0..cell.clients {
                is_ready.recv_timeout(Duration::from_secs(60))??;
            }
            return Ok(clients);
        }
        for number in 0..cell.clients {
            let task = serde_json::to_string(&task(number))?;
            let mut command = Command::new(program);
            let client = ReadyProcess::start_with_input(command.args(arguments), &task)?;
            clients.processes.push(client);
        }
        for (number, client) in clients.processes.iter_mut().enumerate() {
            client
                .wait_until_ready()
                .map_err(|error| format!("client {number} {error}"))?;
        }
        Ok(clients)
    }

    /// A client that has ended before its time.
    fn failure(&mut self) -> Option<Failure> {
        let ended = self
            .processes
            .iter_mut()
            .any(|client| matches!(client.ended(), Ok(Some(_))));
        ended.then(|| "a client has ended before its time".into())
    }

    /// Waits a moment for those that were told to end; the rest is killed when this is dropped.
    fn end(&mut self) {
        let deadline = Instant::now() + Duration::from_secs(2);
        while Instant::now() < deadline && self.processes.iter_mut().any(runs) {
            std::thread::sleep(Duration::from_millis(5));
        }
        for thread in self.threads.drain(..) {
            if thread.is_finished() || Instant::now() < deadline {
                let _ = thread.join();
            }
        }
    }
}

fn runs(client: &mut ReadyProcess) -> bool {
    matches!(client.ended(), Ok(None))
}
