//! `tactnet adapt` with the real binary: the run that it makes works everywhere, and says what it was made from.

use std::process::Command;

use tactnet_data::format::{Format, read};
use tactnet_data::{Dataset, Samples, SweepView};
use tactnet_models::Weights;

use crate::command::{Lab, RecipeChange, assert_says, expect, json, stderr, stdout};

fn adapt(lab: &Lab, run: &str, out: &str, more: &[&str]) -> Command {
    let mut command = lab.command(&format!("adapt @{run} --out @{out}"));
    for word in more {
        match word.strip_suffix(".npz") {
            Some(_) => command.arg(lab.path(word)),
            None => command.arg(word),
        };
    }
    command
}

/// Writes the sweeps of `from` as a skin with gain 2 and an offset of 30 digits feels them; returns the number of sweeps.
fn write_other_skin(lab: &Lab, from: &str, to: &str, keep: impl Fn(usize) -> bool) -> usize {
    let own = read(&lab.path(from)).unwrap();
    let indices: Vec<usize> = (0..own.len())
        .filter(|index| keep(own.records()[*index].label))
        .collect();
    let mut values = vec![0.0; indices.len() * own.shape().values()];
    let view = SweepView::new(&own, indices.clone());
    let all: Vec<usize> = (0..indices.len()).collect();
    view.copy_batch(&all, &mut values);
    values
        .iter_mut()
        .for_each(|value| *value = 2.0 * *value + 30.0);
    let records = indices.iter().map(|at| own.records()[*at].clone());
    let (rate, labels) = (own.sample_rate_hz(), own.labels().clone());
    let records = records.collect();
    let other = Dataset::new(
        "other",
        rate,
        own.shape(),
        labels,
        records,
        Samples::F32(values),
    );
    Format::Npz.write(&lab.path(to), &other.unwrap()).unwrap();
    indices.len()
}

fn weights(lab: &Lab, run: &str) -> Weights {
    Weights::from_safetensors(&lab.read(&format!("{run}/weights.safetensors"))).unwrap()
}

#[test]
fn an_adapted_run_predicts_evaluates_and_exports_and_keeps_the_trained_weights() {
    let lab = Lab::new();
    lab.twin("more.h5", "--materials 4 --sweeps 20 --steps 120");
    let sweeps = write_other_skin(&lab, "more.h5", "other.npz", |_| true);
    let recipe = lab.recipe(RecipeChange::default());
    expect(0, lab.train(&recipe, "run"));
    let found = json(adapt(
        &lab,
        "run",
        "today",
        &["--data", "other.npz", "--json"],
    ));
    assert_eq!(found["presence"]["sweeps"], sweeps, "{found}");
    assert!(found["shift"]["level"].as_f64().unwrap() > 0.1, "{found}");
    let record = lab.json("today/adapted.json");
    let listed = record[0]["unlabelled"]["sweeps_sha256"].as_array().unwrap();
    assert_eq!(listed.len(), sweeps);
    let (before, after) = (weights(&lab, "run"), weights(&lab, "today"));
    for (name, tensor) in &before.0 {
        // Running statistics change as far as the scaling leaves a shift beyond chance.
        let may_change = name.contains("running_");
        assert!(may_change || after.0[name] == *tensor, "{name}");
    }
    // The gain of two halves the scaling.
    let gain = |run: &str| {
        let config = lab.json(&format!("{run}/config.json"));
        let model = &config["classifier"]["model"]["tactnet2"];
        model["normalizer"]["gain"][0].as_f64().unwrap()
    };
    let ratio = gain("run") / gain("today");
    assert!((1.6..2.6).contains(&ratio), "{ratio}");

    let evaluate = |run: &str| json(lab.command(&format!("eval --json @{run} --data @other.npz")));
    let after = evaluate("today");
    let note = "adapted to without their labels";
    assert!(after["tested"].to_string().contains(note), "{after}");
    lab.run("predict @today --data @other.npz");
    lab.run("export @today --out @net.onnx");
    let refused = expect(2, lab.command("train --resume @today"));
    assert!(stderr(&refused).contains("adapted"), "{}", stderr(&refused));
}

#[test]
fn labelled_sweeps_are_left_out_of_the_evaluation_and_few_materials_are_refused() {
    let lab = Lab::new();
    lab.twin("more.h5", "--materials 4 --sweeps 20 --steps 120");
    write_other_skin(&lab, "more.h5", "other.npz", |_| true);
    write_other_skin(&lab, "more.h5", "one.npz", |label| label == 1);
    lab.run("train --model lda --data @twin.h5 --out @run");
    let refused = expect(2, adapt(&lab, "run", "one", &["--data", "one.npz"]));
    let text = stderr(&refused);
    assert!(
        text.contains("few of the 4 known materials") && text.contains("--accept-risk"),
        "{text}"
    );
    assert!(!lab.path("one").exists());
    let accepted = expect(
        0,
        adapt(&lab, "run", "one", &["--data", "one.npz", "--accept-risk"]),
    );
    assert_says!(stderr(&accepted), "warning");

    let labelled = ["--labelled", "other.npz", "--per-material", "2"];
    let done = expect(0, adapt(&lab, "run", "labelled", &labelled));
    assert_says!(stdout(&done), "4 of 4 materials labelled");
    let found = json(lab.command("eval --json @labelled --data @other.npz"));
    assert_eq!(found["n_test"], 80 - 8, "{found}");
}
