//! `tactnet demo`: hub, simulated skin, classifier and dashboard together, for a first look.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use tactnet_pipeline::RunDir;
use tactnet_rehearsal::{Demo, SMALL_MATERIALS, train_small_network};

use crate::output;
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
        Some(run) => {
            RunDir::open(run)?.config()?;
            (run.clone(), 36)
        }
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
    let mut demo = Demo::start(&program, folder.path(), &run, materials, arguments.listen)?;
    eprintln!(
        "a simulated fingertip sweeps over {materials} materials; open http://{} in a browser; Ctrl-C ends",
        arguments.listen
    );
    output::print(format_args!("ready"))?;
    while !stop.asked() {
        std::thread::sleep(Duration::from_millis(50));
        demo.check()?;
    }
    demo.end()?;
    Ok(ExitCode::SUCCESS)
}
