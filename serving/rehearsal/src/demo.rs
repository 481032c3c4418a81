//! Hub, simulated skin, classifier and dashboard together.

use std::net::SocketAddr;
use std::path::Path;

use tactnet_channel::{Table, remove_bus};
use tactnet_skin::ServeConfig;

use crate::write_table::write_table;
use crate::{ChildProcess, RehearsalError, SMALL_SWEEPS, make_twin};

/// The processes of a demonstration, on a bus of their own; they are killed if this is dropped before [`Demo::end`].
pub struct Demo {
    /// In the order in which they were started, the hub first.
    processes: Vec<ChildProcess>,
    table: Table,
}

impl Demo {
    /// Starts all processes and waits until each is ready.
    ///
    /// - `program`: the `tactnet` command
    /// - `folder`: where the table and the sweeps are written
    /// - `run`: run directory of the network that serves
    /// - `materials`: of the twin that the skin touches
    /// - `listen`: where browsers are answered
    ///
    /// # Errors
    /// A process that does not start; a folder that cannot be written.
    pub fn start(
        program: &Path,
        folder: &Path,
        run: &Path,
        materials: usize,
        listen: SocketAddr,
    ) -> Result<Self, RehearsalError> {
        let sweeps = folder.join("sweeps.h5");
        make_twin(program, &sweeps, materials, SMALL_SWEEPS)?;
        let table = ServeConfig::default().table(&format!("demo{}", std::process::id()));
        let path = write_table(&table, folder)?;
        let (run, sweeps) = (run.display().to_string(), sweeps.display().to_string());
        let listen = listen.to_string();
        let mut demo = Self {
            processes: Vec::new(),
            table,
        };
        let hub = ["channel", "hub", "--table"];
        let classifier = ["serve", "--metrics", "off", "--run", &run, "--table"];
        let dashboard = ["dashboard", "--listen", &listen, "--table"];
        let skin = ["simulate", "skin", "--data", &sweeps, "--unseen-by", &run];
        let skin = [&skin[..], &["--table"]].concat();
        for (name, arguments) in [
            ("hub", &hub[..]),
            ("classifier", &classifier[..]),
            ("dashboard", &dashboard[..]),
            ("skin", &skin[..]),
        ] {
            let process = ChildProcess::start(program, name, arguments, &path)?;
            demo.processes.push(process);
        }
        Ok(demo)
    }

    /// Looks after all processes.
    ///
    /// # Errors
    /// A process that has ended by itself.
    pub fn check(&mut self) -> Result<(), RehearsalError> {
        for process in &mut self.processes {
            if let Some(status) = process.ended()? {
                let reason = format!("ended: {status}");
                return Err(RehearsalError::child(process.name(), reason));
            }
        }
        Ok(())
    }

    /// Ends all processes, the hub last.
    ///
    /// # Errors
    /// A process that ends with another status than success.
    pub fn end(mut self) -> Result<(), RehearsalError> {
        while let Some(process) = self.processes.pop() {
            process.end()?;
        }
        Ok(())
    }
}

impl Drop for Demo {
    fn drop(&mut self) {
        // Their memory can only be removed after they have ended.
        self.processes.clear();
        // Nothing depends on it.
        let _ = remove_bus(&self.table);
    }
}
