//! `tactnet dashboard`: a live page in the browser.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use tactnet_channel::{Bus, Domain};
use tactnet_serving::web::{self, Dashboard};
use tactnet_skin::ServeConfig;

use super::choices::listen;
use crate::output;
use crate::stop::Stop;
use crate::table;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet dashboard --table robot.toml                            http://127.0.0.1:8750\n  \
    tactnet dashboard --table robot.toml --listen 0.0.0.0:8750      for everybody in the network who has the link that is printed\n\n\
    Beyond this machine the page and its events need a token: that of $TACTNET_WEB_TOKEN, or one that is drawn and stands in the link.")]
pub struct DashboardArgs {
    /// The table of channels; `tactnet serve --print-table` prints one
    #[arg(long, value_name = "FILE")]
    table: PathBuf,
    /// Where to answer browsers
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8750", value_parser = listen)]
    listen: SocketAddr,
}

/// Runs the command.
pub fn run(arguments: &DashboardArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let listener = web::listen(arguments.listen)?;
    let table = table::load(&arguments.table)?;
    let config = ServeConfig::of(&table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let mut dashboard = Dashboard::open(&bus, &config, listener)?;
    #[cfg(feature = "catching")]
    if tactnet_catching_roles::StageView::is_on(&table) {
        dashboard.show_stage(super::stage_source::stage_source(&bus)?);
    }
    say!("open {} in a browser; Ctrl-C ends", dashboard.link());
    output::print(format_args!("ready"))?;
    while !stop.asked() {
        dashboard.step()?;
    }
    Ok(ExitCode::SUCCESS)
}
