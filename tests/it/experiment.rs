//! `tactnet experiment` with real processes: results, folders, refusals and exports.

use std::process::Command;

use serde_json::Value;

use crate::command::{Lab, assert_says, expect, json, refusal, stderr, stdout, tactnet};

/// An experiment with two folds, a small network and a baseline on the small twin.
pub(crate) fn experiment(lab: &Lab, out: &str) -> Command {
    let recipe = lab.path("small.toml");
    if !recipe.exists() {
        lab.recipe_for(12);
    }
    let settings = "--set folds=2 --set data=@twin.h5 --set groups=2";
    let line = format!("experiment run crossval_baselines {settings} --out @{out}");
    let models = format!("models=[\"{}\", \"knn-l\"]", recipe.display());
    lab.command_with(&line, &["--set", &models])
}

pub(crate) const TASKS: [&str; 12] = [
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

pub(crate) fn predictions(lab: &Lab, out: &str) -> Vec<Vec<u8>> {
    let file = |task: &&str| lab.read(&format!("{out}/tasks/{task}/predictions_test.csv"));
    TASKS.iter().map(file).collect()
}

/// Returns an experiment of one task that fails, because its window is longer than the sweeps.
pub(crate) fn failing(lab: &Lab, out: &str) -> Command {
    let settings =
        "--set folds=1 --set data=twin --set probes=[] --set models=knn-h --set steps=40";
    lab.command(&format!(
        "experiment run crossval_baselines {settings} --out @{out}"
    ))
}

/// Every contender of the summary has its folds, files and confusion matrix, and the report has the split.
fn assert_summarised(lab: &Lab, summary: &Value) {
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
}

fn assert_nothing_runs_twice(lab: &Lab) {
    let written = |task: &str| {
        let path = lab.path("out/tasks").join(task).join("result.json");
        std::fs::metadata(path).unwrap().modified().unwrap()
    };
    let before: Vec<_> = TASKS.iter().map(|task| written(task)).collect();
    let again = expect(0, experiment(lab, "out"));
    assert_says!(stderr(&again), "12 tasks, 12 done");
    assert_eq!(
        before,
        TASKS.iter().map(|task| written(task)).collect::<Vec<_>>()
    );
}

#[test]
fn an_experiment_reports_every_task_and_runs_none_twice() {
    let lab = Lab::new();
    let mut command = experiment(&lab, "out");
    command.arg("--json");
    let output = expect(0, command);
    let summary: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(summary, lab.json("out/summary.json"));
    assert_eq!(
        (&summary["tasks"], &summary["tasks_done"]),
        (&12.into(), &12.into())
    );
    assert_summarised(&lab, &summary);
    assert_nothing_runs_twice(&lab);
    let mut other = experiment(&lab, "out");
    other.args(["--set", "folds=1"]);
    let refused = refusal(other);
    assert_says!(
        refused,
        "holds another experiment: its `folds` is 2, asked for is 1"
    );

    // A model whose recipe file changed is another model.
    let recipe = lab.path("small.toml");
    let changed = std::fs::read_to_string(&recipe)
        .unwrap()
        .replace("epochs = 12", "epochs = 11");
    std::fs::write(&recipe, changed).unwrap();
    let refused = refusal(experiment(&lab, "out"));
    assert_says!(refused, "the recipe of model `small` has changed");

    // The folder may be moved and then continued.
    std::fs::rename(lab.path("out"), lab.path("moved")).unwrap();
    std::fs::remove_dir_all(lab.path("moved/tasks").join(TASKS[2])).unwrap();
    let changed = std::fs::read_to_string(&recipe)
        .unwrap()
        .replace("epochs = 11", "epochs = 12");
    std::fs::write(&recipe, changed).unwrap();
    let again = expect(0, experiment(&lab, "moved"));
    assert_says!(stderr(&again), "12 tasks, 11 done");

    assert_an_edited_result_is_refused(&lab, "moved");
}

/// An accuracy that was edited together with its digests is not reported.
fn assert_an_edited_result_is_refused(lab: &Lab, experiment: &str) {
    let task = format!("{experiment}/tasks/twin-knn-l-run0-fold1");
    let mut forged = lab.json(&format!("{task}/result.json"));
    for evaluation in forged["evaluations"].as_object_mut().unwrap().values_mut() {
        evaluation["one_sweep"]["mean"] = 0.667.into();
    }
    std::fs::write(lab.path(&task).join("result.json"), forged.to_string()).unwrap();
    std::fs::remove_file(lab.path(&task).join("manifest.json")).unwrap();
    let refused = lab.refused(&format!("experiment report @{experiment}"));
    assert_says!(
        refused,
        "66.7 % of 8 by result.json: one of the two was edited"
    );
}

#[test]
fn without_an_output_folder_every_experiment_gets_its_own() {
    let lab = Lab::new();
    let whole_path = lab.path("twin.h5").display().to_string();
    for (folds, data) in [("folds=1", "twin.h5"), ("folds=2", &whole_path)] {
        let mut free = tactnet(["experiment", "run", "crossval_baselines", "--data", data]);
        for setting in ["models=means", "probes=[]", folds] {
            free.args(["--set", setting]);
        }
        free.current_dir(lab.folder.path());
        expect(0, free);
    }
    let second = lab.json("experiments-out/crossval_baselines-2/summary.json");
    assert_eq!(second["tasks"], 2);
}

#[test]
fn a_task_that_cannot_succeed_is_named_and_not_tried_again() {
    let lab = Lab::new();
    let said = stderr(&expect(1, failing(&lab, "out")));
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

/// Needs MLflow; `.ci/run` runs it with `--ignored` and `TACTNET_PYTHON`, a Python with MLflow.
#[test]
#[ignore = "needs Python with mlflow-skinny; .ci/run has one"]
fn mlflow_opens_the_export() {
    let lab = Lab::new();
    expect(0, experiment(&lab, "out"));
    let store = lab.path("ml runs");
    let more = [store.to_str().unwrap()];
    let export = lab.command_with("experiment export @out --mlflow", &more);
    expect(0, export);
    let python = std::env::var("TACTNET_PYTHON").unwrap_or("python3".into());
    let mut open = Command::new(python);
    open.arg("tests/open_with_mlflow.py").arg(&store);
    let found = json(open);
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
        let message = refusal(command);
        assert!(message.contains(said), "{message}");
        assert!(!lab.path("out").exists(), "nothing is left behind");
    }
    let mut full = tactnet(["experiment", "run", "crossval_baselines", "--set", &data]);
    full.arg("--out").arg(lab.folder.path());
    assert!(refusal(full).contains("needs a new or empty folder"));
}
