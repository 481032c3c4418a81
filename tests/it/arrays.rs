//! Arrays other than 4 x 4 taxels in training, prediction and online classification, and errors for arrays that packets
//! cannot hold.

use std::f32::consts::TAU;

use tactnet_data::format::Format;
use tactnet_data::{Dataset, LabelSet, Samples, SweepRecord, SweepShape};

use crate::command::{Lab, json, messages_of, stderr, tactnet};

/// Generates three materials with ten sweeps each: waves of one, two and three periods across the array, with noise.
fn waves(rows: usize, cols: usize, steps: usize) -> Dataset {
    let shape = SweepShape { steps, rows, cols };
    let taxels = shape.taxels();
    let mut values = Vec::new();
    let mut records = Vec::new();
    for index in 0..30 {
        let (label, sweep) = (index % 3, index / 3);
        records.push(SweepRecord::new(label, sweep));
        for cell in 0..steps * taxels {
            let (step, taxel) = (cell / taxels, cell % taxels);
            let phase = step as f32 / steps as f32 + taxel as f32 / taxels as f32;
            let noise = ((index * 7919 + cell * 104_729) % 1013) as f32 / 1013.0;
            let wave = (TAU * (label + 1) as f32 * phase + sweep as f32).sin();
            values.push(20.0 + 8.0 * wave + 4.0 * noise);
        }
    }
    let labels = LabelSet::new(["one", "two", "three"].map(String::from)).unwrap();
    Dataset::new("waves", 750.0, shape, labels, records, Samples::F32(values)).unwrap()
}

const RECIPES: [(&str, &str); 2] = [
    ("maps", "maps = [8, 16]"),
    (
        "spectra",
        "spectra = { bands = 8, taxel_units = 8, units = 16 }",
    ),
];
const TRAINING: &str = "[training]\nepochs = 12\nbatch = 7\nlearning_rate = 0.005\nmethod = { kind = \"adversarial\", alpha = 0.5, epsilon = 0.1 }\n";

#[test]
fn arrays_of_other_shapes_are_learnt_and_followed_frame_by_frame() {
    let lab = Lab::new();
    for (recipe, layers) in RECIPES {
        let network = format!("[network]\n{layers}\nhidden = 16\nkeep_probability = 0.8\n");
        let text = format!("name = \"{recipe}\"\n{network}{TRAINING}");
        std::fs::write(lab.path(recipe), text).unwrap();
    }
    for (rows, cols) in [(6, 10), (1, 3), (5, 7)] {
        let data = lab.path(&format!("{rows}x{cols}.h5"));
        Format::TactMat
            .write(&data, &waves(rows, cols, 75))
            .unwrap();
        for (recipe, _) in RECIPES {
            let name = |what: &str| lab.path(&format!("{what}{rows}x{cols}{recipe}"));
            let mut train = tactnet(["train", "--json", "--data"]);
            train.arg(&data).arg("--recipe").arg(lab.path(recipe));
            train.arg("--out").arg(name("run"));
            let found = json(train);
            let accuracy = found["accuracy_one_sweep"]["mean"].as_f64().unwrap();
            // Six test sweeps of three materials; three taxels in a row see little of a wave.
            assert!(accuracy > 0.5, "{recipe}, {rows}x{cols}: {accuracy}");
            let mut eval = tactnet(["eval", "--json", "--runtime", "online"]);
            eval.arg(name("run"));
            let found = json(eval);
            let apart = found["runtimes"]["plain"]["largest_difference"].as_f64();
            assert!(apart.unwrap() < 1e-4, "{rows}x{cols}: {found}");
        }
    }
}

#[test]
fn what_packets_cannot_hold_is_said_before_training() {
    let lab = Lab::new();
    let data = lab.path("wide.h5");
    Format::TactMat.write(&data, &waves(25, 41, 4)).unwrap();
    let mut check = tactnet(["data", "check"]);
    check.arg(&data);
    let said = stderr(&check.output().unwrap());
    assert!(said.contains("1025 taxels, packets hold 1024"), "{said}");
    let mut train = tactnet(["train", "--model", "means", "--data"]);
    train.arg(&data).arg("--axes-are-right");
    train.arg("--out").arg(lab.path("run"));
    let said = messages_of(train);
    assert!(said.contains("1025 taxels, packets hold 1024"), "{said}");
}
