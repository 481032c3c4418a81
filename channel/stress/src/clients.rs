//! The clients of a cell: threads in the process domain, otherwise processes.

use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tactnet_channel::Bus;
use tactnet_process::ReadyProcess;

use crate::channel::ChannelClient;
use crate::plan::{Cell, StressDomain};
use crate::{ChildProgram, ChildTask, Failure, Role, serve};

/// Timeout for the start of a client thread.
const START: Duration = Duration::from_secs(60);
/// Time that clients get to end before they are killed.
const END: Duration = Duration::from_secs(2);

/// Running clients; processes are killed when this is dropped.
#[derive(Default)]
pub(crate) struct Clients {
    processes: Vec<ReadyProcess>,
    threads: Vec<JoinHandle<()>>,
}

impl Clients {
    /// Starts the clients of a cell and waits until all are ready.
    ///
    /// - `bus`: the master's bus, for threads
    pub(crate) fn start(
        cell: &Cell,
        name: &str,
        bus: Option<&Bus>,
        program: ChildProgram<'_>,
    ) -> Result<Self, Failure> {
        if cell.domain == StressDomain::Process {
            Self::start_threads(cell, name, bus)
        } else {
            Self::start_processes(cell, name, program)
        }
    }

    fn start_threads(cell: &Cell, name: &str, bus: Option<&Bus>) -> Result<Self, Failure> {
        let mut clients = Self::default();
        let (ready, is_ready) = channel::<Result<(), Failure>>();
        for number in 0..cell.clients {
            let (cell, name) = (*cell, name.to_owned());
            let (ready, bus) = (ready.clone(), bus.cloned());
            let run = move || {
                let served = ChannelClient::open(&cell, &name, number, bus)
                    .and_then(|mut client| serve(&mut client, || drop(ready.send(Ok(())))));
                if let Err(failure) = served {
                    let _ = ready.send(Err(failure));
                }
            };
            clients.threads.push(std::thread::spawn(run));
        }
        for _ in 0..cell.clients {
            is_ready.recv_timeout(START)??;
        }
        Ok(clients)
    }

    fn start_processes(
        cell: &Cell,
        name: &str,
        program: ChildProgram<'_>,
    ) -> Result<Self, Failure> {
        let mut clients = Self::default();
        for number in 0..cell.clients {
            let task = ChildTask {
                cell: *cell,
                role: Role::Client { number },
                name: name.into(),
            };
            clients.processes.push(program.start(&task)?);
        }
        for (number, client) in clients.processes.iter_mut().enumerate() {
            client
                .wait_until_ready()
                .map_err(|error| format!("client {number} {error}"))?;
        }
        Ok(clients)
    }

    /// Fails if a client process has ended.
    pub(crate) fn check(&mut self) -> Result<(), Failure> {
        let ended = self
            .processes
            .iter_mut()
            .any(|client| matches!(client.ended(), Ok(Some(_))));
        if ended {
            return Err("a client has ended early".into());
        }
        Ok(())
    }

    /// Waits a moment for the end of clients that received the last round.
    pub(crate) fn end(&mut self) {
        let deadline = Instant::now() + END;
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
