//! `tactnet channel stress`: the stress test of the thesis, compared with other transports.

use std::io::BufRead as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use serde::Serialize;
use tactnet_channel_stress::{
    ChildProgram, Origin, Plan, PlanError, Row, Rows, enter_namespaces, page, picture, run_child,
};
use tactnet_models::MissingFeature;
use tactnet_pipeline::{Provenance, write_whole};

use super::stress_choices::{
    ConfigurationChoice, DomainChoice, TransportChoice, configurations_of,
};
use crate::stop::Stop;
use crate::{GIT, output};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet channel stress                                              4 B to 1 MB, 1 and 10 clients, on this host\n  \
    tactnet channel stress --against iceoryx2 --json                    compared with plain iceoryx2\n  \
    tactnet channel stress --domain process --clients 1,10,100,200 --configurations all --html stress.html\n  \
    sudo tactnet channel stress --domain namespaces --against zenoh --picture stress.svg   three hosts on this machine\n\n\
    Every cell starts new hubs and clients. Packets of 100 MB need some gigabytes of /dev/shm.")]
pub struct StressArgs {
    /// Location of master and clients
    #[arg(long, value_enum, value_delimiter = ',', default_value = "host")]
    domain: Vec<DomainChoice>,
    /// Packet sizes, in bytes
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
    /// Other transports to compare with
    #[arg(long, value_enum, value_delimiter = ',')]
    against: Vec<TransportChoice>,
    /// Poll instead of sleeping; needs one core per client
    #[arg(long)]
    spin: bool,
    /// Duration of each cell
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    seconds: f64,
    /// Measure everything N times, alternating; compare the rows of a cell by their medians
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    /// Write figures 2.6 to 2.9 of the thesis as an HTML page
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Write the same figures as an SVG picture, a column for each domain
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
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
        Plan {
            domains: self.domain.iter().map(|choice| choice.domain()).collect(),
            sizes: self.sizes.clone(),
            clients: self.clients.clone(),
            configurations: configurations_of(&self.configurations),
            against: self
                .against
                .iter()
                .flat_map(|choice| choice.transports().iter().copied())
                .collect(),
            spin: self.spin,
        }
    }
}

pub fn run(arguments: StressArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let cells = arguments.plan().cells().map_err(with_feature)?;
    anyhow::ensure!(
        arguments.picture.is_none() || arguments.sizes.len() + arguments.clients.len() > 2,
        "a picture needs at least two sizes (`--sizes`) or two numbers of clients (`--clients`)"
    );
    let network = enter_namespaces(&cells).map_err(|error| {
        anyhow::anyhow!("{error}; `--domain distributed` uses loopback instead")
    })?;
    let program = std::env::current_exe().context("cannot find this program")?;
    let child = ChildProgram {
        path: &program,
        arguments: &["channel", "stress-child"],
        network: network.as_ref(),
    };
    let time = Duration::from_secs_f64(arguments.seconds.clamp(0.01, 3600.0));
    let total = cells.len() * arguments.repeat as usize;
    let mut rows = Rows::new();
    for _ in 0..arguments.repeat {
        for cell in &cells {
            if stop.asked() {
                say!("stopped; the results so far follow");
                break;
            }
            let row = cell.measure(time, child);
            let result = row.failure.clone().unwrap_or_else(|| {
                format!("{:.1} us, 99 % below {:.1}", row.median_us, row.p99_us)
            });
            say!(
                "{}/{total} {:<11} {:<10} {:<12} {:>10} B {:>4} clients: {result}",
                rows.len() + 1,
                row.domain.name(),
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
    } else {
        print_table(&rows)?;
    }
    // After everything else: a file that cannot be written must not lose results.
    if let Some(file) = &arguments.html {
        write_page(file, &rows, &provenance)?;
    }
    if let Some(file) = &arguments.picture {
        let picture = picture(&rows).context("too few cells were measured for a picture")?;
        write_whole(file, picture.as_bytes())?;
        say!("{} written", file.display());
    }
    Ok(ExitCode::SUCCESS)
}

/// Adds the build flag of a missing feature.
fn with_feature(error: PlanError) -> anyhow::Error {
    match error {
        PlanError::WithoutZenoh => MissingFeature { feature: "zenoh" }.into(),
        error => error.into(),
    }
}

/// Prints rows as a table, with a heading.
fn print_table(rows: &[Row]) -> anyhow::Result<()> {
    output::print(format_args!(
        "{:<11} {:<10} {:<12} {:>10} {:>7} {:>8} {:>10} {:>10} {:>10} {:>10}",
        "domain",
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
    for row in rows {
        let failure = row.failure.as_ref();
        output::print(format_args!(
            "{:<11} {:<10} {:<12} {:>10} {:>7} {:>8} {:>10.1} {:>10.1} {:>10.1} {:>10.1}{}",
            row.domain.name(),
            row.transport,
            row.configuration,
            row.size,
            row.clients,
            row.rounds,
            row.median_us,
            row.p99_us,
            row.max_us,
            row.bandwidth_mb_s,
            failure.map_or(String::new(), |failure| format!("  {failure}"))
        ))?;
    }
    Ok(())
}

/// Writes the page with figures and table.
fn write_page(file: &Path, rows: &Rows, provenance: &Provenance) -> anyhow::Result<()> {
    let words: Vec<String> = std::env::args_os()
        .skip(1)
        .map(|word| word.to_string_lossy().into_owned())
        .collect();
    let machine = format!(
        "commit {GIT}, {}, {} threads",
        provenance.processor, provenance.threads
    );
    let origin = Origin {
        command: &format!("tactnet {}", words.join(" ")),
        machine: &machine,
    };
    let page = page(rows, origin);
    write_whole(file, page.as_bytes())?;
    say!("{} written", file.display());
    Ok(())
}

/// Runs a hub or client: reads its task from standard input and prints `ready` or an error.
pub fn child() -> anyhow::Result<ExitCode> {
    let mut line = String::new();
    std::io::stdin().lock().read_line(&mut line)?;
    let task = serde_json::from_str(&line).context(
        "expected a task on standard input; `tactnet channel stress` starts hubs and clients",
    )?;
    let served = run_child(&task, || drop(output::print(format_args!("ready"))));
    if let Err(failure) = served {
        output::print(format_args!("{failure}"))?;
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}
