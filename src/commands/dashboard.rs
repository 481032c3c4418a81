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
    tactnet dashboard --table robot.toml --listen 0.0.0.0:8750      for other machines, with the printed link\n\n\
    Other machines need a token: the value of $TACTNET_WEB_TOKEN, or a random one that is part of the printed link.")]
pub struct DashboardArgs {
    /// Channel table; `tactnet serve --print-table` prints one
    #[arg(long, value_name = "FILE")]
    table: PathBuf,
    /// Address of the page: an address with a port, or a port on this machine
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8750", value_parser = listen)]
    listen: SocketAddr,
}

/// Serves the page until Ctrl-C.
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
