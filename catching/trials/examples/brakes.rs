//! Counts throws in which the self-collision monitor would have braked, and those of them in which the ball was
//! caught. Prints a line of JSON per throw, then the report.
//!
//!     cargo run --release -p tactnet-catching-trials --example brakes -- BALLS THROWS SEED

use std::io::Write;

use serde_json::json;
use tactnet_catching::Robot;
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_trials::{Series, ThrowConfig};
use tactnet_catching_world::WorldConfig;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let numbers: Vec<u64> = std::env::args()
        .skip(1)
        .map(|argument| argument.parse())
        .collect::<Result<_, _>>()?;
    let [balls, throws, seed] = numbers[..] else {
        return Err("expected BALLS THROWS SEED".into());
    };
    let series = Series {
        config: ThrowConfig {
            balls: usize::try_from(balls)?,
            watch: true,
            ..ThrowConfig::new(
                Robot::new(RobotDescription::nominal()),
                WorldConfig::default(),
            )
        },
        throws,
        seed,
    };
    let report = series.run(|| ())?;
    let mut out = std::io::stdout().lock();
    for outcome in &report.outcomes {
        let balls: Vec<_> = outcome
            .balls
            .iter()
            .map(|ball| json!({"arms": ball.arms, "caught": ball.caught()}))
            .collect();
        let braked = outcome.braked.map(|braked| {
            json!({
                "motion": braked.motion,
                "since": braked.since,
                "bodies": braked.bodies,
                "braked_apart": braked.braked_apart,
                "carried_on": braked.carried_on,
            })
        });
        let line = json!({"number": outcome.number, "balls": balls, "braked": braked});
        writeln!(out, "{line}")?;
    }
    writeln!(out, "{}", serde_json::to_string(&report)?)?;
    Ok(())
}
