//! `tactnet demo`: hub, simulated skin, classifier and dashboard together, for a first look.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::bail;
use clap::Args;
use tactnet_rehearsal::{
    ChildProcess, OwnBus, SMALL_MATERIALS, SMALL_SWEEPS, make_twin, train_small_network,
};
use tactnet_skin::ServeConfig;

use crate::stop::Stop;

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
    let program = std::env::current_exe()?;
    let (run, materials) = match &arguments.run {
        Some(run) => (run.clone(), 36),
        None => {
            eprintln!("training a small network on {SMALL_MATERIALS} materials of the twin …");
            let run = train_small_network(&program, folder.path())?;
            // The skin touches two more, which are unknown to the network.
            (run, SMALL_MATERIALS + 2)
        }
    };
    if stop.asked() {
        return Ok(ExitCode::SUCCESS);
    }
    let sweeps = folder.path().join("sweeps.h5");
    make_twin(&program, &sweeps, materials, SMALL_SWEEPS)?;
    let table = ServeConfig::default().table(&format!("demo{}", std::process::id()));
    let path = folder.path().join("robot.toml");
    std::fs::write(&path, toml::to_string(&table)?)?;
    let (run, sweeps) = (run.display().to_string(), sweeps.display().to_string());
    let listen = arguments.listen.to_string();
    let _own = OwnBus(&table);
    let mut processes = Vec::new();
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
        processes.push(ChildProcess::start(&program, name, &command, &path)?);
    }
    eprintln!(
        "a simulated fingertip sweeps over {materials} materials; open http://{listen} in a browser; Ctrl-C ends"
    );
    crate::output::print(format_args!("ready"))?;
    while !stop.asked() {
        std::thread::sleep(Duration::from_millis(50));
        for process in &mut processes {
            if let Some(status) = process.ended()? {
                bail!("the {} ended: {status}", process.name());
            }
        }
    }
    // The hub last.
    while let Some(process) = processes.pop() {
        process.end()?;
    }
    Ok(ExitCode::SUCCESS)
}
