//! Writes circles of throws for other trackers as JSON, with initial states and the results of this project.
//!
//!     cargo run --release -p tactnet-catching-trials --example peer_circles -- THROWS SEED > circles.json

use tactnet_catching::Robot;
use tactnet_catching::track::TrackConfig;
use tactnet_catching_trials::peer_circles;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = || arguments.next().ok_or("expected THROWS SEED");
    let (throws, seed): (usize, u64) = (number()?.parse()?, number()?.parse()?);
    let robot = Robot::nominal();
    let circles = peer_circles(&robot, TrackConfig::default(), seed, throws, |_| ())?;
    println!("{}", serde_json::to_string(&circles)?);
    Ok(())
}
