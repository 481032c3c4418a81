//! `tactnet channel stress`: the thesis's stress test, beside other transports.

use std::io::BufRead as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context;
use clap::{Args, ValueEnum};
use serde::Serialize;
use tactnet_pipeline::{Provenance, write_whole};
use tactnet_rehearsal::stress::{
    Configuration, Plan, Rows, StressDomain, Transport, page, run_client,
};

use crate::stop::Stop;
use crate::{GIT, output};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet channel stress                                              4 B to 1 MB, 1 and 10 clients, on this host\n  \
    tactnet channel stress --against iceoryx2,unix,futex --json         beside raw iceoryx2, sockets and a bare wake-up\n  \
    tactnet channel stress --domain process --clients 1,10,100,200 --configurations all --html stress.html\n\n\
    Every cell starts clients of its own. 100 MB packets want some gigabytes of /dev/shm.")]
pub struct StressArgs {
    /// Where master and clients are
    #[arg(long, value_enum, value_delimiter = ',', default_value = "host")]
    domain: Vec<DomainChoice>,
    /// Packet sizes, bytes
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "BYTES",
        default_value = "4,65536,1048576"
    )]
    sizes: Vec<usize>,
    /// Numbers of clients
    #[arg(long, value_delimiter = ',', value_name = "C", default_value = "1,10")]
    clients: Vec<usize>,
    /// Channels and sync groups
    #[arg(long, value_enum, value_delimiter = ',', default_value = "standard")]
    configurations: Vec<ConfigurationChoice>,
    /// Other transports to measure side by side
    #[arg(long, value_enum, value_delimiter = ',')]
    against: Vec<TransportChoice>,
    /// Look again and again instead of sleeping; wants a core for each client
    #[arg(long)]
    spin: bool,
    /// Time for each cell
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    seconds: f64,
    /// Measure everything N times, in turns; rows of one cell then are to be compared by their medians
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    /// Write the thesis's figures 2.6 to 2.9 as a page
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum DomainChoice {
    /// Threads of one process
    Process,
    /// Processes of this host
    Host,
    /// Three hosts, which share this machine and speak over loopback (needs a build with `--features zenoh`)
    Distributed,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum ConfigurationChoice {
    /// One channel there, one back
    Standard,
    /// The master waits with a sync group
    #[value(name = "1-sync")]
    OneSync,
    /// Every client waits with a sync group
    NSync,
    /// A channel back for each client, waited for one after the other
    NChannels,
    /// A channel back for each client, waited for together
    SyncOnN,
    /// All of them
    All,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum TransportChoice {
    /// Iceoryx2 as it comes
    Iceoryx2,
    /// Zenoh as it comes, over TCP and with shared memory (needs a build with `--features zenoh`)
    Zenoh,
    /// A Unix socket for each client
    Unix,
    /// A bare wake-up, no packet
    Futex,
}

#[derive(Serialize)]
struct StressResult<'a> {
    schema_version: u32,
    git: &'static str,
    processor: &'a str,
    threads: usize,
    rows: &'a Rows,
}

impl StressArgs {
    fn plan(&self) -> Plan {
        let mut against = Vec::new();
        for choice in &self.against {
            match choice {
                TransportChoice::Iceoryx2 => against.push(Transport::Iceoryx2),
                TransportChoice::Zenoh => {
                    against.extend([Transport::Zenoh, Transport::ZenohShm]);
                }
                TransportChoice::Unix => against.push(Transport::Unix),
                TransportChoice::Futex => against.push(Transport::Futex),
            }
        }
        let mut configurations = Vec::new();
        for choice in &self.configurations {
            match choice {
                ConfigurationChoice::Standard => configurations.push(Configuration::Standard),
                ConfigurationChoice::OneSync => configurations.push(Configuration::OneSync),
                ConfigurationChoice::NSync => configurations.push(Configuration::NSync),
                ConfigurationChoice::NChannels => configurations.push(Configuration::NChannels),
                ConfigurationChoice::SyncOnN => configurations.push(Configuration::SyncOnN),
                ConfigurationChoice::All => configurations = Configuration::ALL.to_vec(),
            }
        }
        let domains = self.domain.iter().map(|domain| match domain {
            DomainChoice::Process => StressDomain::Process,
            DomainChoice::Host => StressDomain::Host,
            DomainChoice::Distributed => StressDomain::Distributed,
        });
        Plan {
            domains: domains.collect(),
            sizes: self.sizes.clone(),
            clients: self.clients.clone(),
            configurations,
            against,
            spin: self.spin,
        }
    }
}

pub fn run(arguments: StressArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let cells = arguments
        .plan()
        .cells()
        .map_err(anyhow::Error::from_boxed)?;
    let program = std::env::current_exe().context("cannot find this program")?;
    let time = Duration::from_secs_f64(arguments.seconds.clamp(0.01, 3600.0));
    let total = cells.len() * arguments.repeat as usize;
    let mut rows = Rows::new();
    for _ in 0..arguments.repeat {
        for cell in &cells {
            if stop.asked() {
                eprintln!("stopped; what was measured so far follows");
                break;
            }
            let row = cell.measure(time, &program, &["channel", "stress-client"]);
            let what = row.failure.clone().unwrap_or_else(|| {
                format!("{:.1} us, 99 % below {:.1}", row.median_us, row.p99_us)
            });
            eprintln!(
                "{}/{total} {:<10} {:<12} {:>10} B {:>4} clients: {what}",
                rows.len() + 1,
                row.transport,
                row.configuration,
                row.size,
                row.clients
            );
            rows.push(row);
        }
    }
    let provenance = Provenance::of_this_process(env!("CARGO_PKG_VERSION"), GIT);
    if arguments.json {
        output::print_json(&StressResult {
            schema_version: 1,
            git: GIT,
            processor: &provenance.processor,
            threads: provenance.threads,
            rows: &rows,
        })?;
        return write_page(&arguments, &rows, &provenance);
    }
    output::print(format_args!(
        "{:<10} {:<12} {:>10} {:>7} {:>8} {:>10} {:>10} {:>10} {:>10}",
        "transport",
        "channels",
        "size [B]",
        "clients",
        "rounds",
        "median [us]",
        "p99 [us]",
        "max [us]",
        "MB/s"
    ))?;
    for row in &rows {
        output::print(format_args!(
            "{:<10} {:<12} {:>10} {:>7} {:>8} {:>10.1} {:>10.1} {:>10.1} {:>10.1}{}",
            row.transport,
            row.configuration,
            row.size,
            row.clients,
            row.rounds,
            row.median_us,
            row.p99_us,
            row.max_us,
            row.bandwidth_mb_s,
            row.failure
                .as_ref()
                .map_or(String::new(), |failure| format!("  {failure}"))
        ))?;
    }
    write_page(&arguments, &rows, &provenance)
}

/// Last, so that no result is lost when it fails.
fn write_page(
    arguments: &StressArgs,
    rows: &Rows,
    provenance: &Provenance,
) -> anyhow::Result<ExitCode> {
    let Some(file) = &arguments.html else {
        return Ok(ExitCode::SUCCESS);
    };
    let words: Vec<String> = std::env::args().skip(1).collect();
    let machine = format!(
        "commit {GIT}, {}, {} threads",
        provenance.processor, provenance.threads
    );
    let page = page(rows, &format!("tactnet {}", words.join(" ")), &machine);
    write_whole(file, page.as_bytes())?;
    eprintln!("{} written", file.display());
    Ok(ExitCode::SUCCESS)
}

/// A client process: its task comes on standard input, and it says `ready` or what is wrong.
pub fn client() -> anyhow::Result<ExitCode> {
    let mut line = String::new();
    std::io::stdin().lock().read_line(&mut line)?;
    let task = serde_json::from_str(&line)
        .context("a client of the stress test is started by `tactnet channel stress`")?;
    let served = run_client(&task, || drop(output::print(format_args!("ready"))));
    if let Err(failure) = served {
        output::print(format_args!("{failure}"))?;
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}
