//! `tactnet demo`: hub, simulated skin, classifier and dashboard together, for a first look.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Args;
use tactnet_skin::ServeConfig;

use crate::child_process::{ChildProcess, OwnBus};
use crate::stop::Stop;

/// Materials of the small network; the simulated skin touches two more, which are unknown to it.
const MATERIALS: usize = 12;
/// Sweeps of each, a fifth of which the network does not learn from.
pub(crate) const SWEEPS: usize = 40;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet demo                                     trains a small network first, half a minute\n  \
    tactnet demo --run runs/twin-fast-fold0-1        with a trained one\n  \
    tactnet demo --listen 0.0.0.0:8750               to look from another machine")]
pub struct DemoArgs {
    /// Run directory of a network trained on the twin [default: a small one is trained]
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
    /// Where to answer browsers
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8750")]
    listen: SocketAddr,
}

/// Runs the command.
pub fn run(arguments: &DemoArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let folder = tempfile::tempdir()?;
    let (run, materials) = match &arguments.run {
        Some(run) => (run.clone(), 36),
        None => (small_network(folder.path())?, MATERIALS + 2),
    };
    if stop.asked() {
        return Ok(ExitCode::SUCCESS);
    }
    let sweeps = folder.path().join("sweeps.h5");
    twin(&sweeps, materials, SWEEPS)?;
    let table = ServeConfig::default().table(&format!("demo{}", std::process::id()));
    let path = folder.path().join("robot.toml");
    std::fs::write(&path, toml::to_string(&table)?)?;
    let (run, sweeps) = (run.display().to_string(), sweeps.display().to_string());
    let listen = arguments.listen.to_string();
    let _own = OwnBus(&table);
    let mut parts = Vec::new();
    for (name, command) in [
        ("hub", vec!["channel", "hub", "--table"]),
        (
            "classifier",
            vec!["serve", "--metrics", "off", "--run", &run, "--table"],
        ),
        (
            "dashboard",
            vec!["dashboard", "--listen", &listen, "--table"],
        ),
        (
            "skin",
            vec![
                "simulate",
                "skin",
                "--data",
                &sweeps,
                "--unseen-by",
                &run,
                "--table",
            ],
        ),
    ] {
        parts.push(ChildProcess::start(name, &command, &path)?);
    }
    eprintln!(
        "a simulated fingertip sweeps over {materials} materials; open http://{listen} in a browser; Ctrl-C ends"
    );
    crate::output::print(format_args!("ready"))?;
    while !stop.asked() {
        std::thread::sleep(Duration::from_millis(50));
        for part in &mut parts {
            if let Some(status) = part.ended()? {
                bail!("the {} ended: {status}", part.name());
            }
        }
    }
    // The hub last.
    while let Some(part) = parts.pop() {
        part.end()?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Trains a network on a small twin, for people who have none yet.
pub(crate) fn small_network(folder: &Path) -> anyhow::Result<PathBuf> {
    eprintln!("training a small network on {MATERIALS} materials of the twin …");
    let data = folder.join("small.h5");
    twin(&data, MATERIALS, SWEEPS)?;
    let run = folder.join("small");
    let mut train = tactnet();
    train.args(["train", "--calibrate", "--epochs", "12", "--data"]);
    train.arg(&data).arg("--out").arg(&run);
    finish(train, "the training")?;
    Ok(run)
}

fn twin(path: &Path, materials: usize, sweeps: usize) -> anyhow::Result<()> {
    let mut make = tactnet();
    make.args(["data", "twin", "--materials", &materials.to_string()]);
    make.args(["--sweeps", &sweeps.to_string(), "--out"]);
    make.arg(path);
    finish(make, "making the twin")
}

fn tactnet() -> Command {
    Command::new(std::env::current_exe().unwrap_or_else(|_| "tactnet".into()))
}

fn finish(mut command: Command, what: &str) -> anyhow::Result<()> {
    let output = command
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("cannot start {what}"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        bail!(
            "{what} failed: {}",
            said.trim().lines().last().unwrap_or("no word")
        );
    }
    Ok(())
}
