//! Sweeps of a data set, one after the other.

use tactnet_data::{Dataset, known_names};

use super::{Play, Scene, Stretch, Target, TimeOrigin};
use crate::RecordingError;

/// Pause between two sweeps, in s.
const PAUSE: f64 = 0.25;
/// Name of the skin in the viewer.
const SKIN: &str = "skin";

/// Shows sweeps in the given order, and waits until the viewer has received all of them.
///
/// - `sweeps`: indices in the data set
///
/// # Errors
/// No viewer can be reached; the file exists.
pub fn show_sweeps(
    dataset: &Dataset,
    sweeps: &[usize],
    target: &Target,
) -> Result<(), RecordingError> {
    let mut scene = Scene::open(
        target,
        dataset.name(),
        &[SKIN],
        TimeOrigin::Begin,
        Play::FromBeginning,
    )?;
    let shape = dataset.shape();
    scene.set_shape(shape.rows, shape.cols);
    let step_ns = 1e9 / dataset.sample_rate_hz();
    let mut begin_ns = 0.0;
    for &sweep in sweeps {
        scene.say(begin_ns as i64, &dataset.describe(sweep))?;
        let steps = dataset.steps_of(sweep);
        let time_ns = |step: usize| (begin_ns + step as f64 * step_ns).round() as i64;
        scene.show_stretch(
            0,
            Stretch {
                times_ns: (0..steps).map(time_ns).collect(),
                sequences: (0..steps as i64).collect(),
                digits: dataset.sweep(sweep),
            },
        )?;
        begin_ns += steps as f64 * step_ns + PAUSE * 1e9;
    }
    scene.finish()
}

/// Returns the indices of the first `sweeps` sweeps of each material, material by material.
///
/// - `materials`: names; if empty, all materials
///
/// # Errors
/// The data set lacks a material.
pub fn first_sweeps(
    dataset: &Dataset,
    materials: &[String],
    sweeps: usize,
) -> Result<Vec<usize>, RecordingError> {
    let labels: Vec<usize> = if materials.is_empty() {
        (0..dataset.labels().len()).collect()
    } else {
        let number = |name: &String| {
            let found = dataset.labels().names().position(|known| known == name);
            found.ok_or_else(|| RecordingError::NoMaterial {
                material: name.clone(),
                known: known_names(name, dataset.labels().names()),
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
