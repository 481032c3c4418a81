//! A recording on channels that nobody else uses, with a classifier beside this process.

use std::path::Path;

use tactnet_channel::{Bus, Domain, Hub, Network, OwnBus, Table, own_bus_name};
use tactnet_recording::{Played, Recording, play};
use tactnet_serving::ServeReport;

use crate::write_table::write_table;
use crate::{ChildProcess, SimulationError};

/// Plays a recording to a classifier of its own; returns what was put and heard, and how many frames the classifier has lost.
///
/// - `program`: the `tactnet` command
/// - `run`: run directory of the network that serves
/// - `folder`: where the table of channels is written
/// - `speed`: how much faster than it happened
/// - `stopped`: ends it early when it returns true
///
/// # Errors
/// Channels or a process that cannot be had, or that break down.
pub fn replay_alone(
    program: &Path,
    run: &Path,
    folder: &Path,
    recording: &Recording,
    speed: f64,
    stopped: &dyn Fn() -> bool,
) -> Result<(Played, u64), SimulationError> {
    let mut table = Table {
        bus: own_bus_name("replay"),
        network: Network::default(),
        ..recording.table.clone()
    };
    for channel in table.channels.values_mut() {
        channel.distributed = false;
    }
    let path = write_table(&table, folder)?;
    let _own = OwnBus(&table);
    let hub = Hub::spawn(&table)?;
    let run = run.display().to_string();
    let serve = ["serve", "--json", "--metrics", "off", "--run", &run];
    let serve = [&serve[..], &["--table"]].concat();
    let classifier = ChildProcess::start(program, "classifier", &serve, &path)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let played = play(recording, &bus, &table, speed, stopped);
    let served: ServeReport = classifier.end_with_report()?;
    drop(hub);
    Ok((played?, served.dropped_frames))
}
