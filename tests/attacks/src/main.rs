//! Runs damaged and hostile input on all readers of files and foreign packets, in process, and counts the failures.
//!
//! Each target must accept its seeds, so that a run that refuses every input does not look like a success. A seeded
//! generator draws the mutations, so a
//! run is repeatable. Failing inputs are kept in files; `tactnet-attacks --target NAME --input FILE` runs one again.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use tactnet_attacks::{Allocator, Limits, Report, attack, most_held, open};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

/// Run damaged and hostile input on all readers of files and foreign packets
#[derive(Parser)]
#[command(after_help = "Examples:\n  \
    tactnet-attacks --seconds 5                       every target for five seconds\n  \
    tactnet-attacks --executions 10000000 --seconds 3600\n  \
    tactnet-attacks --target npz --input attacks/npz-17    again what broke")]
struct Arguments {
    /// Target to attack [default: all]
    #[arg(long, value_name = "NAME")]
    target: Option<String>,
    /// Maximum duration per target, in s
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    seconds: f64,
    /// Maximum number of executions per target
    #[arg(long, value_name = "N", default_value_t = u64::MAX)]
    executions: u64,
    /// Seed of all random choices
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Folder for failing inputs
    #[arg(long, value_name = "DIR", default_value = "attacks")]
    out: PathBuf,
    /// Input to run once, instead of an attack
    #[arg(long, value_name = "FILE", requires = "target")]
    input: Option<PathBuf>,
    /// Attack in this process
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
