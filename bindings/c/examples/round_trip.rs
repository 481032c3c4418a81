//! Measures round trips of one skin frame between two processes, as `round_trip.c` does.
//!
//!     round_trip TABLE pong &  round_trip TABLE ping ROUNDS        prints nanoseconds: median and 99th percentile

use tactnet_channel::{
    Bus, ChannelError, Domain, GetPort, Priority, PutPort, Start, Table, Wait, now_ns,
};
use tactnet_skin::packets::SkinFrame;

/// Number of rounds before the measurement starts.
const WARM_UP: usize = 1000;

fn put(port: &PutPort<SkinFrame>, sequence: u64) -> Result<(), ChannelError> {
    let mut frame = port.loan(1)?;
    frame[0].sequence = sequence;
    frame[0].taxels = 16;
    port.put(frame).map(drop)
}

fn get(port: &GetPort<SkinFrame>) -> Result<u64, ChannelError> {
    let frame = port.get(Wait::Spin)?.expect("spins until there is one");
    Ok(frame[0].sequence)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, table, role, rest @ ..] = arguments.as_slice() else {
        return Err("usage: round_trip TABLE ping|pong [ROUNDS]".into());
    };
    let bus = Bus::open(Domain::Host, &Table::load(table.as_ref())?)?;
    let (from, to) = if role == "ping" {
        ("pong", "ping")
    } else {
        ("ping", "pong")
    };
    let input = bus.get_port::<SkinFrame>(from, Start::Now)?;
    let output = bus.put_port::<SkinFrame>(to, Priority::RealTime)?;
    if role != "ping" {
        println!("ready");
        loop {
            match get(&input)? {
                u64::MAX => return Ok(()),
                sequence => put(&output, sequence)?,
            }
        }
    }
    let rounds: usize = rest.first().ok_or("ROUNDS are missing")?.parse()?;
    let mut took = Vec::with_capacity(rounds);
    for round in 0..rounds + WARM_UP {
        let begun = now_ns();
        put(&output, round as u64)?;
        if get(&input)? != round as u64 {
            return Err("another frame came back".into());
        }
        if round >= WARM_UP {
            took.push(now_ns() - begun);
        }
    }
    put(&output, u64::MAX)?;
    took.sort_unstable();
    println!("{} {}", took[rounds / 2], took[rounds * 99 / 100]);
    Ok(())
}
