//! `tactnet bench device`: times training steps and epochs on every device.

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::Args;
use serde::Serialize;
use tactnet_data::twin::{TwinConfig, generate};
use tactnet_data::{Fold, Scheme, Seed};
use tactnet_models::Compute;

use crate::commands::choices::DeviceChoice;
use crate::device_times::{self, Times};
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet bench device\n  \
    tactnet bench device --sweeps 20 --steps 400 --json     fewer and shorter sweeps\n  \
    tactnet bench device --networks 1,10,20                 1, 10 and 20 networks together on a GPU\n\n\
    The sweeps are those of the twin. The recipe is `fast`, and `thesis` for adversarial steps.")]
pub struct DeviceArgs {
    /// Number of sweeps per material; four of five are trained on
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(5..=10_000))]
    sweeps: u32,
    /// Number of materials
    #[arg(long, value_name = "N", default_value_t = 36, value_parser = clap::value_parser!(u32).range(2..=64))]
    materials: u32,
    /// Number of time steps of a sweep
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    steps: u32,
    /// Number of timed adversarial steps
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    adversarial: u32,
    /// Numbers of networks trained together on a GPU, one row each; as many steps are timed as adversarial ones
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "1,10", value_parser = clap::value_parser!(u32).range(1..=100))]
    networks: Vec<u32>,
    /// Device to time, even a software GPU [default: all except software GPUs]
    #[arg(long, value_enum)]
    device: Option<DeviceChoice>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// One measured time.
#[derive(Serialize)]
struct Row {
    /// `cpu`, `vulkan` or `cuda`.
    device: Compute,
    /// Name of the device.
    name: String,
    /// `step`, `adversarial step` or `epoch`; with several networks `stacked step` or `stacked adversarial step`.
    work: &'static str,
    /// Number of networks trained together.
    networks: u32,
    /// Time in ms: of a step (median on the processor, mean on a GPU) or of the epoch. With several networks: of a step
    /// of one network.
    ms: f64,
}

#[derive(Serialize)]
struct Report {
    schema_version: u32,
    /// Number of sweeps in a batch.
    batch: usize,
    /// Number of sweeps in an epoch.
    sweeps: usize,
    rows: Vec<Row>,
}

/// Times the devices.
pub fn run(arguments: &DeviceArgs) -> anyhow::Result<ExitCode> {
    say!("generating the twin …");
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
    let present = match arguments.device {
        None => Compute::present(),
        Some(asked) => vec![named(asked.into())?],
    };
    for (device, name) in present {
        say!("training on {name} …");
        let mut row = |work, networks, ms| {
            let name = name.clone();
            report.rows.push(Row {
                device,
                name,
                work,
                networks,
                ms,
            });
        };
        let Times { batch, step, all } = device_times::time(&fold, "fast", device, None)?;
        row("step", 1, step);
        row("epoch", 1, all);
        let steps = arguments.adversarial as usize;
        let adversarial = device_times::time(&fold, "thesis", device, Some(steps))?;
        row("adversarial step", 1, adversarial.step);
        for &networks in &arguments.networks {
            for (work, recipe) in [
                ("stacked step", "fast"),
                ("stacked adversarial step", "thesis"),
            ] {
                let sizes = (networks as usize, steps);
                if let Some(ms) = device_times::time_stack(&twin, recipe, device, sizes)? {
                    row(work, networks, ms);
                }
            }
        }
        report.batch = batch;
    }
    OutputFormat::from_flag(arguments.json).report(&report, |report| output::print(table(report)?))
}

/// Returns a device with its name.
fn named(device: Compute) -> anyhow::Result<(Compute, String)> {
    let known = Compute::present().into_iter().find(|(of, _)| *of == device);
    Ok(match known {
        Some(known) => known,
        None if device == Compute::Vulkan => (device, Compute::vulkan_adapter()?.name),
        None => (device, "GPU".to_owned()),
    })
}

fn table(report: &Report) -> Result<String, std::fmt::Error> {
    let mut text = format!(
        "{:28} {:25} {:>8} {:>10}\n",
        "device", "work", "networks", "ms"
    );
    for row in &report.rows {
        writeln!(
            text,
            "{:28} {:25} {:>8} {:>10.2}",
            row.name, row.work, row.networks, row.ms
        )?;
    }
    write!(
        text,
        "a step processes {} sweeps (with several networks: the time of one network's step); an epoch is {} sweeps in batches of at most {}",
        report.batch, report.sweeps, report.batch
    )?;
    Ok(text)
}
