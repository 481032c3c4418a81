//! Trainings that end early: signals, a full disk, a second process, moved and changed data sets.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use crate::command::{Lab, assert_says, expect, messages_of, refusal, signal, stderr, tactnet};

/// Starts `command` and waits until it has finished an epoch.
fn start_and_wait_for_an_epoch(mut command: Command) -> Child {
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

/// Returns the small recipe with more epochs, which gives time to interrupt its training.
fn long_recipe(lab: &Lab, epochs: usize) -> PathBuf {
    lab.recipe_for(epochs)
}

/// Starts a training and interrupts it after an epoch.
fn interrupt(train: Command) {
    let mut child = start_and_wait_for_an_epoch(train);
    signal("INT", child.id());
    child.wait().unwrap();
}

/// Returns `tactnet train --resume` for a run of the lab.
fn resume(lab: &Lab, run: &str) -> Command {
    lab.command(&format!("train --resume @{run}"))
}

#[test]
fn an_interrupted_run_ends_with_the_very_same_weights() {
    let lab = Lab::new();
    let recipe = long_recipe(&lab, 60);
    expect(0, lab.train(&recipe, "whole"));
    for (name, signal_name, code) in [
        ("int", "INT", Some(130)),
        ("term", "TERM", Some(130)),
        ("kill", "KILL", None),
    ] {
        let mut child = start_and_wait_for_an_epoch(lab.train(&recipe, name));
        signal(signal_name, child.id());
        assert_eq!(child.wait().unwrap().code(), code, "{name}");
        assert!(
            !lab.path(name).join("result.json").exists(),
            "{name} was stopped too late to test"
        );
        expect(0, resume(&lab, name));
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
    let mut finished = resume(&lab, "whole");
    finished.arg("--json");
    let output = expect(0, finished);
    assert!(stderr(&output).contains("has already ended"));
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
    let run = lab.command(
        "experiment run crossval_baselines --out @out --set models=knn-l --set probes=[] \
         --set folds=1 --set repeats=1 --set data=@twin.h5",
    );
    expect(0, run);
    let [summary, page] = ["out/summary.json", "out/report.html"].map(|file| lab.read(file).len());
    let limit = summary.div_ceil(1024);
    assert!(
        page > 1024 * limit,
        "{page} bytes are more than {limit} KiB"
    );
    let message = stderr(&expect(
        1,
        limited(limit, &lab.command("experiment report @out")),
    ));
    assert!(message.contains("report.html: cannot write"), "{message}");
}

#[cfg(target_os = "linux")]
#[test]
fn results_that_cannot_be_printed_are_a_failure() {
    let lab = Lab::new();
    let mut info = lab.command("data info @twin.h5");
    let full = std::fs::File::create("/dev/full").unwrap();
    let status = info.stdout(full).stderr(Stdio::null()).status().unwrap();
    assert_eq!(status.code(), Some(1));
}

#[test]
fn a_full_disk_is_an_error_and_never_a_broken_checkpoint() {
    let lab = Lab::new();
    let recipe = long_recipe(&lab, 60);
    expect(0, lab.train(&recipe, "whole"));
    interrupt(lab.train(&recipe, "full"));
    let checkpoint = lab.read("full/checkpoint.safetensors");
    // A write fails halfway, as on a full disk. The limit is half a checkpoint, because the next one may be a few bytes
    // shorter.
    let limit = checkpoint.len() / 2048;
    let message = stderr(&expect(1, limited(limit, &resume(&lab, "full"))));
    assert_says!(message, "checkpoint.safetensors: cannot write");
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
    expect(0, resume(&lab, "full"));
    assert!(lab.read("whole/weights.safetensors") == lab.read("full/weights.safetensors"));
}

#[test]
fn two_processes_never_train_in_one_folder() {
    let lab = Lab::new();
    let recipe = long_recipe(&lab, 400);
    let mut child = start_and_wait_for_an_epoch(lab.train(&recipe, "run"));
    for second in [resume(&lab, "run"), lab.train(&recipe, "run")] {
        let message = refusal(second);
        assert_says!(message, "another process is training in this folder");
    }
    signal("INT", child.id());
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[test]
fn a_run_is_resumed_from_any_folder_and_a_moved_data_set_can_be_named() {
    let lab = Lab::new();
    let recipe = long_recipe(&lab, 60);
    let mut train = tactnet(["train", "--data", "twin.h5", "--out", "run", "--recipe"]);
    train.arg(&recipe).current_dir(lab.folder.path());
    interrupt(train);
    // From another folder than the one in which it was started.
    let moved = lab.path("moved.h5");
    std::fs::rename(lab.path("twin.h5"), &moved).unwrap();
    let lost = refusal(resume(&lab, "run"));
    let before = lab.path("twin.h5").display().to_string();
    assert!(lost.contains(&before), "{lost}");
    assert!(lost.contains("`--data FILE`"), "{lost}");
    let mut named = resume(&lab, "run");
    named.arg("--data").arg(&moved);
    // On the processor no GPU search takes place; it would print a line here.
    named.env_remove("XDG_RUNTIME_DIR");
    let said = messages_of(named);
    assert!(said.contains("continuing after step"), "{said}");
    assert!(!said.contains("XDG_RUNTIME_DIR"), "{said}");
    std::fs::rename(&moved, lab.path("twin.h5")).unwrap();
    let ended = messages_of(resume(&lab, "run"));
    assert!(ended.contains("has already ended"), "{ended}");
}

#[test]
fn a_changed_data_set_is_noticed_on_resume() {
    let lab = Lab::new();
    let recipe = long_recipe(&lab, 60);
    interrupt(lab.train(&recipe, "run"));
    let other = "--force --seed 99 --materials 4 --sweeps 10 --steps 120";
    lab.twin("twin.h5", other);
    let message = refusal(resume(&lab, "run"));
    assert_says!(message, "has changed since the run began");
}
