//! Replay of a recording to a classifier process on a private bus.

use std::path::Path;

use tactnet_channel::{Bus, Domain, Hub, Network, Table, TemporaryBus, temporary_bus_name};
use tactnet_recording::{Played, Recording, play};
use tactnet_serving::ServeReport;

use crate::write_table::write_table;
use crate::{ChildProcess, SimulationError};

/// Replays a recording to a new classifier process. Returns the replayed and received packets, and the number of frames
/// that the classifier lost.
///
/// - `program`: path of the command-line program
/// - `run`: run directory of the serving network
/// - `folder`: folder in which the channel table is written
/// - `speed`: factor relative to the recorded time
/// - `stopped`: returns true to end the replay early
///
/// # Errors
/// Fails if channels or a process cannot be started, or break down.
pub fn replay_alone(
    program: &Path,
    run: &Path,
    folder: &Path,
    recording: &Recording,
    speed: f64,
    stopped: &dyn Fn() -> bool,
) -> Result<(Played, u64), SimulationError> {
    let mut table = Table {
        bus: temporary_bus_name("replay"),
        network: Network::default(),
        ..recording.table.clone()
    };
    for channel in table.channels.values_mut() {
        channel.distributed = false;
    }
    let path = write_table(&table, folder)?;
    let _own = TemporaryBus(&table);
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
