//! Measures round trips of urgent packets with and without a bulk sender of 50 MB/s on the same channel: on a host and, with the feature
//! `zenoh`, over a link between two hubs (TCP over loopback).
//!
//! ```sh
//! cargo run --release -p tactnet-channel --features zenoh --example urgent_under_load
//! ```

use std::error::Error;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use tactnet_channel::{
    Bus, ChannelConfig, Domain, Hub, Network, Priority, Start, Table, TemporaryBus, Ticker, Wait,
    now_ns, percentile, temporary_bus_name,
};

/// Size of a bulk packet, in bytes.
const BULK_BYTES: usize = 50_000;
/// Bulk packets per second.
const BULK_RATE_HZ: f64 = 1000.0;
/// Urgent packets per second.
const RATE_HZ: f64 = 1000.0;
const ROUNDS: usize = 3000;

/// Port of the link on 127.0.0.1.
const LINK_PORT: u16 = 17_470;
/// Time for the ports of two hosts to find each other.
const MEETING: Duration = Duration::from_secs(2);

fn main() -> Result<(), Box<dyn Error>> {
    println!("place load       median [us]   99 % [us]");
    measure("host", &[table()])?;
    if cfg!(feature = "zenoh") {
        let mut both = table();
        for channel in both.channels.values_mut() {
            channel.distributed = true;
        }
        let host = |name: &str, listen, connect| Table {
            network: Network {
                host: name.into(),
                listen,
                connect,
                ..Network::default()
            },
            ..both.clone()
        };
        let link = || vec![format!("tcp/127.0.0.1:{LINK_PORT}")];
        measure(
            "link",
            &[host("a", link(), vec![]), host("b", vec![], link())],
        )?;
    }
    Ok(())
}

/// Returns the channels of a host.
fn table() -> Table {
    let there = ChannelConfig {
        put_ports: 2,
        ..ChannelConfig::of::<u8>(BULK_BYTES)
    };
    Table::new(&temporary_bus_name("urgent-"))
        .with("there", there)
        .with("back", ChannelConfig::of::<u8>(8))
}

/// Prints the times of round trips from the first host to the last.
fn measure(place: &str, hosts: &[Table]) -> Result<(), Box<dyn Error>> {
    let _remove_at_the_end: Vec<_> = hosts.iter().map(TemporaryBus).collect();
    let _hubs: Vec<_> = hosts.iter().map(Hub::spawn).collect::<Result<_, _>>()?;
    for load in ["none", "50 MB/s"].repeat(3) {
        let times = round_trips(hosts, load != "none")?;
        let at = |share| percentile(&times, share).unwrap_or(0.0);
        println!("{place:<5} {load:<10} {:>11.1} {:>11.1}", at(0.5), at(0.99));
    }
    Ok(())
}

/// Returns the times of round trips, in microseconds, ascending.
fn round_trips(hosts: &[Table], is_loaded: bool) -> Result<Vec<f64>, Box<dyn Error>> {
    let stop = AtomicBool::new(false);
    let (first, last) = (&hosts[0], &hosts[hosts.len() - 1]);
    let bus = |table| Bus::open(Domain::Host, table);
    let (near, far, sender) = (bus(first)?, bus(last)?, bus(first)?);
    let got = far.get_port::<u8>("there", Start::Now)?;
    let answer = far.put_port::<u8>("back", Priority::RealTime)?;
    let bulk = sender.put_port::<u8>("there", Priority::Bulk)?;
    let urgent = near.put_port::<u8>("there", Priority::RealTime)?;
    let back = near.get_port::<u8>("back", Start::Now)?;
    if hosts.len() > 1 {
        std::thread::sleep(MEETING);
    }
    let wait = Wait::Block {
        timeout: Duration::from_millis(500),
    };
    let mut times = Vec::with_capacity(ROUNDS);
    std::thread::scope(|scope| {
        let stop = &stop;
        scope.spawn(move || {
            while !stop.load(Ordering::Relaxed) {
                match got.get(wait) {
                    Ok(Some(packet)) if packet.len() == 8 => drop(answer.put_copy(&packet)),
                    _ => {}
                }
            }
        });
        if is_loaded {
            scope.spawn(move || {
                let mut ticker = Ticker::new(BULK_RATE_HZ);
                while !stop.load(Ordering::Relaxed) {
                    ticker.wait();
                    if let Ok(packet) = bulk.loan(BULK_BYTES) {
                        drop(bulk.put(packet));
                    }
                }
            });
        }
        let mut ticker = Ticker::new(RATE_HZ);
        for _ in 0..ROUNDS {
            ticker.wait();
            let begun = now_ns();
            let answered = urgent.put_copy(&[1; 8]).and_then(|_| back.get(wait));
            if matches!(answered, Ok(Some(_))) {
                times.push((now_ns() - begun) as f64 / 1e3);
            }
        }
        stop.store(true, Ordering::Relaxed);
    });
    times.sort_by(f64::total_cmp);
    Ok(times)
}
