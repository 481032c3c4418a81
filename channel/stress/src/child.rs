//! Child processes of the test: hubs and clients.

use std::path::Path;
use std::process::Command;

use serde::{Deserialize, Serialize};
use tactnet_process::{NetworkError, ReadyProcess, VirtualNetwork};

use crate::plan::{Cell, HOSTS, StressDomain, Transport};
use crate::{Client, Failure, channel, iceoryx, serve};

/// Program that runs hubs and clients.
#[derive(Debug, Clone, Copy)]
pub struct ChildProgram<'a> {
    /// Path of the program. It reads a [`ChildTask`] from its standard input and calls [`run_child`].
    pub path: &'a Path,
    /// Arguments of the program.
    pub arguments: &'a [&'a str],
    /// Hosts of [`StressDomain::Namespaces`], from [`enter_namespaces`].
    pub network: Option<&'a VirtualNetwork>,
}

/// Task of a child process, from its standard input.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ChildTask {
    pub(crate) cell: Cell,
    pub(crate) role: Role,
    /// Name of this test, to separate it from others on the machine.
    pub(crate) name: String,
}

/// Role of a child process.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) enum Role {
    Hub { host: usize },
    Client { number: usize },
}

/// Creates the network namespaces that the cells need, if any, and moves this thread to the master's.
///
/// # Errors
/// Namespaces are not allowed, or a program is missing.
pub fn enter_namespaces(cells: &[Cell]) -> Result<Option<VirtualNetwork>, NetworkError> {
    let needed = |cell: &Cell| cell.domain == StressDomain::Namespaces;
    if !cells.iter().any(needed) {
        return Ok(None);
    }
    let network = VirtualNetwork::new(HOSTS)?;
    network.enter(0)?;
    Ok(Some(network))
}

impl ChildProgram<'_> {
    /// Starts the program with a task, on the host of its role.
    pub(crate) fn start(&self, task: &ChildTask) -> Result<ReadyProcess, Failure> {
        let host = match task.role {
            Role::Hub { host } => host,
            Role::Client { number } => task.cell.host_of(number),
        };
        let mut command = match (task.cell.domain, self.network) {
            (StressDomain::Namespaces, Some(network)) => network.command(host, self.path),
            (StressDomain::Namespaces, None) => {
                return Err("there are no network namespaces".into());
            }
            _ => Command::new(self.path),
        };
        let input = serde_json::to_string(task)?;
        let process = ReadyProcess::start_with_input(command.args(self.arguments), &input)?;
        Ok(process)
    }
}

/// Runs a child: a hub until it is killed; a client until the master ends it or is silent for a minute.
///
/// - `ready`: called when the child is connected
///
/// # Errors
/// Errors of the transport.
pub fn run_child(task: &ChildTask, ready: impl FnOnce()) -> Result<(), Failure> {
    let ChildTask { cell, role, name } = task;
    let number = match *role {
        Role::Hub { host } => return channel::run_hub(cell, name, host, ready),
        Role::Client { number } => number,
    };
    let mut client: Box<dyn Client> = match cell.transport {
        Transport::Tactnet => Box::new(channel::ChannelClient::open(cell, name, number, None)?),
        Transport::Iceoryx2 => Box::new(iceoryx::IceoryxClient::open(cell, name)?),
        #[cfg(feature = "zenoh")]
        Transport::Zenoh | Transport::ZenohShm => {
            Box::new(crate::zenoh::ZenohClient::open(cell, name)?)
        }
        #[cfg(not(feature = "zenoh"))]
        Transport::Zenoh | Transport::ZenohShm => return Err(crate::PlanError::WithoutZenoh.into()),
    };
    serve(&mut *client, ready)
}
