//! `tactnet train` and `tactnet eval` on real files with the real binary.

use serde_json::Value;

use crate::command::{Lab, RecipeChange, assert_says, expect, json, stderr, stdout, tactnet};

/// `result.json` has all fields, with the numbers of the small twin.
fn assert_complete(result: &Value) {
    for field in [
        "schema_version",
        "data_sha256",
        "git",
        "seed",
        "recipe",
        "n_train",
        "n_test",
        "epochs",
        "accuracy_one_sweep",
        "accuracy_three_sweeps",
        "train_seconds",
        "seconds_per_epoch",
        "peak_rss_mib",
        "evaluations",
        "command",
    ] {
        assert!(result.get(field).is_some(), "result.json lacks {field}");
    }
    assert_eq!(
        (&result["n_train"], &result["n_test"]),
        (&32.into(), &8.into())
    );
    for field in ["mean", "ci95_low", "ci95_high", "n"] {
        assert!(
            result["accuracy_one_sweep"][field].is_number(),
            "accuracy_one_sweep.{field}"
        );
    }
    assert_eq!(
        result["accuracy_one_sweep"], result["evaluations"]["mc_dropout"]["one_sweep"],
        "the accuracy is that of the recipe's own way of predicting"
    );
    assert_eq!(
        result["accuracy_three_sweeps"],
        Value::Null,
        "two test sweeps a material"
    );
}

fn assert_falling_loss(lab: &Lab) {
    let metrics = String::from_utf8(lab.read("run/metrics.jsonl")).unwrap();
    let epochs: Vec<Value> = metrics
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(epochs.len(), 3);
    assert!(
        epochs[2]["train_loss"].as_f64() < epochs[0]["train_loss"].as_f64(),
        "{metrics}"
    );
}

fn assert_predictions_give_the_accuracy(lab: &Lab, result: &Value) {
    let split = lab.json("run/split.json");
    assert_eq!(split["test"].as_array().unwrap().len(), 8);
    assert_eq!(split["sha256"], result["split_sha256"]);
    let rows = lab.prediction_rows("run");
    assert_eq!(rows.len(), 8);
    let correct = rows
        .iter()
        .filter(|r| r.split(',').next() == r.split(',').nth(1))
        .count();
    assert_eq!(result["accuracy_one_sweep"]["mean"], correct as f64 / 8.0);
    for row in rows {
        let p: f64 = row
            .split(',')
            .skip(3)
            .map(|p| p.parse::<f64>().unwrap())
            .sum();
        assert!((p - 1.0).abs() < 1e-9, "probabilities of {row} sum to {p}");
    }
}

fn assert_eval_finds(lab: &Lab, result: &Value) {
    let again = json(lab.command("eval --json --sweeps 2 @run"));
    for method in ["plain", "mc_dropout"] {
        assert_eq!(
            again["evaluations"][method]["one_sweep"], result["evaluations"][method]["one_sweep"],
            "eval finds what train found ({method})"
        );
        assert_eq!(
            again["evaluations"][method]["negative_log_likelihood"],
            result["evaluations"][method]["negative_log_likelihood"]
        );
    }
    assert_eq!(again["evaluations"]["plain"]["fused"]["sweeps"], 2);
}

#[test]
fn a_run_leaves_everything_needed_to_trust_and_repeat_it() {
    let lab = Lab::new();
    let mut command = lab.train(&lab.recipe(RecipeChange::default()), "run");
    command.arg("--json");
    let output = expect(0, command);
    let printed: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let result = lab.json("run/result.json");
    assert_eq!(printed, result, "--json prints exactly result.json");
    assert_complete(&result);
    assert_falling_loss(&lab);
    assert_predictions_give_the_accuracy(&lab, &result);
    assert!(
        String::from_utf8(lab.read("run/confusion.svg"))
            .unwrap()
            .starts_with("<svg")
    );
    assert!(lab.json("run/environment.json")[0]["git"].is_string());

    assert_eval_finds(&lab, &result);
}

#[test]
fn equal_seeds_give_equal_weights_whatever_the_number_of_threads() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange::default());
    for threads in ["1", "2", "4"] {
        let mut command = lab.train(&recipe, threads);
        command.env("RAYON_NUM_THREADS", threads);
        expect(0, command);
    }
    for file in ["weights.safetensors", "split.json"] {
        for threads in ["2", "4"] {
            assert!(
                lab.read(&format!("1/{file}")) == lab.read(&format!("{threads}/{file}")),
                "{file} differs between 1 and {threads} threads"
            );
        }
    }
    assert_eq!(lab.prediction_rows("1"), lab.prediction_rows("4"));
    let mut other = lab.train(&recipe, "other");
    other.args(["--seed", "2"]);
    expect(0, other);
    assert!(lab.read("1/weights.safetensors") != lab.read("other/weights.safetensors"));
}

#[test]
fn the_full_size_network_ignores_the_number_of_threads() {
    let lab = Lab::new();
    lab.twin("long.h5", "--materials 4 --sweeps 10");
    for threads in ["1", "4"] {
        let mut command = lab.command(&format!(
            "train --recipe thesis --epochs 1 --data @long.h5 --out @{threads}"
        ));
        command.env("RAYON_NUM_THREADS", threads);
        expect(0, command);
    }
    assert!(lab.read("1/weights.safetensors") == lab.read("4/weights.safetensors"));
    assert_eq!(lab.prediction_rows("1"), lab.prediction_rows("4"));
}

#[test]
fn a_loss_that_is_no_number_stops_with_epoch_and_batch_and_keeps_the_checkpoint() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange {
        epochs: Some(5),
        extra_training: "learning_rate_drops = [{ after_epoch = 2, factor = 1e40 }]",
        ..RecipeChange::default()
    });
    let output = expect(1, lab.train(&recipe, "run"));
    let message = stderr(&output);
    assert_says!(message, "not finite in epoch 3, batch 2");
    assert!(!lab.path("run/result.json").exists());
    let metrics = String::from_utf8(lab.read("run/metrics.jsonl")).unwrap();
    assert_eq!(metrics.lines().count(), 2);
    let table = stdout(&lab.run("eval @run"));
    assert!(
        table.contains("\nMC dropout ") && !table.contains("NaN"),
        "{table}"
    );
    assert!(table.contains("\nwithout dropout "), "{table}");
    assert_says!(
        table,
        "\nMC dropout: mean over 20 passes with dropout left on"
    );
}

#[test]
fn a_copy_of_the_training_sweeps_is_recognised_in_any_format() {
    let lab = Lab::new();
    expect(0, lab.train(&lab.recipe(RecipeChange::default()), "run"));
    lab.twin("more.npz", "--materials 4 --sweeps 12 --steps 120");
    let result = json(lab.command("eval --json --data @more.npz @run"));
    assert_eq!(result["tested"], "all sweeps except 32 of the training set");
    assert_eq!(result["n_test"], 48 - 32);
}

/// Expects exit code 2, nothing on stdout, and one line with all `expected` parts.
fn assert_refused(arguments: &[&str], expected: &[&str]) {
    let output = expect(2, tactnet(arguments));
    let message = stderr(&output);
    assert_eq!(
        message.trim_end().lines().count(),
        1,
        "{arguments:?}: {message}"
    );
    assert_eq!(stdout(&output), "", "{arguments:?}");
    for part in expected {
        assert!(message.contains(part), "{arguments:?}: {message}");
    }
}

#[test]
fn mistyped_words_get_one_line_with_suggestions_and_exit_code_two() {
    let both = ["experiment", "run", "nshot"];
    let both = [&both[..], &["--data", "a.h5", "--set", "data=b.h5"]].concat();
    let cases: [(&[&str], &[&str]); 7] = [
        (
            &["data", "check"],
            &["<FILE|twin>", "`tactnet data check --help`"],
        ),
        (&["train", "--dta", "x"], &["--dta", "--data"]),
        (
            &["train", "--data", "missing.h5"],
            &["missing.h5", "no such file"],
        ),
        (
            &["train", "--recipe", "tesis"],
            &["tesis", "fast, spectra, thesis", "did you mean `thesis`?"],
        ),
        (
            &["experiment", "run", "nsht"],
            &["nsht", "did you mean `nshot`?"],
        ),
        (
            &["experiment", "run", "nshot", "--set", "splts=3"],
            &["splts", "did you mean `splits`?"],
        ),
        (&both, &["`--data a.h5`", "`--set data=b.h5`", "both name"]),
    ];
    for (arguments, expected) in cases {
        assert_refused(arguments, expected);
    }
}

#[test]
fn mistakes_about_runs_and_data_get_one_line_and_exit_code_two() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange::default());
    expect(0, lab.train(&recipe, "run"));
    let path = |name: &str| lab.path(name).display().to_string();
    let small = recipe.display().to_string();
    let (twin, run) = (path("twin.h5"), path("run"));
    let again = ["train", "--data", &twin, "--recipe", &small, "--out", &run];
    let cases: [(&[&str], &[&str]); 6] = [
        (&["train", "--data", &twin, "--fold", "9"], &["fold", "9"]),
        (&again, &["holds a run already, which has ended", "--out"]),
        (&["train", "--resume", &path("nowhere")], &["no run here"]),
        (
            &["eval", &path("")],
            &["no run here", "name the one below: ", "run"],
        ),
        (&["train", "--data", &path("small.toml")], &["small.toml"]),
        (&["eval", &run, "--sweeps", "0"], &["--sweeps"]),
    ];
    for (arguments, expected) in cases {
        assert_refused(arguments, expected);
    }
    if cfg!(not(feature = "cuda")) {
        let missing = "`cargo install --path . --features cuda`";
        assert_refused(&["train", "--data", &twin, "--device", "cuda"], &[missing]);
    }
}
