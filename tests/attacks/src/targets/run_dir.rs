//! Foreign run directories: configuration, weights and other files.

use std::path::PathBuf;

use tactnet_data::format::Format;
use tactnet_data::twin;
use tactnet_pipeline::{
    CalibrationTarget, Classifier, Device, Program, Provenance, RunDir, Session, TrainJob,
    TrainSpec,
};

use super::Target;

const FILES: [&str; 7] = [
    "config.json",
    "weights.safetensors",
    "known.safetensors",
    "held_out.safetensors",
    "calibration.json",
    "split.json",
    "result.json",
];

/// Input: a byte that selects the file, and its content; the other files are valid.
pub(super) fn run() -> anyhow::Result<Target> {
    let place = tempfile::tempdir_in("/dev/shm")?;
    let data = place.path().join("data.h5");
    let folder: PathBuf = place.path().join("run");
    let twin = twin::small(3, 12, 60)?;
    Format::TactMat.write(&data, &twin)?;
    let recipe = place.path().join("small.toml");
    std::fs::write(
        &recipe,
        "name = \"small\"\nnetwork = { maps = [2, 3], hidden = 8, keep_probability = 0.5 }\n\
         [training]\nepochs = 1\nbatch = 12\nlearning_rate = 0.01\nmethod = { kind = \"base\" }\n",
    )?;
    let job = TrainJob::try_from(TrainSpec {
        data: data.display().to_string(),
        recipe: recipe.display().to_string(),
        calibration: Some(CalibrationTarget {
            false_alarms: 0.3,
            coverage: 0.7,
        }),
        ..TrainSpec::default()
    })?;
    let program = Program {
        provenance: Provenance::of_this_process("0", "0"),
        command: |spec| spec.data.clone(),
    };
    Session::begin(&job, Some(&folder), program, |_| Ok(()))?.train(|_| {}, || false)?;
    // The digests would refuse every change at once.
    std::fs::remove_file(folder.join("manifest.json"))?;
    let mut whole = Vec::new();
    let mut seeds = Vec::new();
    for (number, file) in (0..).zip(FILES) {
        let content = std::fs::read(folder.join(file))?;
        let mut seed = vec![number];
        seed.extend(&content);
        seeds.push(seed);
        whole.push(content);
    }
    let device = tactnet_models::Compute::Cpu.open()?;
    Ok(Target::new(seeds, move |input| {
        let _place = &place;
        let Some((number, content)) = input.split_first() else {
            return false;
        };
        let file = usize::from(*number) % FILES.len();
        let path = folder.join(FILES[file]);
        let accepted = std::fs::write(&path, content).is_ok() && opens(&folder, &device);
        std::fs::write(&path, &whole[file]).is_ok() && accepted
    }))
}

/// Files that eval, enroll, serve and the report read.
fn opens(folder: &std::path::Path, device: &Device) -> bool {
    let read = || -> anyhow::Result<()> {
        let run = RunDir::open(folder)?;
        let config = run.config()?;
        let classifier = Classifier::new(config.classifier, &run.final_weights()?, device)?;
        run.split()?;
        run.train_embeddings()?;
        run.thresholds(&classifier)?;
        run.verified_result()?;
        Ok(())
    };
    read().is_ok()
}
