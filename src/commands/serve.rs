//! `tactnet serve`: the online classifier as a component on the robot's channels.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use tactnet_channel::{Bus, Domain};
use tactnet_data::ASSUMED_RATE_HZ;
use tactnet_pipeline::RunDir;
use tactnet_serving::systemd::ServiceManager;
use tactnet_serving::{
    ModelSource, Realtime, ServeReport, Service, accepted_values, allocations_of_this_thread, web,
};
use tactnet_skin::{ServeConfig, commented};

use crate::stop::Stop;
use crate::table;
use crate::{GIT, output};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet channel hub --table robot.toml &                          hold the channels, once per host\n  \
    tactnet serve --run runs/twin-fast-fold0-1 --table robot.toml     serve one trained network\n  \
    tactnet serve --models models/right --table robot.toml            serve the newest of models/right/1, models/right/2, …\n  \
    tactnet serve --run runs/a --table robot.toml --priority 60 --cpu 1 --lock-memory\n\n\
    `tactnet serve --print-table` shows a table with all names, rates and promises. A new version is to be moved into the folder whole (`mv`); \
    it serves from the next pause between sweeps on, if shape, rate and materials fit.")]
pub struct ServeArgs {
    /// Run directory of a trained network
    #[arg(long, value_name = "DIR", conflicts_with = "models")]
    run: Option<PathBuf>,
    /// A folder of run directories with numbers for names; the newest serves, and is replaced when a newer one lands
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// The table of channels, with a section [components.tactnet]
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// Where to answer Prometheus, at /metrics; `off`: nowhere
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:9464")]
    metrics: String,
    /// Run under SCHED_FIFO with this priority
    #[arg(long, value_name = "1-99", value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: Option<u8>,
    /// Stay on this core
    #[arg(long, value_name = "N")]
    cpu: Option<usize>,
    /// Keep all memory in RAM
    #[arg(long)]
    lock_memory: bool,
    /// Print a table with every setting and end; with `--run`, `values` in it follows the run's training sweeps: 0 to 255 if all their values
    /// lie within, else their range and as much again on either side; deadlines follow its sample rate
    #[arg(long)]
    print_table: bool,
    /// Print one JSON document with the counters at the end
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &ServeArgs) -> anyhow::Result<ExitCode> {
    if arguments.print_table {
        let mut config = ServeConfig::default();
        let mut rate_hz = ASSUMED_RATE_HZ;
        if let Some(run) = &arguments.run {
            config.segmenter.values = accepted_values(run)?;
            let dir = RunDir::open(run)?;
            rate_hz = dir.config()?.classifier.sample_rate_hz;
            // Sweeps of TactMat are the middle of a motion; those of others begin where they begin.
            if let Some(result) = dir.result()?
                && !result.origin.is_comparable_to_published()
            {
                config.segmenter.skip = 0;
            }
        }
        output::print(commented(&config.table("robot"), rate_hz)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    let source = match (&arguments.run, &arguments.models) {
        (Some(run), None) => ModelSource::Run(run.clone()),
        (None, Some(folder)) => ModelSource::Versions(folder.clone()),
        _ => anyhow::bail!(
            "which model: name a run with `--run`, or a folder of versions with `--models`"
        ),
    };
    let Some(path) = &arguments.table else {
        anyhow::bail!(
            "which channels: name a table with `--table`; `tactnet serve --print-table` prints one"
        );
    };
    let stop = Stop::listen_saying("stopping")?;
    let table = table::load(path)?;
    let config = ServeConfig::of(&table).with_context(|| path.display().to_string())?;
    // A wrong folder is told before channels are asked for.
    if let ModelSource::Run(run) = &source {
        RunDir::open(run)?.config()?;
    }
    let bus = Bus::open(Domain::Host, &table)?;
    let skip = config.segmenter.skip;
    let mut service = Service::start(&bus, config, source, GIT)?;
    service.count_allocations(allocations_of_this_thread);
    let _web = match arguments.metrics.as_str() {
        "off" => None,
        address => {
            let address: SocketAddr = address.parse().with_context(|| {
                format!("--metrics: `{address}` is no address like 127.0.0.1:9464")
            })?;
            let web = web::metrics(address, service.measures())?;
            if !address.ip().is_loopback() {
                say!("counters are at {}", web.link_to("/metrics"));
            }
            Some(web)
        }
    };
    let refused = Realtime {
        priority: arguments.priority,
        cpu: arguments.cpu,
        lock_memory: arguments.lock_memory,
    }
    .apply();
    for line in refused {
        say!("{line}; going on without");
    }
    let names = service.names();
    say!(
        "serving {} materials, {} frames of {} x {} taxels at {} Hz, {} dropout masks; Ctrl-C ends",
        names.materials,
        names.steps,
        names.rows,
        names.cols,
        names.sample_rate_hz,
        names.mc_samples
    );
    if let Some([least, greatest]) = service.values() {
        say!(
            "a sweep with values outside {least} to {greatest} is rejected (`values` in the table)"
        );
    }
    if skip > 0 {
        say!(
            "a sweep is judged from {:.2} s after its motion starts (`skip = {skip}` in the table; 0 where motions begin as the training sweeps do)",
            skip as f64 / names.sample_rate_hz
        );
    }
    if service.is_rate_assumed() {
        say!(
            "warning: the rate of {} Hz is assumed, since the training data did not say; train with `--rate HZ`",
            names.sample_rate_hz
        );
    }
    if !service.tells_unknown() {
        say!(
            "unknown materials are not told: the run was trained without `--calibrate`, or there are no dropout masks"
        );
    }
    service.drain()?;
    output::print(format_args!("ready"))?;
    let mut manager = ServiceManager::from_environment();
    manager.notify("READY=1");
    while !stop.asked() {
        service.step(Duration::from_millis(100))?;
        service.take_news().iter().for_each(|line| say!("{line}"));
        // A manager that watches restarts a service whose connected skin has fallen silent.
        if !service.is_blind() {
            manager.keep_alive();
        }
    }
    manager.notify("STOPPING=1");
    let report = ServeReport::new(&service.counters(), service.sequences());
    if arguments.json {
        output::print_json(&report)?;
    } else {
        say!("{report}");
    }
    Ok(ExitCode::SUCCESS)
}
