//! Throws damaged and hostile input at everything that reads files or packets of others, in process, and counts what happens.
//!
//! Each target has seeds that must be accepted, so that a run in which everything is refused at the door does not look like a success.
//! Mutations are drawn from a seeded generator: a run repeats itself. What breaks is kept in a file, and tried again by
//! `tactnet-attacks --target NAME --input FILE`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use tactnet_attacks::{Allocator, Limits, Report, attack, most_held, open};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

/// Damaged and hostile input against everything that reads files or packets of others.
#[derive(Parser)]
#[command(after_help = "Examples:\n  \
    tactnet-attacks --seconds 5                       every target for five seconds\n  \
    tactnet-attacks --executions 10000000 --seconds 3600\n  \
    tactnet-attacks --target npz --input attacks/npz-17    again what broke")]
struct Arguments {
    /// One target only
    #[arg(long, value_name = "NAME")]
    target: Option<String>,
    /// Most seconds for each target
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    seconds: f64,
    /// Most executions of each target
    #[arg(long, value_name = "N", default_value_t = u64::MAX)]
    executions: u64,
    /// Names every random choice
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Where inputs go that break something
    #[arg(long, value_name = "DIR", default_value = "attacks")]
    out: PathBuf,
    /// Run this input once, and nothing else
    #[arg(long, value_name = "FILE", requires = "target")]
    input: Option<PathBuf>,
    /// In the process that attacks
    #[arg(long, hide = true, requires = "target")]
    child: bool,
}

fn main() -> anyhow::Result<ExitCode> {
    let arguments = Arguments::parse();
    if let (Some(target), Some(input)) = (&arguments.target, &arguments.input) {
        let mut target = open(target)?;
        let input = std::fs::read(input)?;
        let (accepted, most) = most_held(|| (target.run)(&input));
        let (answer, mib) = (if accepted { "accepted" } else { "refused" }, most >> 20);
        println!("{answer}, {mib} of {} MiB", target.ceiling >> 20);
        return Ok(ExitCode::SUCCESS);
    }
    let limits = Limits {
        seconds: arguments.seconds,
        executions: arguments.executions,
        seed: arguments.seed,
        out: arguments.out,
    };
    if let (Some(target), true) = (&arguments.target, arguments.child) {
        let row = attack(target, &limits)?;
        println!("{}", serde_json::to_string(&row)?);
        return Ok(ExitCode::SUCCESS);
    }
    let report = Report::of(arguments.target.as_deref(), &limits)?;
    println!("{}", serde_json::to_string_pretty(&report)?);
    Ok(ExitCode::from(u8::from(!report.is_clean())))
}
