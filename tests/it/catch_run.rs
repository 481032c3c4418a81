//! The complete catching stack as processes in the simulated world.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use crate::command::{expect, json, signal, stderr, tactnet};
use crate::robot::{Robot, Running};

/// A run as a child process, with its output.
pub(crate) struct Run {
    child: Child,
    said: std::sync::mpsc::Receiver<String>,
    heard: Vec<String>,
}

impl Run {
    pub(crate) fn start(arguments: &[&str]) -> Self {
        let mut command = tactnet(["catch", "run", "--json"]);
        command.args(arguments);
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let errors = BufReader::new(child.stderr.take().unwrap());
        let (line, said) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            for text in errors.lines().map_while(Result::ok) {
                if line.send(text).is_err() {
                    break;
                }
            }
        });
        Self {
            child,
            said,
            heard: Vec::new(),
        }
    }

    /// Waits for a line with this beginning and keeps all lines so far.
    pub(crate) fn wait_for(&mut self, beginning: &str) -> String {
        self.wait_until(beginning, |line| line.starts_with(beginning))
    }

    /// Waits for a line that contains these words.
    pub(crate) fn wait_with(&mut self, words: &str) -> String {
        self.wait_until(words, |line| line.contains(words))
    }

    fn wait_until(&mut self, wanted: &str, is: impl Fn(&str) -> bool) -> String {
        let begun = Instant::now();
        loop {
            match self.said.recv_timeout(Duration::from_millis(200)) {
                Ok(line) => {
                    self.heard.push(line.clone());
                    if is(&line) {
                        return line;
                    }
                }
                Err(_) if begun.elapsed() < Duration::from_secs(90) => {}
                Err(_) => {
                    // Otherwise its processes would run forever.
                    signal("TERM", self.child.id());
                    panic!("no `{wanted}`: {:?}", self.heard);
                }
            }
        }
    }

    /// Returns names and ids of its processes.
    pub(crate) fn processes(&mut self) -> BTreeMap<String, u32> {
        let line = self.wait_for("started: ");
        line["started: ".len()..]
            .split(", ")
            .map(|part| {
                let (name, number) = part.split_once(' ').unwrap();
                (name.to_string(), number.parse().unwrap())
            })
            .collect()
    }

    /// Asks the run to end and returns its report.
    pub(crate) fn end(mut self) -> serde_json::Value {
        signal("TERM", self.child.id());
        let output = self.child.wait_with_output().unwrap();
        assert!(output.status.success(), "{:?}", self.heard);
        self.heard.clear();
        serde_json::from_slice(&output.stdout).unwrap()
    }
}

fn is_there(process: u32) -> bool {
    Path::new(&format!("/proc/{process}/exe")).exists()
}

#[test]
fn a_live_run_catches_and_ends_all_its_processes() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("run.mcap");
    let file_name = file.to_str().unwrap();
    let mut run = Run::start(&["--seed", "3", "--planners", "2", "--record", file_name]);
    let processes = run.processes();
    let names: Vec<&str> = processes.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        [
            "controller",
            "coordinator",
            "hand",
            "planner-left",
            "planner-left-2",
            "planner-right",
            "planner-right-2",
            "pose",
            "safety",
            "tracker",
            "world"
        ]
    );
    // The ground truth stays in the world's process. The stack has only the robot's bus open, and all of its files are
    // accounted for.
    for (name, process) in &processes {
        let maps = std::fs::read_to_string(format!("/proc/{process}/maps")).unwrap();
        assert!(
            maps.contains("/dev/shm") || maps.contains("tactnet"),
            "{name}: a bus"
        );
        assert!(!maps.contains("truth"), "{name}: {maps}");
    }
    run.wait_for("throw 2:");
    let report = run.end();
    for process in processes.values() {
        assert!(!is_there(*process), "left behind");
    }
    assert!(report["balls"].as_u64().unwrap() >= 2);
    assert!(report["processes"]["controller"]["count"].as_u64().unwrap() > 3000);
    assert!(
        report["exposure_to_path_ms"]["p50"].as_f64().unwrap() > 40.0,
        "{report}"
    );
    assert_eq!(report["restarts"], 0);
    a_recording_tells_the_same(&file, &report);
}

/// The replayed times equal those of the run, and tracker, coordinator and planners reproduce their results.
pub(crate) fn a_recording_tells_the_same(file: &Path, report: &serde_json::Value) {
    let picture = file.with_extension("svg");
    let mut timing = tactnet(["catch", "timing", "--json", "--picture"]);
    timing.arg(&picture).arg(file);
    let timing: serde_json::Value = json(timing);
    let steps = timing["steps"].as_array().unwrap();
    let of = |name: &str| steps.iter().find(|step| step["name"] == name).unwrap();
    let (mut ended, names) = (0.0, ["circles", "prediction", "question", "plan", "path"]);
    for name in names {
        let ends = of(name)["ends_ms"]["p50"].as_f64().unwrap();
        assert!(ends >= ended, "{name}: {timing}");
        ended = ends;
    }
    // The run's own listener may miss a packet.
    let (told, recorded) = (
        &report["exposure_to_path_ms"],
        &timing["exposure_to_path_ms"],
    );
    let apart = told["p50"].as_f64().unwrap() - recorded["p50"].as_f64().unwrap();
    assert!(apart.abs() < 1.0, "{told} {recorded}");
    assert!(timing["paths"].as_u64().unwrap() > 0);
    assert!(timing["beat_to_command_ms"]["count"].as_u64().unwrap() > 3000);
    let svg = std::fs::read_to_string(&picture).unwrap();
    assert!(svg.contains("152 ms") && svg.contains("planner"), "{svg}");
    let mut replay = tactnet(["catch", "replay", "--json"]);
    replay.arg(file);
    let replayed = json(replay);
    for part in ["plans", "predictions", "decisions"] {
        assert!(
            replayed[part]["answers"].as_u64().unwrap() > 5,
            "{replayed}"
        );
        assert_eq!(
            replayed[part]["same"], replayed[part]["answers"],
            "{replayed}"
        );
    }
}

/// The channel tools decode the stack's packets from any sender.
#[test]
fn packets_of_the_stack_are_echoed_and_recorded() {
    let place = tempfile::tempdir().unwrap();
    let table = place.path().join("robot.toml");
    let printed = tactnet(["catch", "role", "--print-table"])
        .output()
        .unwrap();
    let name = format!("bus = \"packets{}\"", std::process::id());
    let text = String::from_utf8(printed.stdout).unwrap();
    std::fs::write(&table, text.replace("bus = \"robot\"", &name)).unwrap();
    let on_table = |words: &[&str]| {
        let mut command = tactnet(words.iter().copied());
        command.arg("--table").arg(&table).stdin(Stdio::null());
        command
    };
    let hub = Running::start(on_table(&["channel", "hub"]));
    let world = Running::start(on_table(&["catch", "role", "world"]));
    let echo = ["channel", "echo", "joint/state", "--count", "1", "--json"];
    let state = json(on_table(&echo));
    let packet = &state["packet"];
    assert_eq!(
        (&packet["type"], state["bytes"].as_u64()),
        (&"JointState".into(), Some(496))
    );
    assert_eq!(packet["q"].as_array().unwrap().len(), 20, "{state}");
    let echoed = on_table(&["channel", "echo", "imu", "--count", "1"])
        .output()
        .unwrap();
    let line = String::from_utf8(echoed.stdout).unwrap();
    assert!(
        line.contains("ImuSample number") && line.contains("acceleration ["),
        "{line}"
    );
    let file = place.path().join("world.mcap");
    let mut record = on_table(&["record", "--seconds", "1", "--json"]);
    record.arg("--out").arg(&file);
    let output = record.output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    let told: serde_json::Value = serde_json::from_str(said.trim_start_matches("ready\n")).unwrap();
    assert!(told["messages"].as_u64().unwrap() > 1000, "{told}");
    assert_eq!(
        (told["lost"].as_u64(), told["channels"].as_u64()),
        (Some(0), Some(28))
    );
    let mut timing = tactnet(["catch", "timing", "--json"]);
    timing.arg(&file);
    let period = json(timing)["joint_period_ms"]["p50"].as_f64().unwrap();
    assert!((0.5..2.0).contains(&period), "{period}");
    // No planner ran, so there is nothing to reproduce.
    let mut replay = tactnet(["catch", "replay"]);
    replay.arg(&file);
    let said = stderr(&expect(2, replay));
    assert!(said.contains("found no packets of it"), "{said}");
    world.end();
    hub.end();
}

#[test]
fn every_process_may_be_killed_at_any_moment() {
    let mut run = Run::start(&["--seed", "5", "--throw-back=3.6,0,1.2", "--planners", "2"]);
    let mut processes = run.processes();
    run.wait_for("throw 1:");
    // In a fixed order; the last ones are killed while the robot is still recovering.
    for name in [
        "tracker",
        "controller",
        "safety",
        "coordinator",
        "pose",
        "planner-left",
        "hand",
        "planner-right",
        "planner-right-2",
        "thrower",
        "world",
    ] {
        signal("KILL", processes[name]);
        let ended = run.wait_for(&format!("the {name} has ended"));
        assert_eq!(ended.contains("brakes"), name != "thrower", "{ended}");
        let line = run.wait_for(&format!("the {name} begins again"));
        let number = line.rsplit(' ').next().unwrap().parse().unwrap();
        processes.insert(name.into(), number);
    }
    // The run recovers and continues.
    run.wait_for("throw ");
    run.wait_for("thrown back ");
    // A throw is aborted when its thrower ends, and the next thrower repeats it.
    run.wait_for("throw ");
    signal("KILL", processes["thrower"]);
    let ended = run.wait_for("the thrower has ended");
    assert!(!ended.contains("brakes"), "{ended}");
    run.wait_for("the thrower begins again");
    run.wait_for("thrown back ");
    let report = run.end();
    assert_eq!(report["restarts"], 12);
    assert!(report["throws_back"].as_u64().unwrap() >= 2, "{report}");
    assert!(report["throw_miss_mm"]["p50"].as_f64().unwrap() < 1000.0);
    assert!(processes.values().all(|process| !is_there(*process)));
    for wrong in [
        &["--throw-back", "--balls", "2"][..],
        &["--throw-back=4,0"],
        &["--aim-beside", "1,0,0"],
    ] {
        let mut command = tactnet(["catch", "run"]);
        let output = command.args(wrong).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{wrong:?}");
    }
}

/// After a catch the free hand sweeps over the ball and the network predicts its material. Killed processes of this
/// part do not brake the robot, and restart.
#[test]
fn a_caught_ball_is_felt_and_named() {
    let robot = Robot::new("felt");
    let network = robot.lab.path("models/1");
    let mut run = Run::start(&["--seed", "3", "--feel", network.to_str().unwrap()]);
    let processes = run.processes();
    let line = run.wait_with("feels like ");
    let sure = line.split("feels like ").nth(1).unwrap();
    assert!(
        sure.contains(" % after ") && sure.contains(" sweep"),
        "{line}"
    );
    for name in ["classifier", "skin", "feel"] {
        signal("KILL", processes[name]);
        let ended = run.wait_for(&format!("the {name} has ended"));
        assert!(!ended.contains("brakes"), "{ended}");
        run.wait_for(&format!("the {name} begins again"));
    }
    run.wait_with("feels like ");
    let report = run.end();
    assert!(
        report["beliefs_after_catch"].as_u64().unwrap() >= 2,
        "{report}"
    );
    let (felt, right) = (&report["beliefs_after_catch"], &report["correct_materials"]);
    assert!(right.as_u64() <= felt.as_u64(), "{report}");
    assert!((1.0..=3.0).contains(&report["sweeps_a_ball"].as_f64().unwrap()));
    for wrong in [&["--balls", "2"][..], &["--pixels"]] {
        let mut command = tactnet(["catch", "run", "--feel"]);
        let output = command.arg(&network).args(wrong).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{wrong:?}");
    }
}

#[test]
fn a_stack_without_a_hub_and_a_role_that_there_is_not_are_named() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("robot.toml");
    let table = tactnet(["catch", "role", "--print-table"])
        .output()
        .unwrap();
    std::fs::write(&path, &table.stdout).unwrap();
    for (role, expected) in [("tracker", "no hub"), ("cook", "unknown role `cook`")] {
        let mut command = tactnet(["catch", "role", role, "--table"]);
        let output = command.arg(&path).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            said.contains(expected) && said.lines().count() == 1,
            "{said}"
        );
    }
}
