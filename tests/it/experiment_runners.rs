//! Runners of an experiment as processes: stopped, killed, two at once, and on a real Slurm if there is one.

use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::command::{Lab, assert_says, expect, messages_of, signal, stderr};
use crate::experiment::{TASKS, experiment, failing, predictions};

/// Returns the children of a process.
fn children(pid: u32) -> Vec<u32> {
    let path = format!("/proc/{pid}/task/{pid}/children");
    let text = std::fs::read_to_string(path).unwrap_or_default();
    text.split_whitespace()
        .map(|id| id.parse().unwrap())
        .collect()
}

/// Kills processes, which may have ended.
fn kill(processes: impl IntoIterator<Item = u32>) {
    for process in processes {
        let id = process.to_string();
        Command::new("kill").args(["-9", &id]).status().unwrap();
    }
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
fn a_runner_that_is_asked_to_stop_lets_its_task_write_a_checkpoint() {
    let lab = Lab::new();
    let mut runner = experiment(&lab, "out")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let network = lab.path("out/tasks/twin-small-run0-fold0");
    wait_for("the first epoch", || network.join("metrics.jsonl").exists());
    signal("INT", runner.id());
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

#[test]
fn killed_runners_and_tasks_lose_nothing_that_had_ended() {
    let lab = Lab::new();
    // Enough epochs that a task is killed before it ends.
    lab.recipe_for(30);
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
    kill(children(runner.id()));
    // Then the runner and its children are killed.
    let second = lab.path("killed/tasks/twin-small-run0-fold1");
    wait_for("the second network", || {
        second.join("metrics.jsonl").exists()
    });
    let orphans = children(runner.id());
    kill([runner.id()]);
    kill(orphans);
    runner.wait().unwrap();
    assert!(
        network.join("result.json").exists(),
        "what had ended is there"
    );
    assert!(!second.join("result.json").exists(), "what ran is not");

    let written = || {
        std::fs::metadata(network.join("result.json"))
            .unwrap()
            .modified()
            .unwrap()
    };
    let ended = written();
    // The folder contains everything that is needed.
    let refused = lab.refused("experiment run @killed --set folds=2");
    assert_says!(refused, "with the settings that it was started with");
    lab.run("experiment run @killed");
    assert_eq!(written(), ended);
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

/// Needs root and Debian's Slurm packages, which `tests/local-slurm start` installs; `.ci/run` runs it with `--ignored`.
#[test]
#[ignore = "needs a Slurm; .ci/run starts one"]
fn slurm_gives_the_same_bytes_as_this_machine() {
    let lab = Lab::new();
    expect(0, experiment(&lab, "local"));
    let mut command = experiment(&lab, "slurm");
    command.args(["--engine", "slurm"]);
    let said = messages_of(command);
    assert!(said.contains("12/12"), "{said}");
    assert!(
        predictions(&lab, "local") == predictions(&lab, "slurm"),
        "predictions are the same bytes"
    );
    let jobs = std::fs::read_dir(lab.path("slurm/slurm")).unwrap();
    assert!(jobs.count() > 8, "each task left a log");

    // A failed task is submitted again, and its log is shown.
    let mut broken = failing(&lab, "broken");
    broken.args(["--engine", "slurm"]);
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
    assert_says!(
        said,
        "squeue: not found; Slurm's client programs must be installed"
    );
}
