//! Writes hulls of the robot's bodies in random motions for other libraries as JSON, with the distances of this project.
//!
//!     cargo run --release -p tactnet-catching-trials --example peer_hulls -- MOTIONS SEED > hulls.json

use tactnet_catching::Robot;
use tactnet_catching_trials::SafetyBench;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = || arguments.next().ok_or("expected MOTIONS SEED");
    let bench = SafetyBench {
        motions: number()?.parse()?,
        seed: number()?.parse()?,
    };
    let robot = Robot::nominal();
    println!("{}", serde_json::to_string(&bench.peer_hulls(&robot))?);
    Ok(())
}
