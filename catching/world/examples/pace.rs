//! Measures the computation time of a simulated second: a thousand ticks of a moving robot with one ball in the air,
//! 20 times.
//!
//!     cargo run --release -p tactnet-catching-world --example pace

use std::time::Instant;

use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_packets::{ARMS, JOINTS, RobotDescription};
use tactnet_catching_world::{World, WorldConfig, WorldError};

fn main() -> Result<(), WorldError> {
    let robot = RobotDescription::nominal();
    let mut millis = Vec::new();
    for seed in 0..20 {
        let mut world = World::new(&robot, &WorldConfig::default(), seed, &[0.0; JOINTS])?;
        let begin = Instant::now();
        world.throw(1);
        for tick in 0..1000u32 {
            let t = f64::from(tick) * 1e-3;
            let command = JointCommand {
                number: u64::from(tick),
                command_ns: world.time_ns(),
                q: [0.1 * (1.0 - (5.0 * t).cos()); JOINTS],
                dq: [0.5 * (5.0 * t).sin(); JOINTS],
            };
            world.step(&command, &[None; ARMS]);
        }
        millis.push(begin.elapsed().as_secs_f64() * 1e3);
    }
    millis.sort_by(f64::total_cmp);
    println!(
        "a simulated second takes {:.1} ms (median of 20; least {:.1}, most {:.1})",
        millis[10], millis[0], millis[19]
    );
    Ok(())
}
