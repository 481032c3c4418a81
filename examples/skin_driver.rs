//! Sends frames of a skin and commands of a motion controller to a robot's channels, as their drivers would.
//!
//!     cargo run --release --example skin_driver                 owns the channels, for two sweeps
//!     cargo run --release --example skin_driver -- robot.toml   uses those of `tactnet channel hub --table robot.toml`; `tactnet serve` classifies

use std::time::{Duration, Instant};

use tactnet_channel::{Bus, Domain, Hub, Priority, Table, now_ns};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{Command, MAX_TAXELS, SkinFrame, SweepCommand, Text};

/// Frame rate, in Hz.
const RATE_HZ: f64 = 750.0;
/// Number of taxels of the skin.
const TAXELS: usize = 16;
/// Number of frames of a sweep.
const SWEEP: u64 = 1100;
/// Number of frames between two sweeps.
const REST: u64 = 200;

/// Returns simulated digits, `[TAXELS]`, in place of a sensor's.
fn read_sensor(frame: u64) -> [f32; TAXELS] {
    std::array::from_fn(|taxel| {
        let phase = frame as f32 * 0.1 + taxel as f32;
        100.0 + taxel as f32 + 5.0 * phase.sin()
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (table, hub) = match std::env::args().nth(1) {
        Some(file) => (Table::load(file.as_ref())?, None),
        None => {
            let table = ServeConfig::default().table(&format!("example{}", std::process::id()));
            let hub = Hub::spawn(&table)?;
            (table, Some(hub))
        }
    };
    let config = ServeConfig::of(&table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let frames = bus.put_port::<SkinFrame>(config.fingers[0].as_str(), Priority::High)?;
    let commands = bus.put_port::<SweepCommand>(config.command.as_str(), Priority::High)?;

    let begun = Instant::now();
    for sequence in 0..2 * (REST + SWEEP) {
        let (motion, position) = (sequence / (REST + SWEEP) + 1, sequence % (REST + SWEEP));
        if position == REST || position + 1 == REST + SWEEP {
            let kind = if position == REST {
                Command::Start
            } else {
                Command::Stop
            };
            commands.put_copy(&[SweepCommand {
                kind: kind as u32,
                finger: 0,
                motion,
                sweeps: 0,
                reserved: 0,
                material: Text::new("cork"),
            }])?;
        }
        // The frame is written in place, in shared memory.
        let mut packet = frames.loan(1)?;
        let mut digits = [0.0; MAX_TAXELS];
        digits[..TAXELS].copy_from_slice(&read_sensor(sequence));
        packet[0] = SkinFrame {
            sequence,
            sensor_time_ns: now_ns(),
            taxels: TAXELS as u32,
            reserved: 0,
            digits,
        };
        frames.put(packet)?;
        let due = Duration::from_secs_f64((sequence + 1) as f64 / RATE_HZ);
        std::thread::sleep(due.saturating_sub(begun.elapsed()));
    }
    println!(
        "{} frames in {:.2} s",
        2 * (REST + SWEEP),
        begun.elapsed().as_secs_f64()
    );
    if let Some(hub) = hub {
        drop((frames, commands, bus));
        hub.stop()?;
        tactnet_channel::remove_bus(&table)?;
    }
    Ok(())
}
