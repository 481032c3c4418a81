//! `tactnet bench device`: training steps and epochs on every device.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::Args;
use serde::Serialize;
use tactnet_data::twin::{TwinConfig, generate};
use tactnet_data::{Fold, Scheme, Seed};
use tactnet_models::Compute;

use crate::device_times::{self, Times};
use crate::output;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet bench device\n  \
    tactnet bench device --sweeps 20 --steps 400 --json     smaller sweeps, and fewer\n\n\
    Sweeps are the twin's; the network is the recipe `fast`, and the recipe `thesis` for adversarial steps.")]
pub struct DeviceArgs {
    /// Sweeps of each material; four of five are trained on
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(5..=10_000))]
    sweeps: u32,
    /// Materials
    #[arg(long, value_name = "N", default_value_t = 36, value_parser = clap::value_parser!(u32).range(2..=64))]
    materials: u32,
    /// Steps of a sweep
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    steps: u32,
    /// Timed adversarial steps
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    adversarial: u32,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// One time.
#[derive(Serialize)]
struct Row {
    /// `cpu`, `vulkan` or `cuda`.
    device: Compute,
    /// What the device calls itself.
    name: String,
    /// `step`, `adversarial step` or `epoch`.
    work: &'static str,
    /// Milliseconds: a step (the median on the processor, the mean on a GPU), or the one epoch.
    ms: f64,
}

#[derive(Serialize)]
struct Report {
    schema_version: u32,
    /// Sweeps of a batch.
    batch: usize,
    /// Sweeps of an epoch.
    sweeps: usize,
    rows: Vec<Row>,
}

/// Runs the command.
pub fn run(arguments: &DeviceArgs) -> anyhow::Result<ExitCode> {
    say!("making sweeps of the twin …");
    let twin = generate(&TwinConfig {
        materials: arguments.materials as usize,
        sweeps: arguments.sweeps as usize,
        steps: arguments.steps as usize,
        ..TwinConfig::default()
    })?;
    let fold = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0)?;
    let mut report = Report {
        schema_version: 1,
        batch: 0,
        sweeps: fold.train.len(),
        rows: Vec::new(),
    };
    for (device, name) in Compute::present() {
        say!("training on {name} …");
        let mut row = |work, ms| {
            let name = name.clone();
            report.rows.push(Row {
                device,
                name,
                work,
                ms,
            });
        };
        let Times { batch, step, all } = device_times::time(&fold, "fast", device, None)?;
        row("step", step);
        row("epoch", all);
        let limit = Some(arguments.adversarial as usize);
        let adversarial = device_times::time(&fold, "thesis", device, limit)?;
        row("adversarial step", adversarial.step);
        report.batch = batch;
    }
    if arguments.json {
        output::print_json(&report)?;
    } else {
        output::print(table(&report)?)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn table(report: &Report) -> Result<String, std::fmt::Error> {
    let mut text = format!("{:28} {:18} {:>10}\n", "device", "work", "ms");
    for row in &report.rows {
        writeln!(text, "{:28} {:18} {:>10.2}", row.name, row.work, row.ms)?;
    }
    write!(
        text,
        "a step takes {} sweeps; an epoch is {} sweeps in batches of {} at most",
        report.batch, report.sweeps, report.batch
    )?;
    Ok(text)
}
