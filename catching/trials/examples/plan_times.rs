//! Measures the computation time for keeping the whole path clear. Plans the same problems alternately with and
//! without it, and prints a line of JSON each.
//!
//!     cargo run --release -p tactnet-catching-trials --example plan_times -- PROBLEMS SEED

use serde_json::json;
use tactnet_catching::Robot;
use tactnet_catching::plan::{Objective, PlanConfig, WayConfig};
use tactnet_catching_trials::PlanBench;

/// Number of repetitions of each variant.
const TURNS: usize = 3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let numbers: Vec<u64> = std::env::args()
        .skip(1)
        .map(|argument| argument.parse())
        .collect::<Result<_, _>>()?;
    let [problems, seed] = numbers[..] else {
        return Err("expected PROBLEMS SEED".into());
    };
    let robot = Robot::nominal();
    for turn in 0..TURNS {
        for hard in [0.0, WayConfig::default().hard] {
            let way = WayConfig {
                hard,
                ..WayConfig::default()
            };
            let bench = PlanBench {
                problems: usize::try_from(problems)?,
                seed,
                objective: Objective::Soft,
                config: PlanConfig {
                    way,
                    ..PlanConfig::default()
                },
            };
            let report = bench.run(&robot, |_| ());
            let line = json!({"turn": turn, "looks_at_the_way": hard > 0.0, "report": report});
            println!("{line}");
        }
    }
    Ok(())
}
