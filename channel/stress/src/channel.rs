//! The stress test on this project's channels.

use std::time::Duration;

use bytemuck::{Pod, Zeroable};
use tactnet_channel::{
    Bus, ChannelConfig, Congestion, Domain, GetPort, GetSide, Hub, Network, Packet, Priority,
    PutPort, Start, SyncGroup, Table, Wait, remove_bus,
};
use tactnet_process::ReadyProcess;

use crate::plan::{Cell, Configuration, StressDomain};
use crate::{ChildProgram, ChildTask, Client, Failure, Master, Role};

/// Four bytes of a packet. The first word holds the round, the others are not written, as in the thesis.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Word(u32);

impl Packet for Word {
    const NAME: &'static str = "Word";
    const VERSION: u32 = 1;
}

/// First TCP port of the hubs in the distributed domains.
const FIRST_PORT: usize = 17_440;
/// Interval between two calls of a hub.
const TICK: Duration = Duration::from_millis(20);

/// Returns the channels of a cell for one host.
fn table(cell: &Cell, name: &str, host: usize) -> Table {
    let distributed = cell.domain.is_distributed();
    let channel = |put_ports, get_ports| ChannelConfig {
        put_ports,
        get_ports,
        depth: 2,
        held: 1,
        distributed,
        congestion: Congestion::Block,
        // The answers of ten clients exceed the default.
        remote_rate: u32::MAX,
        ..ChannelConfig::of::<Word>(cell.size.div_ceil(4))
    };
    let mut table = Table::new(name).with("there", channel(1, cell.clients));
    if many_channels(cell) {
        for client in 0..cell.clients {
            table = table.with(&back(cell, client), channel(1, 1));
        }
    } else {
        // Between hosts all answers come from the hub's put-port.
        let depth = if distributed { 2 + 2 * cell.clients } else { 2 };
        table = table.with(
            "back",
            ChannelConfig {
                depth,
                ..channel(cell.clients, 1)
            },
        );
    }
    if distributed {
        let endpoint = |host| format!("tcp/{}:{}", cell.domain.address(host), FIRST_PORT + host);
        table.network = Network {
            host: format!("h{host}"),
            listen: vec![endpoint(host)],
            connect: (0..host).map(endpoint).collect(),
            plain_text: true,
            ..Network::default()
        };
    }
    table
}

fn many_channels(cell: &Cell) -> bool {
    matches!(
        cell.configuration,
        Configuration::NChannels | Configuration::SyncOnN
    )
}

fn back(cell: &Cell, client: usize) -> String {
    if many_channels(cell) {
        format!("back{client}")
    } else {
        "back".into()
    }
}

/// Hub processes of a cell; their buses are removed when dropped.
pub(super) struct Hubs {
    tables: Vec<Table>,
    processes: Vec<ReadyProcess>,
}

impl Hubs {
    /// Starts the hubs of all hosts.
    pub(super) fn start(
        cell: &Cell,
        name: &str,
        program: ChildProgram<'_>,
    ) -> Result<Self, Failure> {
        let hosts = 0..cell.domain.hubs();
        let mut hubs = Self {
            tables: hosts.clone().map(|host| table(cell, name, host)).collect(),
            processes: Vec::new(),
        };
        // One after the other: a hub that connects before the other listens tries again only after a second.
        for host in hosts {
            let task = ChildTask {
                cell: *cell,
                role: Role::Hub { host },
                name: name.into(),
            };
            let mut hub = program.start(&task)?;
            hub.wait_until_ready()
                .map_err(|error| format!("hub {host} {error}"))?;
            hubs.processes.push(hub);
        }
        Ok(hubs)
    }
}

impl Drop for Hubs {
    fn drop(&mut self) {
        self.processes.clear();
        for table in &self.tables {
            // A bus that cannot be removed does no harm.
            let _ = remove_bus(table);
        }
    }
}

/// Holds the channels of a host until this process is killed.
pub(super) fn run_hub(
    cell: &Cell,
    name: &str,
    host: usize,
    ready: impl FnOnce(),
) -> Result<(), Failure> {
    let mut hub = Hub::start(&table(cell, name, host))?;
    ready();
    loop {
        hub.tick()?;
        std::thread::sleep(TICK);
    }
}

fn open_bus(cell: &Cell, name: &str, host: usize) -> Result<Bus, Failure> {
    let domain = match cell.domain {
        StressDomain::Process => Domain::Process,
        StressDomain::Host | StressDomain::Distributed | StressDomain::Namespaces => Domain::Host,
    };
    Ok(Bus::open(domain, &table(cell, name, host))?)
}

fn wait(cell: &Cell, patience: Duration) -> Wait {
    if cell.spin {
        Wait::Spin
    } else {
        Wait::Block { timeout: patience }
    }
}

/// Sends a packet of the cell's size and writes only its first word.
fn put(port: &PutPort<Word>, cell: &Cell, round: u32) -> Result<(), Failure> {
    let mut packet = port.loan(cell.size.div_ceil(4))?;
    packet[0] = Word(round);
    port.put(packet)?;
    Ok(())
}

fn take(port: &GetPort<Word>) -> Result<Option<u32>, Failure> {
    Ok(port
        .try_get()?
        .and_then(|packet| packet.first().map(|word| word.0)))
}

pub(super) struct ChannelMaster {
    cell: Cell,
    bus: Bus,
    there: PutPort<Word>,
    back: Vec<GetPort<Word>>,
    group: Option<SyncGroup>,
    /// Next port to wait for, with one channel per client.
    next: usize,
}

impl ChannelMaster {
    pub(super) fn open(cell: &Cell, name: &str) -> Result<Self, Failure> {
        let bus = open_bus(cell, name, 0)?;
        let ports = if many_channels(cell) { cell.clients } else { 1 };
        let back = (0..ports)
            .map(|client| bus.get_port::<Word>(back(cell, client).as_str(), Start::Now))
            .collect::<Result<Vec<_>, _>>()?;
        let group = match cell.configuration {
            Configuration::OneSync | Configuration::SyncOnN => {
                let ports: Vec<&dyn GetSide> = back.iter().map(|port| port as _).collect();
                Some(bus.sync_group(&ports)?)
            }
            Configuration::Standard | Configuration::NSync | Configuration::NChannels => None,
        };
        Ok(Self {
            there: bus.put_port::<Word>("there", Priority::RealTime)?,
            cell: *cell,
            bus,
            back,
            group,
            next: 0,
        })
    }

    pub(super) fn bus(&self) -> Bus {
        self.bus.clone()
    }
}

impl Master for ChannelMaster {
    fn broadcast(&mut self, round: u32) -> Result<(), Failure> {
        self.next = 0;
        put(&self.there, &self.cell, round)
    }

    fn answer(&mut self, patience: Duration) -> Result<Option<u32>, Failure> {
        let wait = wait(&self.cell, patience);
        if let Some(group) = &mut self.group {
            return match group.wait(wait)? {
                Some(port) => take(&self.back[port]),
                None => Ok(None),
            };
        }
        let port = self.next % self.back.len();
        self.next += 1;
        Ok(self.back[port]
            .get(wait)?
            .and_then(|packet| packet.first().map(|word| word.0)))
    }
}

pub(super) struct ChannelClient {
    cell: Cell,
    there: GetPort<Word>,
    back: PutPort<Word>,
    group: Option<SyncGroup>,
}

impl ChannelClient {
    /// Connects to the channels of a cell.
    ///
    /// - `bus`: the master's bus, in the process domain
    pub(super) fn open(
        cell: &Cell,
        name: &str,
        number: usize,
        bus: Option<Bus>,
    ) -> Result<Self, Failure> {
        let bus = match bus {
            Some(bus) => bus,
            None => open_bus(cell, name, cell.host_of(number))?,
        };
        let there = bus.get_port::<Word>("there", Start::Now)?;
        let group = match cell.configuration {
            Configuration::NSync => Some(bus.sync_group(&[&there])?),
            _ => None,
        };
        Ok(Self {
            cell: *cell,
            back: bus.put_port::<Word>(back(cell, number).as_str(), Priority::RealTime)?,
            there,
            group,
        })
    }
}

impl Client for ChannelClient {
    fn round(&mut self, patience: Duration) -> Result<Option<u32>, Failure> {
        let wait = wait(&self.cell, patience);
        if let Some(group) = &mut self.group {
            return match group.wait(wait)? {
                Some(_) => take(&self.there),
                None => Ok(None),
            };
        }
        Ok(self
            .there
            .get(wait)?
            .and_then(|packet| packet.first().map(|word| word.0)))
    }

    fn answer(&mut self, round: u32) -> Result<(), Failure> {
        put(&self.back, &self.cell, round)
    }
}
