//! `tactnet data view`: the sweeps of a data set, one after the other.

use std::process::ExitCode;

use anyhow::bail;
use serde::Serialize;
use tactnet_data::Dataset;
use tactnet_recording::view::{Play, Scene, Stretch, TimeOrigin};

use super::SweepsArgs;
use crate::{output, source};

/// Between two sweeps, s.
const PAUSE: f64 = 0.25;
/// What the viewer calls the skin.
const SKIN: &str = "skin";

/// What `--json` prints.
#[derive(Serialize)]
struct Viewed {
    schema_version: u32,
    materials: usize,
    sweeps: usize,
    frames: usize,
}

/// Runs the command.
pub fn run(arguments: &SweepsArgs) -> anyhow::Result<ExitCode> {
    let dataset = source::load(&arguments.data)?;
    let chosen = chosen(&dataset, &arguments.material, arguments.sweeps)?;
    let target = arguments.target.target();
    let mut scene = Scene::open(
        &target,
        dataset.name(),
        &[SKIN],
        TimeOrigin::Begin,
        Play::FromBeginning,
    )?;
    let shape = dataset.shape();
    scene.set_shape(shape.rows, shape.cols);
    let step_ns = 1e9 / dataset.sample_rate_hz();
    let mut begin_ns = 0.0;
    for &sweep in &chosen {
        scene.say(begin_ns as i64, &dataset.describe(sweep))?;
        let time_ns = |step: usize| (begin_ns + step as f64 * step_ns).round() as i64;
        scene.show_stretch(
            0,
            Stretch {
                times_ns: (0..shape.steps).map(time_ns).collect(),
                sequences: (0..shape.steps as i64).collect(),
                digits: dataset.sweep(sweep),
            },
        )?;
        begin_ns += shape.steps as f64 * step_ns + PAUSE * 1e9;
    }
    scene.finish()?;
    let mut materials: Vec<usize> = chosen.iter().map(|&s| dataset.records()[s].label).collect();
    materials.dedup();
    let viewed = Viewed {
        schema_version: 1,
        materials: materials.len(),
        sweeps: chosen.len(),
        frames: chosen.len() * shape.steps,
    };
    if arguments.target.json {
        output::print_json(&viewed)?;
    } else {
        let what = format!("{} sweeps of {} materials", viewed.sweeps, viewed.materials);
        output::print(arguments.target.told(&what))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Numbers of the first sweeps of each material, material by material.
fn chosen(dataset: &Dataset, materials: &[String], sweeps: usize) -> anyhow::Result<Vec<usize>> {
    if sweeps == 0 {
        bail!("--sweeps: expected at least 1, found 0");
    }
    let labels: Vec<usize> = if materials.is_empty() {
        (0..dataset.labels().len()).collect()
    } else {
        let number = |name: &String| {
            let found = dataset.labels().names().position(|known| known == name);
            found.ok_or_else(|| {
                let known: Vec<&str> = dataset.labels().names().collect();
                anyhow::anyhow!(
                    "--material: no `{name}` in this data set; it has {}",
                    known.join(", ")
                )
            })
        };
        materials.iter().map(number).collect::<Result<_, _>>()?
    };
    let of = |label: usize| {
        let records = dataset.records().iter().enumerate();
        records
            .filter(move |(_, record)| record.label == label)
            .map(|(sweep, _)| sweep)
            .take(sweeps)
    };
    Ok(labels.into_iter().flat_map(of).collect())
}
