//! The stress test on this project's channels.

use std::time::Duration;

use bytemuck::{Pod, Zeroable};
use tactnet_channel::{
    Bus, ChannelConfig, Congestion, Domain, GetPort, GetSide, Hub, HubThread, Network, Packet,
    Priority, PutPort, Start, SyncGroup, Table, Wait, remove_bus,
};

use crate::plan::{Cell, Configuration, StressDomain};
use crate::{Client, Failure, Master};

/// Four bytes of a packet. The first word holds the round, the others are not written, as in the thesis.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Word(u32);

impl Packet for Word {
    const NAME: &'static str = "Word";
    const VERSION: u32 = 1;
}

/// First TCP port of the hubs in the distributed domain.
const FIRST_PORT: u16 = 17_440;

/// Returns the channels of a cell for one host.
fn table(cell: &Cell, name: &str, host: usize) -> Table {
    let distributed = cell.domain == StressDomain::Distributed;
    let channel = |put_ports, get_ports| ChannelConfig {
        put_ports,
        get_ports,
        depth: 2,
        held: 1,
        distributed,
        congestion: Congestion::Block,
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
        let port = |host: usize| format!("tcp/127.0.0.1:{}", FIRST_PORT + host as u16);
        table.network = Network {
            host: format!("h{host}"),
            listen: vec![port(host)],
            connect: (0..host).map(port).collect(),
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

/// Returns the host of a client: in the distributed domain the second or third.
fn host_of(cell: &Cell, client: usize) -> usize {
    match cell.domain {
        StressDomain::Distributed => 1 + client % 2,
        _ => 0,
    }
}

/// Hubs of a cell; their buses are removed when dropped.
pub(super) struct Hubs(Vec<(Table, HubThread)>);

impl Hubs {
    /// Starts no hub for a process, one for a host, and three for a master and clients on two other hosts.
    pub(super) fn start(cell: &Cell, name: &str) -> Result<Self, Failure> {
        let hosts = match cell.domain {
            StressDomain::Process => 0,
            StressDomain::Host => 1,
            StressDomain::Distributed => 3,
        };
        let mut hubs = Self(Vec::new());
        for host in 0..hosts {
            let table = table(cell, name, host);
            let hub = Hub::spawn(&table)?;
            hubs.0.push((table, hub));
        }
        Ok(hubs)
    }
}

impl Drop for Hubs {
    fn drop(&mut self) {
        for (table, hub) in self.0.drain(..) {
            drop(hub);
            // The next cell has another name.
            let _ = remove_bus(&table);
        }
    }
}

fn open_bus(cell: &Cell, name: &str, host: usize) -> Result<Bus, Failure> {
    let domain = match cell.domain {
        StressDomain::Process => Domain::Process,
        StressDomain::Host | StressDomain::Distributed => Domain::Host,
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
            None => open_bus(cell, name, host_of(cell, number))?,
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
