//! `tactnet train` and `tactnet eval` on real files with the real binary.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use crate::command::{Lab, RecipeChange, expect, stderr, stdout, tactnet};

#[test]
fn a_run_leaves_everything_needed_to_trust_and_repeat_it() {
    let lab = Lab::new();
    let mut command = lab.train(&lab.recipe(RecipeChange::default()), "run");
    command.arg("--json");
    let output = expect(0, command);
    let printed: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let result = lab.json("run/result.json");
    assert_eq!(printed, result, "--json prints exactly result.json");
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
        serde_json::Value::Null,
        "two test sweeps a material"
    );

    let metrics = String::from_utf8(lab.read("run/metrics.jsonl")).unwrap();
    let epochs: Vec<serde_json::Value> = metrics
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(epochs.len(), 3);
    assert!(
        epochs[2]["train_loss"].as_f64() < epochs[0]["train_loss"].as_f64(),
        "{metrics}"
    );

    let split = lab.json("run/split.json");
    assert_eq!(split["test"].as_array().unwrap().len(), 8);
    assert_eq!(split["sha256"], result["split_sha256"]);
    let tsml = String::from_utf8(lab.read("run/predictions_test.csv")).unwrap();
    let rows: Vec<&str> = tsml.lines().skip(3).collect();
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
    assert!(
        String::from_utf8(lab.read("run/confusion.svg"))
            .unwrap()
            .starts_with("<svg")
    );
    assert!(lab.json("run/environment.json")[0]["git"].is_string());

    let mut eval = tactnet(["eval", "--json", "--sweeps", "2"]);
    eval.arg(lab.path("run"));
    let again: serde_json::Value = serde_json::from_str(&stdout(&expect(0, eval))).unwrap();
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
    let rows = |run: &str| {
        let text = String::from_utf8(lab.read(&format!("{run}/predictions_test.csv"))).unwrap();
        text.lines().skip(3).map(String::from).collect::<Vec<_>>()
    };
    assert_eq!(rows("1"), rows("4"));
    let mut other = lab.train(&recipe, "other");
    other.args(["--seed", "2"]);
    expect(0, other);
    assert!(lab.read("1/weights.safetensors") != lab.read("other/weights.safetensors"));
}

#[test]
fn the_full_size_network_ignores_the_number_of_threads() {
    let lab = Lab::new();
    let mut twin = tactnet([
        "data",
        "twin",
        "--materials",
        "4",
        "--sweeps",
        "10",
        "--out",
    ]);
    twin.arg(lab.path("long.h5"));
    expect(0, twin);
    for threads in ["1", "4"] {
        let mut command = tactnet(["train", "--recipe", "thesis", "--epochs", "1", "--data"]);
        command
            .arg(lab.path("long.h5"))
            .arg("--out")
            .arg(lab.path(threads));
        command.env("RAYON_NUM_THREADS", threads);
        expect(0, command);
    }
    assert!(lab.read("1/weights.safetensors") == lab.read("4/weights.safetensors"));
    let rows = |run: &str| {
        let text = String::from_utf8(lab.read(&format!("{run}/predictions_test.csv"))).unwrap();
        text.lines().skip(3).map(String::from).collect::<Vec<_>>()
    };
    assert_eq!(rows("1"), rows("4"));
}

/// Starts `command` and waits until it has finished an epoch.
fn start_and_wait_for_an_epoch(mut command: Command) -> std::process::Child {
    let mut child = command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let reader = BufReader::new(child.stderr.take().unwrap());
    let mut lines = reader.lines();
    lines
        .find(|line| line.as_ref().unwrap().contains("epoch 2/"))
        .expect("an epoch ends")
        .unwrap();
    std::thread::spawn(move || lines.for_each(drop));
    child
}

fn signal(child: &std::process::Child, name: &str) {
    let status = Command::new("kill")
        .arg(format!("-{name}"))
        .arg(child.id().to_string())
        .status();
    assert!(status.unwrap().success());
}

#[test]
fn an_interrupted_run_ends_with_the_very_same_weights() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange {
        epochs: Some(60),
        ..RecipeChange::default()
    });
    expect(0, lab.train(&recipe, "whole"));
    for (name, signal_name, code) in [
        ("int", "INT", Some(130)),
        ("term", "TERM", Some(130)),
        ("kill", "KILL", None),
    ] {
        let mut child = start_and_wait_for_an_epoch(lab.train(&recipe, name));
        signal(&child, signal_name);
        assert_eq!(child.wait().unwrap().code(), code, "{name}");
        assert!(
            !lab.path(name).join("result.json").exists(),
            "{name} was stopped too late to test"
        );
        let mut resume = tactnet(["train", "--resume"]);
        resume.arg(lab.path(name));
        expect(0, resume);
        assert!(
            lab.read("whole/weights.safetensors")
                == lab.read(&format!("{name}/weights.safetensors")),
            "weights differ after {name}"
        );
        let epochs = |run: &str| {
            let text = String::from_utf8(lab.read(&format!("{run}/metrics.jsonl"))).unwrap();
            text.lines()
                .map(|line| {
                    let mut line: serde_json::Value = serde_json::from_str(line).unwrap();
                    line.as_object_mut().unwrap().remove("seconds");
                    line
                })
                .collect::<Vec<_>>()
        };
        assert_eq!(epochs("whole"), epochs(name), "metrics differ after {name}");
    }
    let mut finished = tactnet(["train", "--json", "--resume"]);
    finished.arg(lab.path("whole"));
    let output = expect(0, finished);
    assert!(stderr(&output).contains("has already ended"));
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
    assert!(
        message.contains("not finite in epoch 3, batch 2"),
        "{message}"
    );
    assert!(!lab.path("run/result.json").exists());
    let metrics = String::from_utf8(lab.read("run/metrics.jsonl")).unwrap();
    assert_eq!(metrics.lines().count(), 2);
    let mut eval = tactnet(["eval"]);
    eval.arg(lab.path("run"));
    let table = stdout(&expect(0, eval));
    assert!(
        table.contains("\nMC dropout ") && !table.contains("NaN"),
        "{table}"
    );
    assert!(table.contains("\nwithout dropout "), "{table}");
    assert!(
        table.contains("\nMC dropout: mean over 20 passes with dropout left on"),
        "{table}"
    );
}

/// Runs `command` with a maximum file size in KiB, which acts like a full disk.
fn limited(kibibytes: usize, command: &Command) -> Command {
    let mut limited = Command::new("bash");
    limited
        .arg("-c")
        .arg(format!("trap '' XFSZ; ulimit -f {kibibytes}; exec \"$@\""))
        .arg("bash")
        .arg(command.get_program())
        .args(command.get_args());
    limited
}

#[test]
fn a_report_that_does_not_fit_on_the_disk_is_a_failure_not_a_mistake() {
    let lab = Lab::new();
    let mut run = tactnet(["experiment", "run", "crossval_baselines", "--out"]);
    run.arg(lab.path("out"))
        .args(["--set", "models=knn-l", "--set", "probes=[]"])
        .args(["--set", "folds=1", "--set", "repeats=1", "--set"])
        .arg(format!("data={}", lab.path("twin.h5").display()));
    expect(0, run);
    let [summary, page] = ["out/summary.json", "out/report.html"].map(|file| lab.read(file).len());
    let limit = summary.div_ceil(1024);
    assert!(
        page > 1024 * limit,
        "{page} bytes are more than {limit} KiB"
    );
    let mut report = tactnet(["experiment", "report"]);
    report.arg(lab.path("out"));
    let message = stderr(&expect(1, limited(limit, &report)));
    assert!(message.contains("report.html: cannot write"), "{message}");
}

#[cfg(target_os = "linux")]
#[test]
fn results_that_cannot_be_printed_are_a_failure() {
    let lab = Lab::new();
    let mut info = tactnet(["data", "info"]);
    info.arg(lab.path("twin.h5"));
    let full = std::fs::File::create("/dev/full").unwrap();
    let status = info.stdout(full).stderr(Stdio::null()).status().unwrap();
    assert_eq!(status.code(), Some(1));
}

#[test]
fn a_full_disk_is_an_error_and_never_a_broken_checkpoint() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange {
        epochs: Some(60),
        ..RecipeChange::default()
    });
    expect(0, lab.train(&recipe, "whole"));
    let mut child = start_and_wait_for_an_epoch(lab.train(&recipe, "full"));
    signal(&child, "INT");
    child.wait().unwrap();
    let checkpoint = lab.read("full/checkpoint.safetensors");
    let resume = || {
        let mut command = tactnet(["train", "--resume"]);
        command.arg(lab.path("full"));
        command
    };
    // A write fails halfway, as on a full disk. The limit is half a checkpoint, because the next one may be a few bytes
    // shorter.
    let limit = checkpoint.len() / 2048;
    let message = stderr(&expect(1, limited(limit, &resume())));
    assert!(
        message.contains("checkpoint.safetensors: cannot write"),
        "{message}"
    );
    assert!(
        lab.read("full/checkpoint.safetensors") == checkpoint,
        "the former checkpoint is whole"
    );
    let left: Vec<_> = std::fs::read_dir(lab.path("full"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with(".writing"))
        .collect();
    assert!(left.is_empty(), "{left:?}");
    expect(0, resume());
    assert!(lab.read("whole/weights.safetensors") == lab.read("full/weights.safetensors"));
}

#[test]
fn two_processes_never_train_in_one_folder() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange {
        epochs: Some(400),
        ..RecipeChange::default()
    });
    let mut child = start_and_wait_for_an_epoch(lab.train(&recipe, "run"));
    let mut resume = tactnet(["train", "--resume"]);
    resume.arg(lab.path("run"));
    for second in [resume, lab.train(&recipe, "run")] {
        let message = stderr(&expect(2, second));
        assert!(
            message.contains("another process is training in this folder"),
            "{message}"
        );
    }
    signal(&child, "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[test]
fn a_copy_of_the_training_sweeps_is_recognised_in_any_format() {
    let lab = Lab::new();
    expect(0, lab.train(&lab.recipe(RecipeChange::default()), "run"));
    let mut export = tactnet([
        "data",
        "twin",
        "--materials",
        "4",
        "--sweeps",
        "12",
        "--steps",
        "120",
        "--out",
    ]);
    export.arg(lab.path("more.npz"));
    expect(0, export);
    let mut eval = tactnet(["eval", "--json", "--data"]);
    eval.arg(lab.path("more.npz")).arg(lab.path("run"));
    let result: serde_json::Value = serde_json::from_str(&stdout(&expect(0, eval))).unwrap();
    assert_eq!(result["tested"], "all sweeps except 32 of the training set");
    assert_eq!(result["n_test"], 48 - 32);
}

#[test]
fn a_run_is_resumed_from_any_folder_and_a_moved_data_set_can_be_named() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange {
        epochs: Some(60),
        ..RecipeChange::default()
    });
    let mut train = tactnet(["train", "--data", "twin.h5", "--out", "run", "--recipe"]);
    train.arg(&recipe).current_dir(lab.folder.path());
    let mut child = start_and_wait_for_an_epoch(train);
    signal(&child, "INT");
    child.wait().unwrap();
    // From another folder than the one in which it was started.
    let resume = || {
        let mut resume = tactnet(["train", "--resume"]);
        resume.arg(lab.path("run"));
        resume
    };
    let moved = lab.path("moved.h5");
    std::fs::rename(lab.path("twin.h5"), &moved).unwrap();
    let lost = stderr(&expect(2, resume()));
    let before = lab.path("twin.h5").display().to_string();
    assert!(lost.contains(&before), "{lost}");
    assert!(lost.contains("`--data FILE`"), "{lost}");
    let mut named = resume();
    named.arg("--data").arg(&moved);
    // On the processor no GPU search takes place; it would print a line here.
    named.env_remove("XDG_RUNTIME_DIR");
    let said = stderr(&expect(0, named));
    assert!(said.contains("continuing after step"), "{said}");
    assert!(!said.contains("XDG_RUNTIME_DIR"), "{said}");
    std::fs::rename(&moved, lab.path("twin.h5")).unwrap();
    let ended = stderr(&expect(0, resume()));
    assert!(ended.contains("has already ended"), "{ended}");
}

#[test]
fn mistakes_get_one_line_and_exit_code_two() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange::default());
    expect(0, lab.train(&recipe, "run"));
    let path = |name: &str| lab.path(name).display().to_string();
    let small = recipe.display().to_string();
    let cases: [(&[&str], &[&str]); 14] = [
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
        (
            &["train", "--data", &path("twin.h5"), "--fold", "9"],
            &["fold", "9"],
        ),
        (
            &[
                "train",
                "--data",
                &path("twin.h5"),
                "--recipe",
                &small,
                "--out",
                &path("run"),
            ],
            &["holds a run already, which has ended", "--out"],
        ),
        (&["train", "--resume", &path("nowhere")], &["no run here"]),
        (
            &["eval", &path("")],
            &["no run here", "name the one below: ", "run"],
        ),
        (&["train", "--data", &path("small.toml")], &["small.toml"]),
        (
            &["train", "--data", &path("twin.h5"), "--device", "cuda"],
            &["`cargo install --path . --features cuda`"],
        ),
        (&["eval", &path("run"), "--sweeps", "0"], &["--sweeps"]),
        (
            &[
                "experiment",
                "run",
                "nshot",
                "--data",
                "a.h5",
                "--set",
                "data=b.h5",
            ],
            &["`--data a.h5`", "`--set data=b.h5`", "both name"],
        ),
    ];
    for (arguments, expected) in cases {
        if cfg!(feature = "cuda") && arguments.contains(&"cuda") {
            continue;
        }
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
}

#[test]
fn a_changed_data_set_is_noticed_on_resume() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange {
        epochs: Some(60),
        ..RecipeChange::default()
    });
    let mut child = start_and_wait_for_an_epoch(lab.train(&recipe, "run"));
    signal(&child, "INT");
    child.wait().unwrap();
    let mut twin = tactnet(["data", "twin", "--force", "--seed", "99", "--out"]);
    twin.arg(lab.path("twin.h5"))
        .args(["--materials", "4", "--sweeps", "10", "--steps", "120"]);
    expect(0, twin);
    let mut resume = tactnet(["train", "--resume"]);
    resume.arg(lab.path("run"));
    let message = stderr(&expect(2, resume));
    assert!(
        message.contains("has changed since the run began"),
        "{message}"
    );
}
