//! Lower bounds for the stress test: round trips of a bare futex wake-up without a packet, and of Unix sockets. Prints JSON.
//!
//! ```sh
//! cargo run --release -p tactnet-channel-stress --example lower_bounds             # 4 B, 64 KB and 1 MB, 1 and 10 clients
//! cargo run --release -p tactnet-channel-stress --example lower_bounds -- 65536 10
//! ```

mod futex;
mod unix;

use std::process::Command;
use std::time::Duration;

use serde_json::{Value, json};
use tactnet_channel::percentile;
use tactnet_channel_stress::{Client, Failure, Master, round_trips, serve};
use tactnet_process::ReadyProcess;

/// Duration of one measurement.
const TIME: Duration = Duration::from_millis(500);
/// Measurements of each size and number of clients.
const REPEATS: usize = 5;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["client", transport, name, size] => client(transport, name, size.parse()?),
        [] => print_all(&[4, 65_536, 1 << 20], &[1, 10]),
        [size, clients] => print_all(&[size.parse()?], &[clients.parse()?]),
        _ => Err("expected no arguments, or SIZE CLIENTS".into()),
    }
}

/// Prints the round trips of all sizes and numbers of clients, in turns.
fn print_all(sizes: &[usize], clients: &[usize]) -> Result<(), Failure> {
    let commit = Command::new("git")
        .args(["rev-parse", "--short=12", "HEAD"])
        .output()?;
    let mut rows = Vec::new();
    for _ in 0..REPEATS {
        for &size in sizes {
            for &clients in clients {
                rows.extend(measure_both(size, clients)?);
            }
        }
    }
    let commit = String::from_utf8_lossy(&commit.stdout);
    println!(
        "{:#}",
        json!({ "schema_version": 1, "git": commit.trim(), "rows": rows })
    );
    Ok(())
}

fn measure_both(size: usize, clients: usize) -> Result<Vec<Value>, Failure> {
    if size < 4 || clients == 0 {
        return Err("expected at least 4 bytes and 1 client".into());
    }
    let mut rows = Vec::new();
    // The futex has two words in shared memory: no packet, and one client.
    if clients == 1 {
        let mut master = futex::FutexMaster::open(&name())?;
        rows.push(measure("futex", &mut master, size, clients)?);
    }
    let mut master = unix::UnixMaster::open(&name(), size, clients)?;
    rows.push(measure("unix", &mut master, size, clients)?);
    Ok(rows)
}

fn name() -> String {
    format!("tactnet-lower-bounds-{}", std::process::id())
}

fn measure(
    transport: &str,
    master: &mut dyn Master,
    size: usize,
    clients: usize,
) -> Result<Value, Failure> {
    let program = std::env::current_exe()?;
    let start = |_| {
        let mut command = Command::new(&program);
        command.args(["client", transport, &name(), &size.to_string()]);
        ReadyProcess::start_with_input(&mut command, "")
    };
    let mut processes = (0..clients).map(start).collect::<Result<Vec<_>, _>>()?;
    for process in &mut processes {
        process.wait_until_ready()?;
    }
    let mut trips = round_trips(master, clients, TIME, || Ok(()))?.trips;
    trips.sort();
    let at = |share| percentile(&trips, share).map_or(0.0, |trip| trip.as_secs_f64() * 1e6);
    Ok(json!({
        "transport": transport, "size": size, "clients": clients, "median_us": at(0.5), "p99_us": at(0.99)
    }))
}

fn client(transport: &str, name: &str, size: usize) -> Result<(), Failure> {
    let mut client: Box<dyn Client> = match transport {
        "futex" => Box::new(futex::FutexClient::open(name)?),
        "unix" => Box::new(unix::UnixClient::open(name, size)?),
        other => return Err(format!("expected futex or unix, found {other}").into()),
    };
    serve(&mut *client, || println!("ready"))
}
