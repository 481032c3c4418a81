//! `tactnet enroll` with the real binary: the new material is added, the others are unchanged.

use std::collections::BTreeMap;
use std::process::Command;

use serde_json::Value;
use tactnet_data::format::{Format, read};
use tactnet_data::{Dataset, LabelSet};
use tactnet_models::{NamedTensor, Weights};

use crate::command::{
    Lab, RecipeChange, assert_says, expect, json, messages_of, output_of, refusal, stderr, stdout,
};

fn enroll(lab: &Lab, run: &str, data: &str, material: &str, out: &str, more: &[&str]) -> Command {
    let line = format!("enroll @{run} --data @{data} --out @{out}");
    lab.command_with(&line, &[&["--material", material], more].concat())
}

/// Returns the names of the materials of a data set.
fn materials(lab: &Lab, data: &str) -> Vec<String> {
    let found = json(lab.command(&format!("data info --json @{data}")));
    let materials = found["materials"].as_array().unwrap().iter();
    let name = |material: &Value| material["name"].as_str().unwrap().to_string();
    materials.map(name).collect()
}

fn eval(lab: &Lab, run: &str, data: Option<&str>) -> Value {
    let mut command = lab.command(&format!("eval --json @{run}"));
    if let Some(data) = data {
        command.arg("--data").arg(lab.path(data));
    }
    json(command)
}

const CALIBRATE: [&str; 3] = ["--calibrate", "--false-alarms", "0.1"];
const TEN: [&str; 3] = ["--sweeps", "10", "--json"];

/// Returns `tactnet train` with the small recipe of the lab.
fn train(lab: &Lab, data: &str, out: &str, more: &[&str]) -> Command {
    let line = format!("train --json --data @{data} --recipe @small.toml --out @{out}");
    lab.command_with(&line, more)
}

/// Trains with a calibration; returns the number of sweeps that were held out for it.
fn train_calibrated(lab: &Lab) -> u64 {
    let result = json(train(lab, "three.h5", "run", &CALIBRATE));
    // 180 sweeps: 36 are test sweeps; of the other 144, a fifth is held out.
    let aside = 144 - result["n_train"].as_u64().unwrap();
    assert!((27..=30).contains(&aside), "{aside}");
    assert!(
        result["command"]
            .as_str()
            .unwrap()
            .contains("--calibrate --false-alarms 0.1 --coverage 0.9")
    );
    let calibration = lab.json("run/calibration.json");
    assert_eq!(calibration["sweeps"], aside);
    let embedded = Weights::from_safetensors(&lab.read("run/known.safetensors")).unwrap();
    let labels = &embedded.0["labels"].values;
    assert_eq!(
        labels.len() as u64,
        144 - aside,
        "no sweep is on both sides"
    );
    aside
}

/// The network was not trained on the fourth material of the twin. Without calibration this is an error, with calibration a
/// measured rate. Returns the name of the material.
fn assert_unknown_material_is_detected(lab: &Lab) -> String {
    let other = eval(lab, "run", Some("twin.h5"));
    assert_eq!(other["verdicts"]["detected"]["n"], 10, "{other}");
    let unknown = other["verdicts"]["unknown_materials"].as_array().unwrap();
    assert_eq!(unknown.len(), 1, "{other}");
    // Sweeps that the small twin shares with the training set are excluded.
    let known = other["n_test"].as_u64().unwrap() - 10;
    assert!((1..30).contains(&known), "{other}");
    assert_eq!(other["evaluations"]["plain"]["one_sweep"]["n"], known);
    assert_eq!(other["verdicts"]["coverage"]["n"], known);
    assert_eq!(other["n_unknown"], 10, "{other}");
    let taken_for = other["unknown_taken_for"].as_object().unwrap();
    assert_eq!(taken_for.len(), 1, "{other}");
    let counts = taken_for.values().next().unwrap().as_object().unwrap();
    let counted: u64 = counts.values().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!(counted, 10, "{other}");
    assert!(other["values"].is_null(), "the same unit: {other}");
    unknown[0].as_str().unwrap().to_string()
}

/// The fourth material is enrolled. The thresholds are fitted again, including its sweeps, and roughly meet their guarantees.
fn assert_enrolment_fits_thresholds_again(lab: &Lab, new: &str, aside: u64) {
    let found = json(enroll(lab, "run", "four.h5", new, "four", &TEN));
    let cost = &found["cost"];
    assert_eq!(cost["held_out"], aside, "{found}");
    let count = |name: &str| cost[name].as_u64().unwrap();
    assert!(
        count("right_before") <= aside && count("claimed") <= aside,
        "{found}"
    );
    assert!(count("right_after") + count("claimed") <= aside, "{found}");
    assert_eq!(lab.json("four/calibration.json")["sweeps"], aside + 10);
    let all = eval(lab, "four", Some("four.h5"));
    let alarms = &all["verdicts"]["false_alarms"];
    assert_eq!(alarms["n"], all["n_test"], "it knows all four: {all}");
    assert!(all["n_test"].as_u64().unwrap() >= 50, "{all}");
    assert!(alarms["mean"].as_f64().unwrap() <= 0.25, "{all}");
    // More than half of the test sweeps are of the new material, which its ten sweeps represent poorly: with this small
    // network the coverage is 58 to 84 %, depending on the seed. Without new thresholds it would be close to zero.
    let mut coverage = all["verdicts"]["coverage"]["mean"].as_f64().unwrap();
    for seed in ["2", "3"] {
        let (run, more) = (format!("run{seed}"), format!("more{seed}"));
        let options = [&CALIBRATE[..], &["--seed", seed]].concat();
        expect(0, train(lab, "three.h5", &run, &options));
        expect(0, enroll(lab, &run, "four.h5", new, &more, &TEN));
        let all = eval(lab, &more, Some("four.h5"));
        coverage += all["verdicts"]["coverage"]["mean"].as_f64().unwrap();
    }
    assert!(coverage / 3.0 >= 0.55, "{coverage}");
}

#[test]
fn a_calibrated_classifier_says_what_it_does_not_know() {
    let lab = Lab::new();
    lab.recipe_for(12);
    lab.twin("three.h5", "--materials 3 --sweeps 60 --steps 120");
    let aside = train_calibrated(&lab);
    let own = eval(&lab, "run", None);
    for share in ["false_alarms", "coverage"] {
        assert_eq!(own["verdicts"][share]["n"], 36, "{own}");
    }
    assert!(own["verdicts"]["detected"].is_null(), "{own}");
    assert!(own["verdicts"]["set_size"].as_f64().unwrap() >= 1.0);

    let new = assert_unknown_material_is_detected(&lab);
    lab.twin("four.h5", "--materials 4 --sweeps 60 --steps 120");
    assert_enrolment_fits_thresholds_again(&lab, &new, aside);
    // A run that did not keep the sweeps behind its thresholds prints a warning.
    std::fs::remove_file(lab.path("run/held_out.safetensors")).unwrap();
    let kept = messages_of(enroll(&lab, "run", "four.h5", &new, "kept", &TEN));
    assert!(kept.contains("train again with --calibrate"), "{kept}");
}

#[test]
fn a_calibration_needs_enough_sweeps_and_a_network() {
    let lab = Lab::new();
    lab.recipe(RecipeChange::default());
    let few = refusal(train(&lab, "twin.h5", "few", &["--calibrate"]));
    assert!(few.contains("calibration"), "{few}");
    assert!(few.contains("5 % false alarms and 90 % coverage"), "{few}");
    let baseline = lab.command("train --model knn-l --calibrate --data @twin.h5 --out @knn");
    let refused = refusal(baseline);
    assert_says!(
        refused,
        "`calibrate`: expected the recipe of a network or committee"
    );
}

#[test]
fn a_network_of_few_sweeps_keeps_its_materials_when_one_is_added() {
    let lab = Lab::new();
    std::fs::write(
        lab.path("few.toml"),
        "name = \"few\"\n[network]\nmaps = [8, 8]\nhidden = 64\nkeep_probability = 0.8\n[input]\nscaling = \"per-taxel\"\n\
         [training]\nepochs = 60\nbatch = 8\nlearning_rate = 0.005\nl2 = 1e-4\nmethod = { kind = \"base\" }\n",
    )
    .unwrap();
    lab.twin("few.h5", "--materials 4 --sweeps 12 --steps 120");
    lab.twin("five.h5", "--materials 5 --sweeps 20 --steps 120");
    let new = &materials(&lab, "five.h5")[4];
    let (mut before, mut after, mut claimed) = (0, 0, 0);
    for seed in ["1", "2", "3", "4", "5"] {
        let (run, more) = (format!("run{seed}"), format!("more{seed}"));
        lab.run(&format!(
            "train --seed {seed} --data @few.h5 --recipe @few.toml --out @{run}"
        ));
        let three = ["--sweeps", "3", "--json"];
        let output = expect(0, enroll(&lab, &run, "five.h5", new, &more, &three));
        assert_says!(stderr(&output), "the new material is held back");
        let found: Value = serde_json::from_str(&stdout(&output)).unwrap();
        assert_eq!(found["prior"], "hundredth-with-bias", "{found}");
        let count = |name: &str| found["test_cost"][name].as_u64().unwrap();
        before += count("right_before");
        after += count("right_after");
        claimed += count("claimed");
    }
    // Measured: 33 before, 31 after, 5 claimed; with a tenth of the prior and a free bias 28 and 11.
    assert!(before >= 25, "{before} of 50");
    assert!(claimed <= 7, "{claimed} of 50");
    assert!(after + 3 >= before, "{after} of {before}");
}

fn weights(lab: &Lab, run: &str) -> BTreeMap<String, NamedTensor> {
    let bytes = lab.read(&format!("{run}/weights.safetensors"));
    Weights::from_safetensors(&bytes).unwrap().0
}

/// The sweeps are those of the run's own test, and those of another file without the enrolled ones.
fn assert_enrolled_sweeps_are_not_tested(lab: &Lab, new: &str) {
    assert_eq!(eval(lab, "more", None)["n_test"], 8);
    let note = stderr(&lab.run("eval --mc 0 @more"));
    let none = format!("note: `{new}` was enrolled, and the run has no test sweeps of it");
    assert!(note.contains(&none), "{note}");
    let other = eval(lab, "more", Some("five.h5"));
    assert!(
        other["tested"]
            .as_str()
            .unwrap()
            .contains("; 5 enrolled sweeps are left out"),
        "{other}"
    );
    lab.run("data import @five.h5 --out @copy.npz");
    let copied = eval(lab, "more", Some("copy.npz"));
    assert_eq!(
        (&copied["tested"], &copied["n_test"]),
        (&other["tested"], &other["n_test"]),
        "sweeps are known by their content"
    );
    assert_trained_sweeps_are_counted(lab, copied["n_test"].as_u64().unwrap());
    assert_confusion_gives_the_accuracy(&copied, new);
    let known = eval(lab, "more", Some("twin.h5"));
    assert!(known["evaluations"]["plain"]["one_sweep"]["mean"].is_number());
}

/// `predict` names the training and enrolled sweeps, which are all but the `tested` ones.
fn assert_trained_sweeps_are_counted(lab: &Lab, tested: u64) {
    let predicted = lab.run("predict --json @more --data @copy.npz");
    let found: Value = serde_json::from_str(&stdout(&predicted)).unwrap();
    let all = found["sweeps"].as_array().unwrap().len() as u64;
    let learnt = all - tested;
    let said = stderr(&predicted);
    assert_says!(
        said,
        &format!("the run was trained on {learnt} of these {all} sweeps")
    );
}

fn assert_confusion_gives_the_accuracy(result: &Value, new: &str) {
    let counts: Vec<Vec<u64>> =
        serde_json::from_value(result["confusion"]["counts"].clone()).unwrap();
    assert_eq!(result["confusion"]["materials"][4], new);
    assert_eq!(counts.iter().flatten().sum::<u64>(), result["n_test"]);
    let right: u64 = (0..5).map(|material| counts[material][material]).sum();
    let accuracy = &result["evaluations"]["plain"]["one_sweep"];
    let share = accuracy["mean"].as_f64().unwrap() * accuracy["n"].as_f64().unwrap();
    assert_eq!(right, share.round() as u64, "{result}");
}

/// No sweeps were held out, so the run's test sweeps measure the cost, as `eval` counts.
fn assert_cost_is_that_of_eval(lab: &Lab, found: &Value) {
    let (before, after) = (eval(lab, "run", None), eval(lab, "more", None));
    let cost = &found["test_cost"];
    assert_eq!(cost["held_out"], before["n_test"], "{found}");
    for (count, result) in [("right_before", before), ("right_after", after)] {
        let mean = result["evaluations"]["plain"]["one_sweep"]["mean"].as_f64();
        let right = mean.unwrap() * result["n_test"].as_f64().unwrap();
        assert_eq!(cost[count].as_f64().unwrap(), right.round(), "{found}");
    }
}

/// Returns the weights with the new material, in which all others are as before.
fn assert_old_rows_stay(lab: &Lab) -> BTreeMap<String, NamedTensor> {
    let (before, after) = (weights(lab, "run"), weights(lab, "more"));
    for (name, tensor) in &before {
        let values = &after[name].values;
        assert_eq!(&tensor.values, &values[..tensor.values.len()], "{name}");
        let more = if name == "output.weight" {
            16
        } else {
            usize::from(name == "output.bias")
        };
        assert_eq!(values.len() - tensor.values.len(), more, "{name}");
    }
    after
}

#[test]
fn a_new_material_is_added_and_the_old_rows_stay() {
    let lab = Lab::new();
    let recipe = lab.recipe_for(12);
    expect(0, lab.train(&recipe, "run"));
    lab.twin("five.h5", "--materials 5 --sweeps 20 --steps 120");
    let new = materials(&lab, "five.h5")[4].clone();
    let new = new.as_str();

    let found = json(enroll(
        &lab,
        "run",
        "five.h5",
        new,
        "more",
        &["--sweeps", "5", "--json"],
    ));
    assert_eq!(
        (&found["materials"], &found["material"]),
        (&5.into(), &new.into())
    );
    assert_eq!(found["sweeps"].as_array().unwrap().len(), 5);
    assert_cost_is_that_of_eval(&lab, &found);
    assert_eq!(lab.json("more/enrolled.json")[0]["material"], new);
    assert_eq!(lab.json("more/config.json")["classifier"]["labels"][4], new);
    let after = assert_old_rows_stay(&lab);
    assert_enrolled_sweeps_are_not_tested(&lab, new);

    // Another material on top, and again from the first run.
    let text = output_of({
        let mut renamed = enroll(&lab, "run", "five.h5", new, "again", &[]);
        renamed.env("NO_COLOR", "1");
        renamed
    });
    assert!(text.contains("enrolled from 20 sweeps"), "{text}");
    let taken = refusal(enroll(&lab, "run", "five.h5", new, "again", &[]));
    assert_says!(taken, "is not empty; name another folder");
    let refused = lab.refused("train --resume @more");
    assert!(refused.contains("cannot be trained further"), "{refused}");
    assert_eq!(weights(&lab, "more"), after, "nothing was overwritten");
}

#[test]
fn a_known_material_under_a_new_name_is_noticed() {
    let lab = Lab::new();
    let recipe = lab.recipe_for(8);
    expect(0, lab.train(&recipe, "run"));
    let twin = read(&lab.path("twin.h5")).unwrap();
    let known: Vec<String> = twin.labels().names().map(Into::into).collect();
    let renamed = known.iter().map(|name| format!("new {name}"));
    let renamed = Dataset::new(
        "renamed",
        twin.sample_rate_hz(),
        twin.shape(),
        LabelSet::new(renamed).unwrap(),
        twin.records().to_vec(),
        twin.samples().clone(),
    );
    Format::Npz
        .write(&lab.path("renamed.npz"), &renamed.unwrap())
        .unwrap();
    let name = format!("new {}", known[0]);
    let said = messages_of(enroll(&lab, "run", "renamed.npz", &name, "more", &[]));
    let seen = "the run was trained on 8 of these 10 sweeps under another label";
    assert!(said.contains(seen), "{said}");
    let alike = format!(
        "were predicted as `{}` before; is it that material?",
        known[0]
    );
    assert!(said.contains(&alike), "{said}");
}

#[test]
fn what_cannot_be_enrolled_is_refused_in_one_line_and_leaves_nothing() {
    let lab = Lab::new();
    let recipe = lab.recipe_for(1);
    expect(0, lab.train(&recipe, "run"));
    lab.run("train --model knn-l --data @twin.h5 --out @knn");
    let first = materials(&lab, "twin.h5")[0].clone();
    let typed = first.to_uppercase();
    let meant = format!("did you mean `{first}`?");
    let nan = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/h5/bad_nan.h5");
    std::fs::copy(nan, lab.path("nan.h5")).unwrap();
    lab.twin("longer.h5", "--materials 5 --sweeps 3 --steps 130");
    let fifth = materials(&lab, "longer.h5")[4].clone();
    let (first, typed, fifth) = (first.as_str(), typed.as_str(), fifth.as_str());
    let eleven = &["--sweeps", "11"][..];
    let twin = "twin.h5";
    for (run, data, material, more, named) in [
        ("run", twin, first, &[][..], "knows a material of this name"),
        ("run", twin, "velvet", &[], "no material `velvet`"),
        ("run", twin, typed, &[], meant.as_str()),
        (
            "run",
            twin,
            first,
            eleven,
            "has 10 sweeps, 11 were requested",
        ),
        (
            "run",
            "longer.h5",
            fifth,
            &[],
            "longer.h5: the classifier expects",
        ),
        ("run", "nan.h5", "velvet", &[], "expected finite numbers"),
        (
            "knn",
            twin,
            "velvet",
            &[],
            "only networks and committees can learn a new material",
        ),
        ("nothing", twin, "velvet", &[], "no run here"),
    ] {
        let refused = refusal(enroll(&lab, run, data, material, "out", more));
        assert!(refused.contains(named), "{material}: {refused}");
        assert_eq!(refused.trim().lines().count(), 1, "{refused}");
        assert!(!lab.path("out").exists(), "{named}");
    }
}
