//! `tactnet serve`: the online classifier on the robot's channels.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use tactnet_channel::{Bus, Domain};
use tactnet_data::ASSUMED_RATE_HZ;
use tactnet_pipeline::RunDir;
use tactnet_serving::systemd::ServiceManager;
use tactnet_serving::web::{self, WebServer};
use tactnet_serving::{
    ModelSource, Realtime, ServeReport, Service, accepted_values, allocations_of_this_thread,
};
use tactnet_skin::{FrameSpan, ServeConfig, commented};

use super::network_run::{NetworkUse, network_run};
use crate::output::counted;
use crate::stop::Stop;
use crate::table;
use crate::{GIT, output};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet channel hub --table robot.toml &                          start the hub, once per host\n  \
    tactnet serve --run runs/twin-committee-fold0-1 --table robot.toml     serve one trained network\n  \
    tactnet serve --models models/right --table robot.toml            serve the newest of models/right/1, models/right/2, …\n  \
    tactnet serve --run runs/a --table robot.toml --priority 60 --cpu 1 --lock-memory\n  \
    tactnet serve --run runs/a --table robot.toml --dead 3,7          taxels 3 and 7 are broken: classify without them\n\n\
    `tactnet serve --print-table` prints a table with all names, rates and deadlines. Move a new version into the folder as a whole (`mv`): \
    if its shape, sample rate and materials fit, it serves from the next pause between sweeps.")]
pub struct ServeArgs {
    /// Run directory of a trained network
    #[arg(long, value_name = "DIR", conflicts_with = "models")]
    run: Option<PathBuf>,
    /// Folder of run directories named by version numbers; the newest version serves, also if it appears later
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Channel table with a section [components.tactnet]
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// Dead taxels, counted from 0 row by row, in addition to those of the table: they are masked, as if they read their training mean
    #[arg(long, value_name = "TAXEL,…", value_delimiter = ',')]
    dead: Vec<usize>,
    /// Address of the Prometheus metrics (path /metrics), or `off`
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:9464")]
    metrics: String,
    /// Priority under SCHED_FIFO [default: the normal scheduler]
    #[arg(long, value_name = "1-99", value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: Option<u8>,
    /// Number of the core that runs the classifier [default: any]
    #[arg(long, value_name = "N")]
    cpu: Option<usize>,
    /// Lock all memory in RAM
    #[arg(long)]
    lock_memory: bool,
    /// Print a table with every setting and exit; with `--run`, `values` and the deadlines follow the run's training sweeps and sample rate
    #[arg(long)]
    print_table: bool,
    /// Print the counters at the end as one JSON document
    #[arg(long)]
    json: bool,
}

/// Serves until Ctrl-C.
pub fn run(arguments: &ServeArgs) -> anyhow::Result<ExitCode> {
    if arguments.print_table {
        return print_table(arguments.run.as_deref());
    }
    let source = source(arguments)?;
    let Some(path) = &arguments.table else {
        anyhow::bail!(
            "no channels: name a table with `--table`; `tactnet serve --print-table` prints one"
        );
    };
    let stop = Stop::listen_saying("stopping")?;
    let table = table::load(path)?;
    let mut config = ServeConfig::of(&table).with_context(|| path.display().to_string())?;
    config.dead.extend(&arguments.dead);
    // A wrong folder is reported before the channels are opened.
    if let ModelSource::Run(run) = &source {
        network_run(run, NetworkUse::Serve)?;
    }
    let bus = Bus::open(Domain::Host, &table)?;
    let skip = config.segmenter.skip;
    let mut service = Service::start(&bus, config, source, GIT)?;
    service.count_allocations(allocations_of_this_thread);
    let _web = serve_metrics(&arguments.metrics, &service)?;
    let refused = Realtime {
        priority: arguments.priority,
        cpu: arguments.cpu,
        lock_memory: arguments.lock_memory,
    }
    .apply();
    for line in refused {
        say!("{line}; continuing without");
    }
    describe(&service, skip);
    service.drain()?;
    output::print(format_args!("ready"))?;
    let mut manager = ServiceManager::from_environment();
    manager.notify("READY=1");
    while !stop.asked() {
        service.step(Duration::from_millis(100))?;
        service
            .take_messages()
            .iter()
            .for_each(|line| say!("{line}"));
        // A service manager with a watchdog restarts a service whose connected skin has fallen silent.
        if !service.is_skin_silent() {
            manager.keep_alive();
        }
    }
    manager.notify("STOPPING=1");
    let report = ServeReport::new(&service.counters(), service.sequences());
    if arguments.json {
        output::print_json(&report)?;
    } else {
        say!("{}", summary(&report));
    }
    Ok(ExitCode::SUCCESS)
}

fn source(arguments: &ServeArgs) -> anyhow::Result<ModelSource> {
    match (&arguments.run, &arguments.models) {
        (Some(run), None) => Ok(ModelSource::Run(run.clone())),
        (None, Some(folder)) => Ok(ModelSource::Versions(folder.clone())),
        _ => anyhow::bail!(
            "no model: name a run directory with `--run`, or a folder of versions with `--models`"
        ),
    }
}

/// Prints a channel table whose settings follow a run's training sweeps.
fn print_table(run: Option<&Path>) -> anyhow::Result<ExitCode> {
    let mut config = ServeConfig::default();
    let mut rate_hz = ASSUMED_RATE_HZ;
    if let Some(run) = run {
        config.segmenter.values = accepted_values(run)?;
        let dir = RunDir::open(run)?;
        rate_hz = dir.config()?.classifier.sample_rate_hz;
        // Sweeps of TactMat are the middle of a motion; those of other data sets are whole motions.
        if let Some(result) = dir.result()?
            && !result.origin.is_comparable_to_published()
        {
            config.segmenter.skip = FrameSpan::Frames(0);
        }
    }
    output::print(commented(&config.table("robot"), rate_hz)?)?;
    Ok(ExitCode::SUCCESS)
}

/// Serves the Prometheus metrics, unless `address` is `off`.
fn serve_metrics(address: &str, service: &Service) -> anyhow::Result<Option<WebServer>> {
    if address == "off" {
        return Ok(None);
    }
    let address: SocketAddr = address.parse().with_context(|| {
        format!("--metrics: expected an address such as 127.0.0.1:9464, found `{address}`")
    })?;
    let web = web::metrics(address, service.metrics())?;
    if !address.ip().is_loopback() {
        say!("metrics are at {}", web.link_to("/metrics"));
    }
    Ok(Some(web))
}

/// Prints the properties of the serving model and the settings that reject or delay sweeps.
///
/// - `skip`: part of a motion before the window
fn describe(service: &Service, skip: FrameSpan) {
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
            "sweeps with values outside {least} to {greatest} are rejected (`values` in the table)"
        );
    }
    let skipped = skip.frames(names.sample_rate_hz);
    if skipped > 0 {
        say!(
            "each sweep is classified from {:.2} s after its motion starts (`skip` in the table; set 0 if motions start where the \
             training sweeps start)",
            skipped as f64 / names.sample_rate_hz
        );
    }
    if service.is_rate_assumed() {
        say!(
            "warning: the sample rate of {} Hz is assumed, because the training data did not state it; train with `--rate HZ`",
            names.sample_rate_hz
        );
    }
    if !service.tells_unlike() {
        say!(
            "sweeps are not compared with the training data: the run has no likeness.safetensors, because it is of an earlier version or has too \
             few training sweeps"
        );
    }
    if !service.tells_unknown() {
        say!(
            "unknown materials are not detected: the run was trained without `--calibrate`, or there are no dropout masks"
        );
    }
}

/// Returns the counters in one line.
fn summary(report: &ServeReport) -> String {
    let counted = |number: u64, noun| counted(number as usize, noun);
    format!(
        "{}, {} lost; {} classified, {} rejected; {} missed (late, not wrong)",
        counted(report.frames, "frame"),
        report.dropped_frames,
        counted(report.sweeps, "sweep"),
        report.rejected,
        counted(report.deadline_misses, "deadline"),
    )
}
