//! `tactnet demo`: hub, simulated skin, classifier and dashboard together, for a first look.

#[cfg(feature = "catching")]
mod catching_demo;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use tactnet_data::DataSource;
use tactnet_pipeline::{LabelOrder, RunDir};
use tactnet_serving::web;
use tactnet_simulation::{Demo, SMALL_MATERIALS, SMALL_SWEEPS, make_twin, train_small_network};

use super::choices::{listen, rate};
use super::simulate::check_fit;
use crate::stop::Stop;
use crate::{output, source};

/// Materials of the whole twin.
const ALL_MATERIALS: usize = 36;
/// Materials that the small network was not taught and that the skin touches too.
const UNTAUGHT: usize = 2;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet demo                                     trains a small network first, half a minute\n  \
    tactnet demo --run runs/own                      your network, on sweeps of its data that it was not trained on\n  \
    tactnet demo --run runs/own --data tuesday.h5    on other sweeps\n  \
    tactnet demo --catching                          a robot catches balls, and feels of what each is
  \
    tactnet demo --listen 0.0.0.0:8750               to look from another machine")]
pub struct DemoArgs {
    /// Run directory of a trained network [default: a small one is trained on the twin]
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
    /// Whose sweeps the fingertip makes [default: those of the run's data that it was not trained on]
    #[arg(long, value_name = "FILE|twin", requires = "run")]
    data: Option<String>,
    /// Frames per second, for data that does not say [default: what the run was given]
    #[arg(long, value_name = "HZ", value_parser = rate, requires = "run")]
    rate: Option<f64>,
    /// A robot catches balls and feels what they are made of, beside the page
    #[arg(long, conflicts_with = "rate")]
    catching: bool,
    /// Where to answer browsers
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8750", value_parser = listen)]
    listen: SocketAddr,
}

/// Runs the command.
pub fn run(arguments: &DemoArgs) -> anyhow::Result<ExitCode> {
    #[cfg(not(feature = "catching"))]
    if arguments.catching {
        anyhow::bail!(tactnet_models::left_out("catching"));
    }
    let stop = Stop::listen_saying("stopping")?;
    // Before anything is trained: a port that is taken is said at once.
    let listener = web::listen(arguments.listen)?;
    let folder = tempfile::Builder::new().prefix("tactnet-demo-").tempdir()?;
    let program = std::env::current_exe()?;
    let made = folder.path().join("sweeps.h5");
    let (run, sweeps) = match &arguments.run {
        Some(run) => {
            let opened = RunDir::open(run)?;
            let config = opened.config()?;
            config.require_network(run, "be served")?;
            if arguments.data.is_none() {
                for added in opened.enrolled()? {
                    say!(
                        "note: `{}` was enrolled from other data; `--data FILE` plays sweeps of it",
                        added.material
                    );
                }
            }
            let data = config.spec.place_of_data(arguments.data.as_deref())?;
            let sweeps = match DataSource::named(data) {
                DataSource::Twin(_) => {
                    make_twin(&program, &made, ALL_MATERIALS, SMALL_SWEEPS)?;
                    made
                }
                DataSource::File(path) => {
                    // The skin reads it again; what it would say does not reach the terminal.
                    let mut spec = config.spec.clone();
                    spec.rate_hz = arguments.rate.or(spec.rate_hz);
                    let read = source::load_as(&spec, data, LabelOrder::True)
                        .map_err(|error| source::in_file(data, arguments.rate, error.into()))?;
                    check_fit(&read, data, &config.classifier)?;
                    path
                }
            };
            (run.clone(), sweeps)
        }
        None => {
            say!("training a small network on {SMALL_MATERIALS} materials of the twin …");
            let run = train_small_network(&program, folder.path())?;
            make_twin(&program, &made, SMALL_MATERIALS + UNTAUGHT, SMALL_SWEEPS)?;
            (run, made)
        }
    };
    if stop.asked() {
        return Ok(ExitCode::SUCCESS);
    }
    #[cfg(feature = "catching")]
    if arguments.catching {
        return catching_demo::run(&program, folder.path(), &run, &sweeps, listener, &stop);
    }
    let mut demo = Demo::start(
        &program,
        folder.path(),
        &run,
        &sweeps,
        arguments.rate,
        listener,
    )?;
    say!(
        "a simulated fingertip feels one object after the other, three sweeps each where there are as many; open {} in a browser; Ctrl-C ends",
        demo.link()
    );
    if let Some(cycle) = demo.cycle() {
        say!("{cycle}");
    }
    say!(
        "its channels: `tactnet channel echo tactile/belief --table {}`",
        demo.table().display()
    );
    output::print(format_args!("ready"))?;
    while !stop.asked() {
        for line in demo.step()? {
            output::print(line)?;
        }
    }
    demo.end()?;
    Ok(ExitCode::SUCCESS)
}
