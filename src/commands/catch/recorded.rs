//! `tactnet catch timing` and `tactnet catch replay`: analysis of a recording of the stack.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use tactnet_catching_roles::Milliseconds;
use tactnet_catching_stage::recorded::{Compared, Timing, replay, timing};
use tactnet_recording::Recording;

use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet catch run --throws 20 --record run.mcap         makes a recording; so does `tactnet record --table robot.toml`\n  \
    tactnet catch timing run.mcap                           from every exposure to its path, step by step\n  \
    tactnet catch timing run.mcap --picture timing.svg      the same as a picture, after figure 3.2 of the thesis")]
pub struct TimingArgs {
    /// Recording
    #[arg(value_name = "FILE.mcap")]
    recording: PathBuf,
    /// Draw the steps to this file
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

pub fn run_timing(arguments: &TimingArgs) -> anyhow::Result<ExitCode> {
    let timing = timing(&read(&arguments.recording)?)?;
    if let Some(path) = &arguments.picture {
        std::fs::write(path, timing.picture()).with_context(|| path.display().to_string())?;
        say!("{}", path.display());
    }
    OutputFormat::from_flag(arguments.json).report(&timing, print)
}

fn print(timing: &Timing) -> anyhow::Result<()> {
    output::print(format_args!(
        "{:.0} s, {} paths that follow from a picture{}",
        timing.seconds,
        timing.paths,
        match timing.incomplete {
            0 => String::new(),
            some => format!(", {some} more without every packet before them"),
        }
    ))?;
    output::print(format_args!(
        "{:<15} {:<17} {:>9} {:>9} {:>12} {:>9}",
        "ms", "", "takes", "99 %", "after expos.", "99 %"
    ))?;
    for step in &timing.steps {
        output::print(format_args!(
            "{:<15} {:<17} {:>9.2} {:>9.2} {:>12.1} {:>9.1}",
            step.name,
            step.process,
            step.takes_ms.p50,
            step.takes_ms.p99,
            step.ends_ms.p50,
            step.ends_ms.p99
        ))?;
    }
    let rows = [
        ("exposure to path", timing.exposure_to_path_ms),
        (
            "age of the last picture at a catch",
            timing.last_picture_age_ms,
        ),
        (
            "age of the last pose of the head at a catch",
            timing.last_measurement_age_ms,
        ),
        ("beat of 1 kHz to its command", timing.beat_to_command_ms),
        ("joint state to joint state", timing.joint_period_ms),
        ("inertial unit to pose", timing.imu_to_pose_ms),
        (
            "command to the monitor's word",
            timing.command_to_monitor_ms,
        ),
    ];
    for (name, times) in rows {
        if let Some(Milliseconds {
            p50,
            p99,
            p999,
            max,
            ..
        }) = times
        {
            output::print(format_args!(
                "{name}: {p50:.2} ms, 99 % below {p99:.2}, 99.9 % below {p999:.2}, longest {max:.1}"
            ))?;
        }
    }
    Ok(())
}

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet catch replay run.mcap          do tracker, coordinator and planners answer the same again, bit by bit?\n\n\
    Ends with 1 where they do not. Plans that ran out of time are not compared: how far they come depends on the machine.")]
pub struct ReplayArgs {
    /// Recording
    #[arg(value_name = "FILE.mcap")]
    recording: PathBuf,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

pub fn run_replay(arguments: &ReplayArgs) -> anyhow::Result<ExitCode> {
    let replayed = replay(&read(&arguments.recording)?)?;
    if arguments.json {
        output::print_json(&replayed)?;
    } else {
        let line = |what: &str, compared: Compared| {
            let Compared {
                answers,
                same,
                out_of_time,
                alone,
            } = compared;
            let mut line = format!("{same} of {answers} {what} are the same, bit by bit");
            if out_of_time > 0 {
                line += &format!("; {out_of_time} had run out of time");
            }
            if alone > 0 {
                line += &format!("; {alone} on one side only");
            }
            line
        };
        output::print(line("plans", replayed.plans))?;
        output::print(line("predictions", replayed.predictions))?;
        output::print(line("decisions", replayed.decisions))?;
    }
    let compared = [replayed.plans, replayed.predictions, replayed.decisions];
    Ok(if compared.iter().any(|of| of.same < of.answers) {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    })
}

fn read(path: &std::path::Path) -> anyhow::Result<Recording> {
    let recording = Recording::read(path)?;
    if let Some(why) = &recording.cut {
        say!("{}: read as far as it goes: {why}", path.display());
    }
    Ok(recording)
}
