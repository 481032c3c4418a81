//! `tactnet simulate catching`: message load of the catching stack.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Args;
use tactnet_channel::{Bus, Domain, now_ns};
use tactnet_serving::Realtime;
use tactnet_simulation::{
    CatchingLoad, LoadRole, LoopTimes, Scheduling, load_table, run_role, trips,
};
use tactnet_skin::ServeConfig;

use crate::output;
use crate::stop::Stop;
use crate::table;

#[derive(Args)]
pub struct CatchingArgs {
    /// Channel table; `--print-table` prints one with the stack's channels
    #[arg(long, value_name = "FILE", required_unless_present = "print_table")]
    table: Option<PathBuf>,
    /// Duration, in s [default: until Ctrl-C]
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Run only this process of the stack
    #[arg(long, hide = true)]
    role: Option<LoadRole>,
    /// Priority of that process under SCHED_FIFO
    #[arg(long, hide = true, value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: Option<u8>,
    /// Print a table with the channels of the stack and the classifier, and exit
    #[arg(long)]
    print_table: bool,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Runs the load.
pub fn run(arguments: &CatchingArgs) -> anyhow::Result<ExitCode> {
    let Some(path) = &arguments.table else {
        let table = load_table(ServeConfig::default().table("robot"));
        output::print(format_args!("{}", toml::to_string(&table)?.trim_end()))?;
        return Ok(ExitCode::SUCCESS);
    };
    let stop = Stop::listen_saying("stopping")?;
    let bus = Bus::open(Domain::Host, &table::load(path)?)?;
    if let Some(role) = arguments.role {
        let realtime = Realtime {
            priority: arguments.priority,
            ..Realtime::default()
        };
        for line in realtime.apply() {
            say!("{line}; continuing without");
        }
        output::print(format_args!("ready"))?;
        let report = run_role(role, &bus, &|| stop.asked())?;
        output::print_json(&report)?;
        return Ok(ExitCode::SUCCESS);
    }
    // This only checks for a hub; every process of the stack opens its own bus.
    drop(bus);
    let program = std::env::current_exe()?;
    let stack = CatchingLoad::start(&program, path, Scheduling::Usual)?;
    let begun_ns = now_ns();
    let begun = Instant::now();
    while !stop.asked()
        && arguments
            .seconds
            .is_none_or(|s| begun.elapsed().as_secs_f64() < s)
    {
        std::thread::sleep(Duration::from_millis(20));
    }
    let reports = stack.end()?;
    let times = LoopTimes::of(trips(&reports)?, &[(begun_ns, u64::MAX)]);
    if arguments.json {
        output::print_json(&times)?;
    } else {
        let lost: u64 = reports.iter().map(|report| report.lost).sum();
        output::print(format_args!(
            "1 kHz loop: {:.0} us, 99 % below {:.0}, 99.9 % below {:.0}; {lost} packets lost",
            times.p50_us, times.p99_us, times.p999_us
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}
