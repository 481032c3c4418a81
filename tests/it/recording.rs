//! Record, replay and import with real processes and channels.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use serde_json::Value;
use tactnet_recording::{RecordedPacket, Recording};

use crate::command::{assert_says, expect, json, messages_of, output_of, refusal, signal, tactnet};
use crate::robot::{Robot, Running, STEPS};

fn recorder(robot: &Robot, file: &str, more: &[&str]) -> Running {
    let mut record = robot.lab.command("record --json --table @robot.toml");
    record.arg("--out").arg(robot.lab.path(file)).args(more);
    Running::start(record)
}

fn replay(file: &Path, more: &[&str]) -> Value {
    let mut replay = tactnet(["replay", "--json"]);
    replay.arg(file).args(more);
    json(replay)
}

fn import(file: &Path, out: &Path, more: &[&str]) -> Command {
    let mut import = tactnet(["data", "import"]);
    import.arg(file).arg("--out").arg(out).args(more);
    import
}

fn frames_of(recording: &Recording) -> Vec<(u64, Vec<f32>)> {
    let packets = recording.entries.iter().map(|entry| &entry.packet);
    packets
        .filter_map(|packet| match packet {
            RecordedPacket::Frame(frame) => Some((frame.sequence, frame.values().to_vec())),
            _ => None,
        })
        .collect()
}

/// Plays `sweeps` sweeps of the simulated skin while everything is recorded.
fn recorded(robot: &Robot, file: &str, sweeps: &str, more: &[&str]) -> (PathBuf, Value) {
    let _hub = robot.start(&["channel", "hub"]);
    let service = robot.serve("models/1");
    let recorder = recorder(robot, file, more);
    let mut skin = robot.skin(sweeps);
    assert!(skin.0.wait().unwrap().success());
    // Wait for the last beliefs.
    std::thread::sleep(Duration::from_millis(500));
    let told = serde_json::from_str(&recorder.end()).unwrap();
    service.end();
    (robot.lab.path(file), told)
}

/// Every sweep of a file was played, with the same digits and material; returns their number.
fn assert_played(robot: &Robot, file: &Path) -> usize {
    let played = tactnet_data::format::read(&robot.lab.path("data.h5")).unwrap();
    let imported = tactnet_data::format::read(file).unwrap();
    assert_eq!(imported.shape(), played.shape());
    for (number, record) in imported.records().iter().enumerate() {
        let name = imported.labels().name(record.label);
        let sweep = imported.sweep(number);
        let found = (0..played.len()).find(|index| played.sweep(*index) == sweep);
        let original = found.expect("a sweep that was played");
        assert_eq!(played.labels().name(played.records()[original].label), name);
    }
    imported.len()
}

#[test]
fn what_was_recorded_is_believed_again_bit_by_bit_and_becomes_a_data_set() {
    let robot = Robot::new("record");
    let run = robot.lab.path("models/1").display().to_string();
    let (file, told) = recorded(&robot, "a.mcap", "6", &["--run", &run]);
    assert_eq!(told["lost"], 0, "{told}");
    let again = replay(&file, &[]);
    assert_eq!(again["frames"], told["frames"], "{again}");
    assert_eq!(again["frames_lost"], 0, "{again}");
    assert_eq!(again["recorded"]["sweeps"], 6, "{again}");
    // Three anytime beliefs, one plain, one with dropout.
    assert_eq!(again["recorded"]["beliefs"], 6 * 5, "{again}");
    assert_eq!(again["identical"], true, "{again}");
    assert_eq!(
        again["posterior_sha256"], again["recorded"]["posterior_sha256"],
        "{again}"
    );
    // Faster, with a named classifier.
    let fast = replay(&file, &["--run", &run, "--speed", "3"]);
    assert_eq!(
        fast["posterior_sha256"], again["posterior_sha256"],
        "{fast}"
    );
    assert_eq!(fast["frames_lost"], 0, "{fast}");
    assert_eq!(fast["another_asked"], false, "{fast}");
    assert!(fast["seconds"].as_f64().unwrap() < again["seconds"].as_f64().unwrap());

    // Another classifier gives other predictions, which the report shows.
    let other = robot
        .lab
        .command("train --epochs 1 --data @data.h5 --recipe @small.toml --out @other");
    expect(0, other);
    let other = robot.lab.path("other").display().to_string();
    let unlike = replay(&file, &["--run", &other, "--speed", "3"]);
    assert_eq!(unlike["identical"], false, "{unlike}");
    assert_eq!(unlike["another_asked"], true, "{unlike}");
    assert_eq!(unlike["sweeps"], 6, "{unlike}");

    // The sweeps equal the played ones, digit by digit.
    let out = robot.lab.path("again.npz");
    let said = messages_of(import(&file, &out, &[]));
    assert!(said.contains("6 sweeps"), "{said}");
    let imported = assert_played(&robot, &out);
    assert_eq!(imported, 6);
    // The numbers of sweeps per material differ.
    let unequal = robot.lab.path("unequal.h5");
    let refused = refusal(import(&file, &unequal, &[]));
    assert!(refused.contains(".npz does not"), "{refused}");
    // An existing file is never overwritten.
    let twice = refusal(import(&file, &out, &[]));
    assert!(twice.contains("exists already"), "{twice}");
}

/// The last seconds before a trigger, written by a signal and by a packet, are replayed bit by bit like a whole recording.
#[test]
fn the_seconds_before_a_trigger_are_written_and_replayed() {
    let robot = Robot::new("before");
    let run = robot.lab.path("models/1").display().to_string();
    let hub = robot.start(&["channel", "hub"]);
    let service = robot.serve("models/1");
    let whole = ["--before", "20", "--memory", "16", "--run", &run];
    let whole = recorder(&robot, "whole.mcap", &whole);
    let short = [
        "--before",
        "0.4",
        "--channel",
        "skin/*",
        "--trigger",
        "tactile/belief",
    ];
    let short = recorder(&robot, "short.mcap", &short);
    let mut skin = robot.skin("3");
    assert!(skin.0.wait().unwrap().success());
    std::thread::sleep(Duration::from_millis(500));
    signal("USR1", whole.0.id());
    let told = ended(whole);
    assert!(told["short"].is_null(), "{told}");
    service.end();
    drop(hub);
    let again = replay(&robot.lab.path("whole.mcap"), &["--speed", "2"]);
    assert_eq!(again["frames"], told["frames"], "{again}");
    assert_eq!(
        (&again["identical"], &again["recorded"]["sweeps"]),
        (&true.into(), &3.into()),
        "{again}"
    );

    // The first belief comes during the first sweep.
    let told = ended(short);
    let recording = Recording::read(&robot.lab.path("short.mcap")).unwrap();
    let frames = recording.entries.len() as u64;
    assert_eq!(
        (told["frames"].as_u64(), told["channels"].as_u64()),
        (Some(frames), Some(1))
    );
    let [first, last] = [0, recording.entries.len() - 1].map(|at| recording.entries[at].time_ns);
    assert!(frames > 0 && last - first <= 400_000_000, "{told}");
}

/// Waits until a process ends by itself, and returns its document.
fn ended(mut running: Running) -> Value {
    assert!(running.0.wait().unwrap().success());
    serde_json::from_reader(running.0.stdout.take().unwrap()).unwrap()
}

/// Returns the number of frames of a recording, and true if its end is missing.
fn frames_and_cut(file: &Path) -> (usize, bool) {
    let recording = Recording::read(file).unwrap();
    (frames_of(&recording).len(), recording.cut.is_some())
}

/// A flipped bit is either detected or in unused bytes. No wrong data is read, and nothing panics.
///
/// - `damaged`: file to which the damaged copies are written
fn assert_damage_gives_no_wrong_frames(file: &Path, damaged: &Path) {
    let whole = std::fs::read(file).unwrap();
    let true_frames: Vec<_> = frames_of(&Recording::read(file).unwrap());
    for at in (0..whole.len()).step_by(whole.len() / 300) {
        let mut flipped = whole.clone();
        flipped[at] ^= 0x10;
        std::fs::write(damaged, &flipped).unwrap();
        if let Ok(recording) = Recording::read(damaged) {
            let found = frames_of(&recording);
            assert!(
                true_frames.starts_with(&found),
                "byte {at}: {} frames",
                found.len()
            );
        }
    }
    for length in (0..whole.len()).step_by(whole.len() / 100) {
        std::fs::write(damaged, &whole[..length]).unwrap();
        let _ = Recording::read(damaged);
    }
}

#[test]
fn a_killed_recorder_loses_the_last_second_at_most_and_cut_files_are_read_as_far_as_they_go() {
    let robot = Robot::new("cut");
    let hub = robot.start(&["channel", "hub"]);
    let recorder = recorder(&robot, "cut.mcap", &["--material", "felt"]);
    let mut skin = robot.skin("14");
    // Fourteen motions take about 3.5 seconds.
    std::thread::sleep(Duration::from_millis(2500));
    // The process is killed as by `kill -9`.
    drop(recorder);
    let file = robot.lab.path("cut.mcap");
    let (frames, cut) = frames_and_cut(&file);
    assert!(cut);
    // At 750 frames per second, with a loss of one second.
    assert!(frames > 750, "{frames}");
    assert!(skin.0.wait().unwrap().success());
    drop(hub);

    let out = robot.lab.path("cut.h5");
    let steps = STEPS.to_string();
    let said = messages_of(import(&file, &out, &["--steps", &steps]));
    assert!(said.contains("the end is missing"), "{said}");
    let whole = std::fs::read(&file).unwrap();
    let shorter = robot.lab.path("shorter.mcap");
    let mut before = frames;
    for share in [9, 7, 2] {
        std::fs::write(&shorter, &whole[..whole.len() * share / 10]).unwrap();
        let (frames, cut) = frames_and_cut(&shorter);
        assert!(cut && frames <= before, "{frames} of {before}");
        // Two chunks of one second each; the first is complete.
        assert_eq!(frames > 0, share >= 7, "{frames} in {share} tenths");
        before = frames;
    }
    assert_damage_gives_no_wrong_frames(&file, &shorter);
    // A file that is not a recording is a one-line error.
    std::fs::write(&shorter, b"no recording").unwrap();
    let mut none = tactnet(["replay"]);
    none.arg(&shorter);
    let none = refusal(none);
    assert!(none.contains("not an MCAP file"), "{none}");
    assert_eq!(none.trim().lines().count(), 1, "{none}");
    let mut without = tactnet(["replay"]);
    without.arg(&file);
    let without = refusal(without);
    assert_says!(without, "name a run directory with `--run`");
}

#[test]
#[ignore = "needs TACTNET_PYTHON, a Python with mcap, mcap-protobuf-support, numpy, onnx and onnxruntime"]
fn python_opens_a_recording_and_runs_the_exported_network_on_it() {
    let python = std::env::var("TACTNET_PYTHON").expect("TACTNET_PYTHON names a Python");
    let robot = Robot::new("python");
    let (file, _) = recorded(&robot, "a.mcap", "4", &[]);
    let mut check = Command::new(python);
    check.arg("tests/check_recording.py").arg(file);
    for (name, options) in [("a.onnx", ""), ("b.onnx", "--masks")] {
        let line = format!("export @models/1 {options} --out @{name}");
        robot.lab.run(&line);
        check.arg(robot.lab.path(name));
    }
    let said = output_of(check);
    assert!(said.contains("fine"), "{said}");
}
