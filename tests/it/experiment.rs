//! `tactnet experiment` with real processes: resumed, killed, shared, and on a real Slurm if there is one.

use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::command::{Lab, RecipeChange, expect, stderr, stdout, tactnet};

/// An experiment with two folds, a small network and a baseline on the small twin.
fn experiment(lab: &Lab, out: &str) -> Command {
    let recipe = lab.path("small.toml");
    if !recipe.exists() {
        lab.recipe(RecipeChange {
            epochs: Some(12),
            ..RecipeChange::default()
        });
    }
    let mut command = tactnet([
        "experiment",
        "run",
        "crossval_baselines",
        "--set",
        "folds=2",
    ]);
    command
        .arg("--set")
        .arg(format!("data={}", lab.path("twin.h5").display()))
        .arg("--set")
        .arg(format!("models=[\"{}\", \"knn-l\"]", recipe.display()))
        .args(["--set", "groups=2"])
        .arg("--out")
        .arg(lab.path(out));
    command
}

const TASKS: [&str; 12] = [
    "twin-probe_means-run0-fold0",
    "twin-probe_first_frame-run0-fold0",
    "twin-probe_last_frame-run0-fold0",
    "twin-probe_permuted-run0-fold0",
    "twin-small-run0-fold0",
    "twin-knn-l-run0-fold0",
    "twin-probe_means-run0-fold1",
    "twin-probe_first_frame-run0-fold1",
    "twin-probe_last_frame-run0-fold1",
    "twin-probe_permuted-run0-fold1",
    "twin-small-run0-fold1",
    "twin-knn-l-run0-fold1",
];

fn predictions(lab: &Lab, out: &str) -> Vec<Vec<u8>> {
    let file = |task: &&str| lab.read(&format!("{out}/tasks/{task}/predictions_test.csv"));
    TASKS.iter().map(file).collect()
}

#[test]
fn an_experiment_reports_every_task_and_runs_none_twice() {
    let lab = Lab::new();
    let mut command = experiment(&lab, "out");
    command.arg("--json");
    let output = expect(0, command);
    let summary: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(summary, lab.json("out/summary.json"));
    assert_eq!(
        (&summary["tasks"], &summary["tasks_done"]),
        (&12.into(), &12.into())
    );
    // Four probes, the network with two prediction methods, one baseline.
    let contenders = summary["contenders"].as_array().unwrap();
    assert_eq!(contenders.len(), 7);
    for row in contenders {
        assert_eq!(row["folds"].as_array().unwrap().len(), 2);
        for fold in row["folds"].as_array().unwrap() {
            let file = fold["predictions"].as_str().unwrap();
            assert!(lab.path("out").join(file).is_file(), "{file}");
        }
        let tested: u64 = row["confusion"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(|counts| counts.as_array().unwrap())
            .map(|count| count.as_u64().unwrap())
            .sum();
        assert_eq!(tested, 16);
    }
    let result = lab.json("out/tasks/twin-knn-l-run0-fold1/result.json");
    let rows = summary["rows"].as_array().unwrap();
    let row = rows.iter().find(|row| {
        (&row["model"], &row["measure"], &row["sweeps"])
            == (&"knn-l".into(), &"accuracy".into(), &1.into())
    });
    assert_eq!(
        row.unwrap()["values"][1],
        result["accuracy_one_sweep"]["mean"]
    );
    let page = String::from_utf8(lab.read("out/report.html")).unwrap();
    assert!(page.starts_with("<!doctype html>") || page.starts_with("<!DOCTYPE html>"));
    assert!(page.contains(result["split_sha256"].as_str().unwrap()));

    let written = |task: &str| {
        let path = lab.path("out/tasks").join(task).join("result.json");
        std::fs::metadata(path).unwrap().modified().unwrap()
    };
    let before: Vec<_> = TASKS.iter().map(|task| written(task)).collect();
    let again = expect(0, experiment(&lab, "out"));
    assert!(
        stderr(&again).contains("12 tasks, 12 done"),
        "{}",
        stderr(&again)
    );
    assert_eq!(
        before,
        TASKS.iter().map(|task| written(task)).collect::<Vec<_>>()
    );

    let mut other = experiment(&lab, "out");
    other.args(["--set", "folds=1"]);
    let refused = stderr(&expect(2, other));
    assert!(
        refused.contains("holds another experiment: its `folds` is 2, asked for is 1"),
        "{refused}"
    );

    // Without `--out` another folder is created for it.
    let mut free = tactnet([
        "experiment",
        "run",
        "crossval_baselines",
        "--set",
        "models=means",
    ]);
    free.args([
        "--set",
        "probes=[]",
        "--set",
        "folds=1",
        "--data",
        "twin.h5",
    ]);
    free.current_dir(lab.folder.path());
    expect(0, free);
    let mut free = tactnet([
        "experiment",
        "run",
        "crossval_baselines",
        "--set",
        "models=means",
    ]);
    free.args(["--set", "probes=[]", "--set", "folds=2", "--data"]);
    free.arg(lab.path("twin.h5")).current_dir(lab.folder.path());
    expect(0, free);
    let second = lab.json("experiments-out/crossval_baselines-2/summary.json");
    assert_eq!(second["tasks"], 2);

    // A model whose recipe file changed is another model.
    let recipe = lab.path("small.toml");
    let changed = std::fs::read_to_string(&recipe)
        .unwrap()
        .replace("epochs = 12", "epochs = 11");
    std::fs::write(&recipe, changed).unwrap();
    let refused = stderr(&expect(2, experiment(&lab, "out")));
    assert!(
        refused.contains("the recipe of model `small` has changed"),
        "{refused}"
    );

    // The folder may be moved and then continued.
    std::fs::rename(lab.path("out"), lab.path("moved")).unwrap();
    std::fs::remove_dir_all(lab.path("moved/tasks").join(TASKS[2])).unwrap();
    let changed = std::fs::read_to_string(&recipe)
        .unwrap()
        .replace("epochs = 11", "epochs = 12");
    std::fs::write(&recipe, changed).unwrap();
    let again = expect(0, experiment(&lab, "moved"));
    assert!(
        stderr(&again).contains("12 tasks, 11 done"),
        "{}",
        stderr(&again)
    );

    // An accuracy that was edited together with its digests is not reported.
    let task = lab.path("moved/tasks/twin-knn-l-run0-fold1");
    let mut forged = lab.json("moved/tasks/twin-knn-l-run0-fold1/result.json");
    for evaluation in forged["evaluations"].as_object_mut().unwrap().values_mut() {
        evaluation["one_sweep"]["mean"] = 0.667.into();
    }
    std::fs::write(task.join("result.json"), forged.to_string()).unwrap();
    std::fs::remove_file(task.join("manifest.json")).unwrap();
    let mut report = tactnet(["experiment", "report"]);
    report.arg(lab.path("moved"));
    let refused = stderr(&expect(2, report));
    assert!(
        refused.contains("66.7 % of 8 by result.json: one of the two was edited"),
        "{refused}"
    );
}

#[test]
fn a_runner_that_is_asked_to_stop_lets_its_task_write_a_checkpoint() {
    let lab = Lab::new();
    let mut runner = experiment(&lab, "out")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let network = lab.path("out/tasks/twin-small-run0-fold0");
    wait_for("the first epoch", || network.join("metrics.jsonl").exists());
    Command::new("kill")
        .args(["-INT", &runner.id().to_string()])
        .status()
        .unwrap();
    assert_eq!(runner.wait().unwrap().code(), Some(130));
    let log = String::from_utf8(lab.read("out/tasks/twin-small-run0-fold0.log")).unwrap();
    let ended = network.join("result.json").exists();
    assert!(
        ended
            || log
                .trim_end()
                .lines()
                .last()
                .unwrap()
                .starts_with("stopped; continue"),
        "{log}"
    );
    assert!(network.join("checkpoint.safetensors").exists());
    expect(0, experiment(&lab, "out"));
}

/// Returns the children of a process.
fn children(pid: u32) -> Vec<u32> {
    let path = format!("/proc/{pid}/task/{pid}/children");
    let text = std::fs::read_to_string(path).unwrap_or_default();
    text.split_whitespace()
        .map(|id| id.parse().unwrap())
        .collect()
}

fn kill_9(pid: u32) {
    Command::new("kill")
        .args(["-9", &pid.to_string()])
        .status()
        .unwrap();
}

fn wait_for(what: &str, ready: impl Fn() -> bool) {
    let begun = Instant::now();
    while !ready() {
        assert!(
            begun.elapsed() < Duration::from_secs(120),
            "waited for {what} in vain"
        );
        sleep(Duration::from_millis(5));
    }
}

#[test]
fn killed_runners_and_tasks_lose_nothing_that_had_ended() {
    let lab = Lab::new();
    // Enough epochs that a task is killed before it ends.
    lab.recipe(RecipeChange {
        epochs: Some(30),
        ..RecipeChange::default()
    });
    expect(0, experiment(&lab, "undisturbed"));

    // A task is killed, and the runner starts it again. One task runs at a time, so that it is known which one.
    let mut runner = experiment(&lab, "killed")
        .args(["--jobs", "1"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let network = lab.path("killed/tasks/twin-small-run0-fold0");
    wait_for("the first epoch", || network.join("metrics.jsonl").exists());
    children(runner.id()).into_iter().for_each(kill_9);
    // Then the runner and its children are killed.
    let second = lab.path("killed/tasks/twin-small-run0-fold1");
    wait_for("the second network", || {
        second.join("metrics.jsonl").exists()
    });
    let orphans = children(runner.id());
    kill_9(runner.id());
    orphans.into_iter().for_each(kill_9);
    runner.wait().unwrap();
    assert!(
        network.join("result.json").exists(),
        "what had ended is there"
    );
    assert!(!second.join("result.json").exists(), "what ran is not");

    let ended = network
        .join("result.json")
        .metadata()
        .unwrap()
        .modified()
        .unwrap();
    // The folder contains everything that is needed.
    let mut set = tactnet(["experiment", "run"]);
    set.arg(lab.path("killed")).args(["--set", "folds=2"]);
    let refused = stderr(&expect(2, set));
    assert!(
        refused.contains("with the settings that it was started with"),
        "{refused}"
    );
    let mut go_on = tactnet(["experiment", "run"]);
    go_on.arg(lab.path("killed"));
    expect(0, go_on);
    assert_eq!(
        network
            .join("result.json")
            .metadata()
            .unwrap()
            .modified()
            .unwrap(),
        ended
    );
    assert!(
        predictions(&lab, "killed") == predictions(&lab, "undisturbed"),
        "predictions are the same bytes"
    );
}

#[test]
fn two_runners_share_a_folder() {
    let lab = Lab::new();
    let runners: Vec<_> = (0..2)
        .map(|_| {
            let mut command = experiment(&lab, "shared");
            command
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()
                .unwrap()
        })
        .collect();
    for runner in runners {
        let output = runner.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(!stderr(&output).contains("failed"), "{}", stderr(&output));
    }
    for task in TASKS {
        // Only the training process writes this line to the task's log: there is one.
        let log = String::from_utf8(lab.read(&format!("shared/tasks/{task}.log"))).unwrap();
        assert_eq!(
            log.matches("predicting 8 test sweeps").count(),
            1,
            "{task}: {log}"
        );
    }
}

#[test]
fn a_task_that_cannot_succeed_is_named_and_not_tried_again() {
    let lab = Lab::new();
    let mut command = tactnet([
        "experiment",
        "run",
        "crossval_baselines",
        "--set",
        "folds=1",
    ]);
    command
        .args([
            "--set",
            "data=twin",
            "--set",
            "probes=[]",
            "--set",
            "models=knn-h",
            "--set",
            "steps=40",
        ])
        .arg("--out")
        .arg(lab.path("out"));
    let said = stderr(&expect(1, command));
    assert_eq!(said.matches("failed (attempt").count(), 1, "{said}");
    assert_eq!(
        said.matches("error:").count(),
        1,
        "before the last line: {said}"
    );
    assert!(
        said.contains("1 of 1 tasks failed") && said.contains("a window of 0.1 s"),
        "{said}"
    );
}

/// Needs root and Debian's Slurm packages, which `tests/local-slurm start` installs; `.ci/run` runs it with `--ignored`.
#[test]
#[ignore = "needs a Slurm; .ci/run starts one"]
fn slurm_gives_the_same_bytes_as_this_machine() {
    let lab = Lab::new();
    expect(0, experiment(&lab, "local"));
    let mut command = experiment(&lab, "slurm");
    command.args(["--engine", "slurm"]);
    let said = stderr(&expect(0, command));
    assert!(said.contains("12/12"), "{said}");
    assert!(
        predictions(&lab, "local") == predictions(&lab, "slurm"),
        "predictions are the same bytes"
    );
    let jobs = std::fs::read_dir(lab.path("slurm/slurm")).unwrap();
    assert!(jobs.count() > 8, "each task left a log");

    // A failed task is submitted again, and its log is shown.
    let mut broken = tactnet([
        "experiment",
        "run",
        "crossval_baselines",
        "--engine",
        "slurm",
    ]);
    broken
        .args([
            "--set",
            "folds=1",
            "--set",
            "probes=[]",
            "--set",
            "models=knn-h",
            "--set",
            "steps=40",
        ])
        .arg("--out")
        .arg(lab.path("broken"));
    let said = stderr(&expect(1, broken));
    assert_eq!(said.matches("failed (attempt").count(), 3, "{said}");
    assert!(said.contains("a window of 0.1 s"), "{said}");
}

#[test]
fn slurm_that_is_not_there_is_said_in_one_line() {
    let lab = Lab::new();
    let mut command = experiment(&lab, "out");
    command
        .args(["--engine", "slurm"])
        .env("PATH", Path::new("/nowhere"));
    let said = stderr(&expect(1, command));
    assert!(
        said.contains("sbatch: not found; Slurm's client programs must be installed"),
        "{said}"
    );
}

/// Needs MLflow; `.ci/run` runs it with `--ignored` and `TACTNET_PYTHON`, a Python with MLflow.
#[test]
#[ignore = "needs Python with mlflow-skinny; .ci/run has one"]
fn mlflow_opens_the_export() {
    let lab = Lab::new();
    expect(0, experiment(&lab, "out"));
    let export = |out: &str| {
        let mut command = tactnet(["experiment", "export"]);
        command
            .arg(lab.path("out"))
            .arg("--mlflow")
            .arg(lab.path(out));
        command
    };
    expect(0, export("ml runs"));
    assert!(stderr(&expect(2, export("ml runs"))).contains("empty or new folder"));
    let python = std::env::var("TACTNET_PYTHON").unwrap_or("python3".into());
    let mut open = Command::new(python);
    open.arg("tests/open_with_mlflow.py")
        .arg(lab.path("ml runs"));
    let found: serde_json::Value = serde_json::from_str(&stdout(&expect(0, open))).unwrap();
    let runs = found["crossval_baselines"].as_object().unwrap();
    assert_eq!(runs.len(), TASKS.len());
    for task in TASKS {
        let result = lab.json(&format!("out/tasks/{task}/result.json"));
        let run = &runs[task];
        assert_eq!(run["status"], "FINISHED");
        assert_eq!(
            run["metrics"]["plain.accuracy"],
            result["evaluations"]["plain"]["one_sweep"]["mean"]
        );
        assert_eq!(run["params"]["split_sha256"], result["split_sha256"]);
        assert!(
            run["artifacts"]
                .as_array()
                .unwrap()
                .contains(&"predictions_test.csv".into())
        );
        assert_eq!(
            run["epochs"],
            if task.contains("small") { 12 } else { 0 },
            "{task}"
        );
    }
}

#[test]
fn what_cannot_be_planned_is_refused_before_anything_runs() {
    let lab = Lab::new();
    let data = format!("data={}", lab.path("twin.h5").display());
    let copy = lab.path("knn-l.toml");
    std::fs::write(
        &copy,
        "name = \"mine\"\nfeatures = \"l\"\nclassifier = { kind = \"knn\", neighbours = [1] }\n",
    )
    .unwrap();
    let models = format!("models=[\"knn-l\", \"{}\"]", copy.display());
    for (settings, said) in [
        (
            vec!["data=nowhere.h5"],
            "nowhere.h5: file: expected a data set",
        ),
        (vec![&data, "folds=6"], "expected 1 to 5, found 6"),
        (vec![&data, &models], "two tasks would be called"),
        (vec![&data, "models=[\"knn-x\"]"], "knn-x"),
        (
            vec![&data, "split=[\"k-fold\", \"k-fold\"]"],
            "two tasks would be called",
        ),
    ] {
        let mut command = tactnet(["experiment", "run", "crossval_baselines"]);
        for setting in settings {
            command.args(["--set", setting]);
        }
        command.arg("--out").arg(lab.path("out"));
        let message = stderr(&expect(2, command));
        assert!(message.contains(said), "{message}");
        assert!(!lab.path("out").exists(), "nothing is left behind");
    }
    let mut full = tactnet(["experiment", "run", "crossval_baselines", "--set", &data]);
    full.arg("--out").arg(lab.folder.path());
    assert!(stderr(&expect(2, full)).contains("needs a new or empty folder"));
}
