//! `tactnet demo`: hub, simulated skin, classifier and dashboard.

#[cfg(feature = "catching")]
mod catching_demo;

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use tactnet_data::DataSource;
use tactnet_pipeline::LabelOrder;
use tactnet_serving::web;
use tactnet_simulation::{Demo, SMALL_MATERIALS, SMALL_SWEEPS, make_twin, train_small_network};

use super::choices::{listen, rate};
use super::network_run::{NetworkUse, network_run};
use super::simulate::check_fit;
use super::simulate::fault::FaultArgs;
use crate::stop::Stop;
use crate::{output, source};

/// Number of materials of the full twin.
const ALL_MATERIALS: usize = 36;
/// Number of untrained materials that the demo's skin plays in addition.
const UNTAUGHT: usize = 2;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet demo                                     trains a small network first (half a minute)\n  \
    tactnet demo --run runs/own                      your network, on the held-out sweeps of its data set\n  \
    tactnet demo --run runs/own --data tuesday.h5    on other sweeps\n  \
    tactnet demo --taxel-order transposed            a skin that is unlike the one of the training data\n  \
    tactnet demo --catching                          a robot catches balls and classifies their material\n  \
    tactnet demo --listen 0.0.0.0:8750               a page that other machines can open")]
pub struct DemoArgs {
    /// Run directory of a trained network [default: train a small one on the twin]
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
    /// Data set of the played sweeps [default: the held-out sweeps of the run's data set]
    #[arg(long, value_name = "FILE|twin", requires = "run")]
    data: Option<String>,
    /// Sample rate, in Hz; takes precedence over that of the data [default: the run's setting]
    #[arg(long, value_name = "HZ", value_parser = rate, requires = "run")]
    rate: Option<f64>,
    /// Also run a robot that catches balls and classifies their material
    #[arg(long, conflicts_with_all = ["rate", "taxel_order", "gain", "dead"])]
    catching: bool,
    /// Address of the page: an address with a port, or a port on this machine
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8750", value_parser = listen)]
    listen: SocketAddr,
    #[command(flatten)]
    fault: FaultArgs,
}

/// Runs the demo until Ctrl-C.
pub fn run(arguments: &DemoArgs) -> anyhow::Result<ExitCode> {
    #[cfg(not(feature = "catching"))]
    if arguments.catching {
        anyhow::bail!(tactnet_models::MissingFeature {
            feature: "catching"
        });
    }
    let stop = Stop::listen_saying("stopping")?;
    // Before training: a port in use is an error at once.
    let listener = web::listen(arguments.listen)?;
    let folder = tempfile::Builder::new().prefix("tactnet-demo-").tempdir()?;
    let program = std::env::current_exe()?;
    let (run, sweeps) = network_and_sweeps(arguments, &program, folder.path())?;
    if stop.asked() {
        return Ok(ExitCode::SUCCESS);
    }
    #[cfg(feature = "catching")]
    if arguments.catching {
        return catching_demo::run(&program, folder.path(), &run, &sweeps, listener, &stop);
    }
    let rate = arguments.rate.map(|rate| format!("--rate={rate}"));
    let words = [rate.into_iter().collect(), arguments.fault.words()].concat();
    let mut demo = Demo::start(&program, folder.path(), &run, &sweeps, &words, listener)?;
    say!(
        "a simulated fingertip sweeps over one object after the other, up to three sweeps each; open {} in a browser; Ctrl-C ends",
        demo.link()
    );
    if let Some(cycle) = demo.cycle() {
        say!("{cycle}");
    }
    say!(
        "to print the predictions: `tactnet channel echo tactile/belief --table {}`",
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

/// Returns the run directory to serve and the file of the sweeps to play; trains a small network if the arguments name no run.
fn network_and_sweeps(
    arguments: &DemoArgs,
    program: &Path,
    folder: &Path,
) -> anyhow::Result<(PathBuf, PathBuf)> {
    let made = folder.join("sweeps.h5");
    match &arguments.run {
        Some(run) => {
            let opened = network_run(run, NetworkUse::Serve)?;
            let config = opened.config()?;
            if arguments.data.is_none() {
                for added in opened.enrolled()? {
                    say!(
                        "note: `{}` was enrolled from other data; add `--data FILE` to play its sweeps",
                        added.material
                    );
                }
            }
            let data = config.spec.place_of_data(arguments.data.as_deref())?;
            let sweeps = match DataSource::named(data) {
                DataSource::Twin(_) => {
                    make_twin(program, &made, ALL_MATERIALS, SMALL_SWEEPS)?;
                    made
                }
                DataSource::File(path) => {
                    // The skin process reads the file again, but its messages do not reach the terminal.
                    let mut spec = config.spec.clone();
                    spec.name_rate_of(data, arguments.rate);
                    let read = source::load_as(&spec, data, LabelOrder::True)
                        .map_err(|error| source::in_file(data, arguments.rate, error.into()))?;
                    source::warn_of_findings(read.reading_findings());
                    check_fit(&read, data, &config.classifier)?;
                    path
                }
            };
            Ok((run.clone(), sweeps))
        }
        None => {
            say!("training a small network on {SMALL_MATERIALS} materials of the twin …");
            let run = train_small_network(program, folder)?;
            make_twin(program, &made, SMALL_MATERIALS + UNTAUGHT, SMALL_SWEEPS)?;
            Ok((run, made))
        }
    }
}
