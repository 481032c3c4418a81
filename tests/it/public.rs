//! `tactnet experiment run public` on two small data sets, with real processes.

use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;
use tactnet_data::format::Format;
use tactnet_data::{Dataset, LabelSet, Samples, SweepRecord, SweepShape};

use crate::command::{Lab, expect, json, signal, stdout};

/// Returns a number between 0 and 10 that looks random.
fn noise(seed: usize) -> f32 {
    let mut bits = (seed as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    ((bits >> 40) % 1000) as f32 / 100.0
}

/// Writes a recorded data set at 20 Hz whose materials were recorded in four blocks each, and a twin, into `sets`.
fn sets(lab: &Lab) {
    std::fs::create_dir(lab.path("sets")).unwrap();
    lab.twin(
        "sets/twin.npz",
        "--materials 3 --sweeps 10 --steps 120 --seed 2",
    );
    let shape = SweepShape {
        steps: 40,
        rows: 1,
        cols: 2,
    };
    let (mut values, mut records) = (Vec::new(), Vec::new());
    for sweep in 0..48_usize {
        let label = sweep % 3;
        for value in 0..shape.values() {
            values.push(noise(sweep * shape.values() + value) + 2.0 * label as f32);
        }
        records.push(SweepRecord {
            label,
            sweep,
            block: Some((sweep / 12) as u32),
            test: None,
        });
    }
    let labels = LabelSet::new(["cork", "felt", "wood"]).unwrap();
    let dataset = Dataset::new("bouts", 20.0, shape, labels, records, Samples::F32(values));
    let path = lab.path("sets/bouts.npz");
    Format::Npz.write(&path, &dataset.unwrap()).unwrap();
    let committee = "name = \"both\"\nmembers = [\"lda\", \"minirocket\"]\n";
    std::fs::write(lab.path("both.toml"), committee).unwrap();
}

/// Returns the benchmark of cheap models, of which `knn-h` needs a higher rate than the recorded set has.
fn benchmark(lab: &Lab, out: &str) -> Command {
    let models = "models=[\"lda\",\"minirocket\",\"knn-h\",\"@both.toml\"]";
    let settings = "--set folds=2 --set shots=3 --set probes=[\"first-frame\"]";
    lab.command(&format!(
        "experiment run public --set data=@sets --set {models} {settings} --out @{out}"
    ))
}

/// Returns the results of a set under a condition.
fn set<'a>(summary: &'a Value, condition: &str, data: &str) -> &'a Value {
    let conditions = summary["benchmark"]["conditions"].as_array().unwrap();
    let found = conditions.iter().find(|of| of["condition"] == condition);
    let sets = found.unwrap_or_else(|| panic!("{condition}"))["sets"]
        .as_array()
        .unwrap();
    sets.iter().find(|of| of["data"] == data).unwrap()
}

fn result<'a>(set: &'a Value, model: &str) -> &'a Value {
    let models = set["models"].as_array().unwrap();
    models.iter().find(|of| of["model"] == model).unwrap()
}

#[test]
fn one_command_compares_all_models_on_all_sets_of_a_folder() {
    let lab = Lab::new();
    sets(&lab);
    let mut command = benchmark(&lab, "out");
    command.arg("--json");
    let summary = json(command);
    let named: Vec<&str> = summary["benchmark"]["conditions"]
        .as_array()
        .unwrap()
        .iter()
        .map(|of| of["condition"].as_str().unwrap())
        .collect();
    assert_eq!(
        named,
        [
            "headline",
            "held-out groups",
            "random folds",
            "3 sweeps a material"
        ]
    );
    for (condition, data) in [
        ("headline", "bouts"),
        ("headline", "twin"),
        ("held-out groups", "bouts"),
        ("random folds", "bouts"),
        ("random folds", "twin"),
        ("3 sweeps a material", "bouts"),
        ("3 sweeps a material", "twin"),
    ] {
        let set = set(&summary, condition, data);
        for model in ["lda", "minirocket", "both"] {
            let result = result(set, model);
            for key in ["accuracy", "balanced_accuracy", "train_seconds", "rank"] {
                assert!(result[key].is_f64(), "{condition}, {data}, {model}: {key}");
            }
            assert_eq!(result["folds"], 2);
        }
        let spectra = result(set, "knn-h");
        match data {
            "bouts" => {
                assert!(spectra["left_out"].as_str().unwrap().contains("Hz"));
                assert_eq!(spectra["rank"], 4.0);
            }
            _ => assert!(spectra["accuracy"].is_f64()),
        }
    }
    let (headline, groups) = ["headline", "held-out groups"]
        .map(|of| set(&summary, of, "bouts"))
        .into();
    assert_eq!(headline, groups);

    // The committee is the average of its members, with the sum of their times.
    let time = |model: &str| result(groups, model)["train_seconds"].as_f64().unwrap();
    assert!((time("both") - time("lda") - time("minirocket")).abs() < 1e-9);
    let log = lab.read("out/tasks/bouts-both-run0-groups0.log");
    assert!(
        String::from_utf8(log)
            .unwrap()
            .contains("averaged the predictions")
    );
    assert!(
        !lab.path("out/tasks/bouts-both-run0-groups0/weights.safetensors")
            .exists()
    );

    // The report begins with the table, and the text ends with the rule.
    let page = String::from_utf8(lab.read("out/report.html")).unwrap();
    let first = page.split("<h2 id=\"").nth(1).unwrap();
    assert!(first.starts_with("sets\""), "{}", &first[..40]);
    assert!(page.contains("<h2 id=\"pareto\"") && page.contains("<h2 id=\"audit\""));
    let text = stdout(&lab.run("experiment report @out"));
    assert!(
        text.contains("held-out groups, accuracy [%]") && text.contains("Selected: "),
        "{text}"
    );
}

#[test]
fn a_benchmark_that_was_stopped_continues_with_the_same_predictions() {
    let lab = Lab::new();
    sets(&lab);
    expect(0, benchmark(&lab, "whole"));
    let mut runner = benchmark(&lab, "parts")
        .args(["--jobs", "1"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    let ended = lab.path("parts/tasks/bouts-lda-run0-groups0/result.json");
    while !ended.exists() {
        assert!(begun.elapsed() < Duration::from_secs(120), "no task ends");
        sleep(Duration::from_millis(5));
    }
    signal("INT", runner.id());
    runner.wait().unwrap();
    let modified = || std::fs::metadata(&ended).unwrap().modified().unwrap();
    let before = modified();
    expect(0, benchmark(&lab, "parts"));
    assert_eq!(modified(), before, "finished tasks are not run again");
    for task in std::fs::read_dir(lab.path("whole/tasks")).unwrap() {
        let name = task.unwrap().file_name().into_string().unwrap();
        if lab.path("whole/tasks").join(&name).is_dir() {
            let [whole, parts] =
                ["whole", "parts"].map(|out| lab.prediction_rows(&format!("{out}/tasks/{name}")));
            assert_eq!(whole, parts, "{name}");
        }
    }
}
