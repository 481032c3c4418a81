//! Soak test of the complete system: deadlines of the classifier, and its influence on the 1 kHz loop.

mod played;
mod report;

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tactnet_channel::{
    Bus, Domain, Hub, Start, Table, TemporaryBus, Wait, now_ns, temporary_bus_name,
};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{Stage, TactileBelief};

use crate::stack::with_priority;
use crate::write_table::write_table;
use crate::{
    ChildProcess, Company, Scheduling, SimulationError, SkinDriver, SkinSimulator, rest_frames,
};
pub use played::Played;
pub use report::SoakReport;
use report::{HeardBeliefs, Measured};

/// Maximum duration of a window with or without the classifier, in s.
const WINDOW: f64 = 10.0;
/// Time at the start of each window that is not evaluated, because processes start and end then.
const SETTLE: Duration = Duration::from_millis(500);

/// A soak test with hub, skin, company, classifier and dashboard.
#[derive(Debug, Clone, Copy)]
pub struct Soak<'a> {
    /// Path of the command-line program.
    pub program: &'a Path,
    /// Commit of the program, for the report.
    pub git: &'static str,
    /// Run directory of the serving network.
    pub run: &'a Path,
    /// Folder in which the channel table is written.
    pub folder: &'a Path,
    /// Total time with the classifier, in s. It alternates with equal windows without it, of at most ten seconds each.
    pub seconds: f64,
    /// Processes beside the classifier.
    pub company: Company,
    /// Scheduling of the 1 kHz loop, the skin and the classifier.
    pub scheduling: Scheduling,
}

impl Soak<'_> {
    /// Runs the test on a private bus.
    ///
    /// - `on_turn`: called with the number of each turn, from 1, and the number of turns
    /// - `stopped`: returns true to end the test after the current turn
    ///
    /// # Errors
    /// Fails if channels, a process or a file cannot be opened, or if a process fails.
    pub fn run(
        &self,
        played: &Played<'_>,
        mut on_turn: impl FnMut(usize, usize),
        stopped: &dyn Fn() -> bool,
    ) -> Result<SoakReport, SimulationError> {
        let config = ServeConfig::default();
        let table = config.table(&temporary_bus_name("soak"));
        let table = self.company.channels(table, self.program)?;
        let path = write_table(&table, self.folder)?;
        let _own = TemporaryBus(&table);
        let hub = Hub::spawn(&table)?;
        let measured = self.measure(played, &table, &path, &mut on_turn, stopped);
        drop(hub);
        Ok(measured?.report(self))
    }

    fn measure(
        &self,
        played: &Played<'_>,
        table: &Table,
        path: &Path,
        on_turn: &mut dyn FnMut(usize, usize),
        stopped: &dyn Fn() -> bool,
    ) -> Result<Measured, SimulationError> {
        let bus = Bus::open(Domain::Host, table)?;
        let over = AtomicBool::new(false);
        let config = ServeConfig::of(table)?;
        let turns = (self.seconds / WINDOW).ceil().max(1.0) as usize;
        let window = Duration::from_secs_f64(self.seconds / turns as f64);
        let (mut with, mut without, mut served) = (Vec::new(), Vec::new(), Vec::new());
        let (heard, company) = std::thread::scope(|scope| {
            let over_now = EndOnDrop(&over);
            let company =
                self.company
                    .start(scope, self.program, (table, path), self.scheduling, &over)?;
            let stopped = &|| stopped() || company.has_ended();
            let skin = scope.spawn(|| play_skin(&bus, &config, played, &over, self.scheduling));
            let heard = scope.spawn(|| listen(&bus, &config, played, &over));
            for turn in 0..turns {
                if stopped() {
                    break;
                }
                on_turn(turn + 1, turns);
                without.push(rest(window, stopped));
                let classifier = self.start_classifier(path)?;
                let page = ["dashboard", "--listen", "127.0.0.1:0", "--table"];
                let dashboard = ChildProcess::start(self.program, "dashboard", &page, path)?;
                with.push(rest(window, stopped));
                served.push(classifier.end_with_report()?);
                dashboard.end()?;
            }
            drop(over_now);
            skin.join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
            let heard = heard
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
            Ok::<_, SimulationError>((heard, company.end()?))
        })?;
        if with.is_empty() {
            return Err(SimulationError::Stopped);
        }
        Ok(Measured {
            company,
            served,
            heard,
            with,
            without,
        })
    }

    fn start_classifier(&self, table: &Path) -> Result<ChildProcess, SimulationError> {
        let run = self.run.display().to_string();
        let mut serve = vec!["serve", "--json", "--metrics", "off", "--run", &run];
        if self.scheduling == Scheduling::Fifo {
            serve.extend(["--priority", "60", "--lock-memory"]);
        }
        serve.push("--table");
        ChildProcess::start(self.program, "classifier", &serve, table)
    }
}

/// Ends the threads of the test when dropped, also after an error.
struct EndOnDrop<'a>(&'a AtomicBool);

impl Drop for EndOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Waits for one window; returns the start and end of its evaluated part, in ns.
fn rest(time: Duration, stopped: &dyn Fn() -> bool) -> (u64, u64) {
    std::thread::sleep(SETTLE);
    let (from, begun) = (now_ns(), Instant::now());
    while begun.elapsed() < time && !stopped() {
        std::thread::sleep(Duration::from_millis(10));
    }
    (from, now_ns())
}

fn play_skin(
    bus: &Bus,
    config: &ServeConfig,
    played: &Played<'_>,
    over: &AtomicBool,
    scheduling: Scheduling,
) -> Result<(), SimulationError> {
    let driver = SkinDriver::open(bus, config)?;
    if scheduling == Scheduling::Fifo {
        // Permission was checked before.
        with_priority(70).apply();
    }
    let (dataset, order) = (played.dataset(), played.order().to_vec());
    let rate_hz = dataset.sample_rate_hz();
    let lead = config.segmenter.skip.frames(rate_hz);
    let mut skin = SkinSimulator::new(dataset, order, lead, rest_frames(rate_hz));
    let ended = |_| over.load(Ordering::Relaxed);
    driver.run(&mut skin, |_, _| Ok(()), &ended)
}

fn listen(
    bus: &Bus,
    config: &ServeConfig,
    played: &Played<'_>,
    over: &AtomicBool,
) -> Result<HeardBeliefs, SimulationError> {
    let beliefs = bus.get_port::<TactileBelief>(config.belief.as_str(), Start::Now)?;
    let patience = Wait::Block {
        timeout: Duration::from_millis(100),
    };
    let mut heard = HeardBeliefs::default();
    while !over.load(Ordering::Relaxed) {
        let Some(packet) = beliefs.get(patience)? else {
            continue;
        };
        let Some(belief) = packet.first() else {
            continue;
        };
        let stage = (belief.stage as usize).wrapping_sub(1);
        let Some(latencies) = heard.latency_us.get_mut(stage) else {
            continue;
        };
        latencies.push(belief.latency_ns as f64 / 1e3);
        if belief.stage == Stage::Dropout as u32 && belief.motion > 0 {
            heard.evaluated += 1;
            heard.correct += u64::from(belief.label as usize == played.label_of(belief.motion));
        }
    }
    Ok(heard)
}
