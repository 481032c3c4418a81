//! Demo with hub, simulated skin, classifier and dashboard.

use std::net::TcpListener;
use std::path::{Path, PathBuf};

use tactnet_channel::{Bus, Domain, Table, remove_bus, temporary_bus_name};
use tactnet_serving::web::Dashboard;
use tactnet_skin::ServeConfig;

use crate::write_table::write_table;
use crate::{ChildProcess, PlayCycle, SimulationError};

/// The processes of a demo on a private bus, and the page. The processes are killed if this is dropped before [`Demo::end`].
pub struct Demo {
    page: Option<Dashboard>,
    /// Processes in the order of their start, the hub first.
    processes: Vec<ChildProcess>,
    table: Table,
    path: PathBuf,
    cycle: Option<PlayCycle>,
}

impl Demo {
    /// Returns the file with the channel table, which exists as long as the demo.
    pub fn table(&self) -> &Path {
        &self.path
    }

    /// Starts all processes and waits until each is ready.
    ///
    /// - `program`: path of the command-line program
    /// - `folder`: folder in which the table is written
    /// - `run`: run directory of the serving network
    /// - `sweeps`: data set whose sweeps the skin plays, except the network's training sweeps
    /// - `skin_words`: further arguments of the program that plays the skin
    /// - `listener`: socket of the page
    ///
    /// # Errors
    /// Fails if a process does not start or the folder cannot be written.
    pub fn start(
        program: &Path,
        folder: &Path,
        run: &Path,
        sweeps: &Path,
        skin_words: &[String],
        listener: TcpListener,
    ) -> Result<Self, SimulationError> {
        let config = ServeConfig::default();
        let table = config.table(&temporary_bus_name("demo"));
        let path = write_table(&table, folder)?;
        let (run, sweeps) = (run.display().to_string(), sweeps.display().to_string());
        let mut demo = Self {
            page: None,
            processes: Vec::new(),
            table,
            path,
            cycle: None,
        };
        let hub = ["channel", "hub", "--table"];
        let classifier = ["serve", "--metrics", "off", "--run", &run, "--table"];
        let cycle = folder.join("cycle.json");
        let cycle_name = cycle.display().to_string();
        let skin = ["simulate", "skin", "--data", &sweeps, "--unseen-by", &run];
        let words = skin_words.iter().map(String::as_str);
        let skin: Vec<&str> = skin.into_iter().chain(words).collect();
        let skin = [&skin[..], &["--cycle-out", &cycle_name, "--table"]].concat();
        let mut start = |name: &'static str, arguments: &[&str]| {
            let process = ChildProcess::start(program, name, arguments, &demo.path)?;
            demo.processes.push(process);
            Ok::<_, SimulationError>(())
        };
        start("hub", &hub)?;
        start("classifier", &classifier)?;
        let bus = Bus::open(Domain::Host, &demo.table)?;
        demo.page = Some(Dashboard::open(&bus, &config, listener)?);
        start("skin", &skin)?;
        // The skin wrote the file before it was ready.
        let text = std::fs::read_to_string(cycle).ok();
        demo.cycle = text.and_then(|text| serde_json::from_str(&text).ok());
        if let (Some(page), Some(cycle)) = (&mut demo.page, demo.cycle) {
            page.set_note(cycle.to_string());
        }
        Ok(demo)
    }

    /// Returns the cycle of played sweeps, if the skin reports it.
    pub fn cycle(&self) -> Option<PlayCycle> {
        self.cycle
    }

    /// Waits for the next frame, updates the page and checks all processes. Returns a line for every classified object
    /// and every rejected sweep since the last call.
    ///
    /// # Errors
    /// Fails if a process has ended by itself or the channels break down.
    pub fn step(&mut self) -> Result<Vec<String>, SimulationError> {
        let shown = self.page.as_mut().map(Dashboard::step).transpose();
        for process in &mut self.processes {
            if let Some(status) = process.ended()? {
                let reason = format!("ended: {status}");
                return Err(SimulationError::child(process.name(), reason));
            }
        }
        shown?;
        let page = self.page.as_mut();
        Ok(page.map(Dashboard::take_messages).unwrap_or_default())
    }

    /// Returns the link that opens the page.
    pub fn link(&self) -> String {
        self.page.as_ref().map_or_else(String::new, Dashboard::link)
    }

    /// Ends the page and all processes, the hub last.
    ///
    /// # Errors
    /// Fails if the exit status of a process is not success.
    pub fn end(mut self) -> Result<(), SimulationError> {
        self.page = None;
        while let Some(process) = self.processes.pop() {
            process.end()?;
        }
        Ok(())
    }
}

impl Drop for Demo {
    fn drop(&mut self) {
        // Shared memory can only be removed after the processes have ended.
        self.page = None;
        self.processes.clear();
        // A failure leaves unused files only.
        let _ = remove_bus(&self.table);
    }
}
