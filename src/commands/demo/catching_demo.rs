//! `tactnet demo --catching`: the robot catches and explores balls, and a web page shows robot and beliefs.

use std::net::TcpListener;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::bail;
use tactnet_catching_roles::RoleSettings;
use tactnet_catching_stage::{CatchRun, Feel, StageError, WorldSettings};
use tactnet_channel::{Bus, Domain, Hub, TemporaryBus, temporary_bus_name};
use tactnet_serving::web::Dashboard;
use tactnet_skin::ServeConfig;

use crate::commands::catch::{SkinSettings, felt_materials, show_event};
use crate::commands::stage_source::stage_source;
use crate::stop::Stop;
use crate::{GIT, output, table};

/// - `run`: run directory of the network
/// - `sweeps`: data set with the sweeps of the balls
pub fn run(
    program: &Path,
    folder: &Path,
    run: &Path,
    sweeps: &Path,
    listener: TcpListener,
    stop: &Stop,
) -> anyhow::Result<ExitCode> {
    let materials = felt_materials(run)?;
    let world = WorldSettings {
        materials: materials.clone(),
        ..WorldSettings::default()
    };
    let skin = SkinSettings {
        run: run.into(),
        data: sweeps.display().to_string(),
        materials,
        seed: world.seed,
    };
    let catch = CatchRun {
        program,
        folder,
        stack: RoleSettings::default(),
        world,
        feel: Some(Feel {
            run,
            skin: serde_json::to_string(&skin)?,
        }),
        throws: None,
        seconds: None,
        record: None,
        git: GIT,
        priority: None,
    };
    let config = ServeConfig::default();
    let channels = catch.channels(config.table(&temporary_bus_name("demo")))?;
    let path = folder.join("robot.toml");
    std::fs::write(&path, channels.to_toml())?;
    let _own = TemporaryBus(&channels);
    let hub = Hub::spawn(&channels)?;
    let bus = Bus::open(Domain::Host, &table::load(&path)?)?;
    let mut page = Dashboard::open(&bus, &config, listener)?;
    page.show_stage(stage_source(&bus)?);
    let over = AtomicBool::new(false);
    let ran = std::thread::scope(|scope| {
        let catching = scope.spawn(|| {
            let stopped = || over.load(Ordering::Relaxed);
            catch.run_on(&channels, &path, &mut show_event, &stopped)
        });
        let shown = show(&mut page, stop, &path, &|| catching.is_finished());
        over.store(true, Ordering::Relaxed);
        let caught = catching
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        shown.and(ended(caught, stop))
    });
    drop(page);
    drop(hub);
    ran.map(|()| ExitCode::SUCCESS)
}

fn show(
    page: &mut Dashboard,
    stop: &Stop,
    table: &Path,
    ended: &dyn Fn() -> bool,
) -> anyhow::Result<()> {
    say!(
        "a robot catches balls and determines their materials; open {} in a browser; Ctrl-C ends the demo",
        page.link()
    );
    say!(
        "its channels: `tactnet channel echo catch/outcome --table {}`",
        table.display()
    );
    output::print(format_args!("ready"))?;
    while !stop.asked() && !ended() {
        page.step()?;
    }
    Ok(())
}

fn ended<T>(caught: Result<T, StageError>, stop: &Stop) -> anyhow::Result<()> {
    caught?;
    if !stop.asked() {
        bail!("the catching stack ended unexpectedly");
    }
    Ok(())
}
