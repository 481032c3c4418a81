//! `tactnet data view`: shows the sweeps of a data set in the viewer.

use std::process::ExitCode;

use anyhow::bail;
use serde::Serialize;
use tactnet_recording::view::{first_sweeps, show_sweeps};

use super::SweepsArgs;
use crate::{output, source};

/// Document of `--json`.
#[derive(Serialize)]
struct Viewed {
    schema_version: u32,
    materials: usize,
    sweeps: usize,
    frames: usize,
}

/// Shows the sweeps.
pub fn run(arguments: &SweepsArgs) -> anyhow::Result<ExitCode> {
    if arguments.sweeps == 0 {
        bail!("--sweeps: expected at least 1, found 0");
    }
    let dataset = source::load(&arguments.data)?;
    let chosen = first_sweeps(&dataset, &arguments.material, arguments.sweeps)?;
    show_sweeps(&dataset, &chosen, &arguments.target.target())?;
    let mut materials: Vec<usize> = chosen.iter().map(|&s| dataset.records()[s].label).collect();
    materials.dedup();
    let viewed = Viewed {
        schema_version: 1,
        materials: materials.len(),
        sweeps: chosen.len(),
        frames: chosen.iter().map(|&s| dataset.steps_of(s)).sum(),
    };
    if arguments.target.json {
        output::print_json(&viewed)?;
    } else {
        let what = format!("{} sweeps of {} materials", viewed.sweeps, viewed.materials);
        output::print(arguments.target.describe(&what))?;
    }
    Ok(ExitCode::SUCCESS)
}
