//! Regression tests of past failures, with real processes.

use std::io::{BufRead, BufReader};
use std::os::unix::fs::symlink;
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde_json::Value;
use tactnet_channel::Wait;
use tactnet_models::Weights;
use tactnet_skin::packets::Event;

use crate::command::{Lab, RecipeChange, assert_says, expect, json, refusal, tactnet};
use crate::robot::{Robot, Running, STEPS};

const PATIENCE: Duration = Duration::from_secs(20);

/// Sets the maximum number of file descriptors of a process.
fn limit_descriptors(pid: u32, most: usize) {
    let limited = Command::new("prlimit")
        .args(["--pid", &pid.to_string()])
        .arg(format!("--nofile={most}:"))
        .status();
    assert!(limited.unwrap().success());
}

/// Returns the lowest unused descriptor of a process. With this limit it cannot open another file.
fn first_free_descriptor(pid: u32) -> usize {
    (0..)
        .find(|number| std::fs::symlink_metadata(format!("/proc/{pid}/fd/{number}")).is_err())
        .unwrap()
}

/// Returns the standard error of a process, line by line.
fn said(process: &mut Running) -> Receiver<String> {
    let (say, heard) = channel();
    let err = BufReader::new(process.0.stderr.take().unwrap());
    std::thread::spawn(move || {
        err.lines()
            .map_while(Result::ok)
            .all(|line| say.send(line).is_ok())
    });
    heard
}

fn wait_for(heard: &Receiver<String>, words: &str) {
    let mut before = Vec::new();
    while let Ok(line) = heard.recv_timeout(PATIENCE) {
        if line.contains(words) {
            return;
        }
        before.push(line);
    }
    panic!("`{words}` was not said, but {before:?}");
}

/// Idle connections to the metrics port used up all descriptors, and a new skin was silently ignored.
#[test]
fn a_service_without_descriptors_says_so_and_reaches_its_skin_when_it_has_some_again() {
    let robot = Robot::new("descriptors");
    let _hub = robot.start(&["channel", "hub"]);
    let mut serve = robot
        .lab
        .command("serve --metrics off --run @models/1 --table @robot.toml");
    serve.stderr(Stdio::piped());
    let mut service = Running::start(serve);
    let heard = said(&mut service);
    let pid = service.0.id();
    limit_descriptors(pid, first_free_descriptor(pid));
    let _skin = robot.skin("1000");
    let status = robot.status();
    let beliefs = robot.beliefs();
    wait_for(&heard, "cannot connect to a component");
    assert!(status.try_get().unwrap().is_none(), "it cannot be reached");
    limit_descriptors(pid, 1024);
    wait_for(&heard, "connected to all components again");
    let patience = Wait::Block { timeout: PATIENCE };
    assert!(status.get(patience).unwrap().is_some(), "its status comes");
    assert!(beliefs.get(patience).unwrap().is_some(), "it sees the skin");
}

/// Two programs that flooded the commands channel stopped all beliefs.
#[test]
fn a_flood_of_commands_stops_no_belief() {
    let robot = Robot::new("flood");
    let _hub = robot.start(&["channel", "hub"]);
    let _service = robot.serve("models");
    let _skin = robot.skin("1000");
    let status = robot.status();
    let _flood: Vec<Running> = (0..2)
        .map(|_| {
            let line = "channel put sweep/command --rate 200000 --table @robot.toml";
            let mut put = robot.lab.command(line);
            put.stdout(Stdio::null()).stderr(Stdio::null());
            Running(put.spawn().unwrap())
        })
        .collect();
    let begun = Instant::now();
    let patience = Wait::Block { timeout: PATIENCE };
    loop {
        let event = status.get(patience).unwrap().unwrap();
        let text = event.first().unwrap().text;
        if text
            .as_str()
            .contains("commands refused: more than 1000 a second from one sender")
        {
            break;
        }
        assert!(begun.elapsed() < PATIENCE, "the flood is not noticed");
    }
    let beliefs = robot.beliefs();
    for _ in 0..20 {
        assert!(beliefs.get(patience).unwrap().is_some(), "it sees the skin");
    }
}

/// A flipped bit in a finished run silently changed its results, and an edited result changed a report.
#[test]
fn a_run_that_was_changed_after_its_end_is_refused_by_all_who_read_it() {
    let robot = Robot::new("changed");
    let lab = &robot.lab;
    let size = format!("--materials 5 --sweeps 5 --steps {STEPS}");
    lab.twin("five.h5", &size);
    let info = json(lab.command("data info --json @five.h5"));
    let call = |reader: usize| match reader {
        0 => lab.command("eval @models/1"),
        1 => lab.command("train --resume @models/1"),
        2 => lab.command("export @models/1 --out @again.onnx"),
        _ => {
            let mut enroll = lab.command("enroll @models/1 --data @five.h5 --out @again");
            let new = info["materials"][4]["name"].as_str().unwrap();
            enroll.args(["--material", new]);
            enroll
        }
    };
    let files = [
        ("weights.safetensors", vec![0, 2, 3]),
        ("config.json", vec![0, 1, 2, 3]),
        ("result.json", vec![1]),
        ("calibration.json", vec![0, 2, 3]),
        ("known.safetensors", vec![0, 3]),
        ("held_out.safetensors", vec![3]),
    ];
    for (file, readers) in files {
        let path = lab.path("models/1").join(file);
        let whole = std::fs::read(&path).unwrap();
        let mut changed = whole.clone();
        // A digit of a text, or a bit of a number.
        let at = changed
            .iter()
            .rposition(|byte| byte.is_ascii_digit())
            .unwrap();
        changed[at] ^= 1;
        std::fs::write(&path, &changed).unwrap();
        for reader in readers {
            let refused = refusal(call(reader));
            let named = format!("{file}: the file has changed since the run ended");
            assert!(refused.contains(&named), "{file}: {refused}");
            assert_eq!(refused.lines().count(), 1, "{refused}");
        }
        std::fs::write(&path, whole).unwrap();
    }
    expect(0, call(0));
}

/// A version that requests a terabyte ended a running service and prevented its restart.
#[test]
fn a_version_that_asks_for_all_memory_is_passed_over_and_the_service_serves_on() {
    let robot = Robot::new("monster");
    let _hub = robot.start(&["channel", "hub"]);
    let copy = |number: &str| {
        let (from, to) = (robot.lab.path("models/1"), robot.lab.path("landing"));
        std::fs::create_dir_all(&to).unwrap();
        for entry in std::fs::read_dir(&from).unwrap() {
            let entry = entry.unwrap();
            std::fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
        }
        // Like a version without digests: the configuration alone must not be trusted.
        std::fs::remove_file(to.join("manifest.json")).unwrap();
        let text = std::fs::read_to_string(to.join("config.json")).unwrap();
        let mut config: Value = serde_json::from_str(&text).unwrap();
        config["classifier"]["model"]["tactnet2"]["network"]["hidden"] =
            1_000_000_000_000_u64.into();
        std::fs::write(to.join("config.json"), config.to_string()).unwrap();
        std::fs::rename(&to, robot.lab.path(&format!("models/{number}"))).unwrap();
    };
    let status = robot.status();
    let service = robot.serve("models");
    copy("2");
    let patience = Wait::Block { timeout: PATIENCE };
    loop {
        let packet = status.get(patience).unwrap().expect("the service lives");
        if packet[0].event == Event::ModelRejected as u32 {
            let text = packet[0].text.as_str().to_owned();
            assert!(text.contains("hidden"), "{text}");
            break;
        }
    }
    service.end();
    // The service restarts with the valid version.
    robot.serve("models").end();
}

/// A process that was killed while it created its run left a folder that could be neither trained in nor resumed.
#[test]
fn a_run_that_was_killed_at_its_very_beginning_is_begun_again() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange::default());
    let folder = lab.path("run");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(folder.join("split.json"), "{").unwrap();
    std::fs::write(folder.join(".writing-abc"), "[").unwrap();
    expect(0, lab.train(&recipe, "run"));
    assert!(folder.join("result.json").exists());
    assert!(!folder.join(".writing-abc").exists());
    // Foreign files are kept and named in the error.
    let strange = lab.path("strange");
    std::fs::create_dir(&strange).unwrap();
    std::fs::write(strange.join("thesis.tex"), "").unwrap();
    let refused = refusal(lab.train(&recipe, "strange"));
    assert!(refused.contains("found `thesis.tex`"), "{refused}");
}

/// Pipes and devices named like files of a run were read forever; weights that are not finite were accepted, or caused a panic.
#[test]
fn what_is_no_file_and_no_number_is_refused_in_a_line() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange::default());
    expect(0, lab.train(&recipe, "run"));
    std::fs::remove_file(lab.path("run/manifest.json")).unwrap();
    let eval = || lab.command("eval @run");
    for file in ["split.json", "weights.safetensors", "manifest.json"] {
        let (path, kept) = (lab.path("run").join(file), lab.path("kept"));
        let was_there = std::fs::rename(&path, &kept).is_ok();
        for fifo in [false, true] {
            if fifo {
                let made = Command::new("mkfifo").arg(&path).status().unwrap();
                assert!(made.success());
            } else {
                symlink("/dev/zero", &path).unwrap();
            }
            let refused = refusal(eval());
            assert!(
                refused.contains("is a pipe or a device"),
                "{file}: {refused}"
            );
            std::fs::remove_file(&path).unwrap();
        }
        if was_there {
            std::fs::rename(&kept, &path).unwrap();
        }
    }
    let path = lab.path("run/weights.safetensors");
    let mut weights = Weights::from_safetensors(&std::fs::read(&path).unwrap()).unwrap();
    for tensor in weights.0.values_mut() {
        tensor.values.fill(f32::NAN);
    }
    let bytes = weights
        .to_safetensors(std::collections::BTreeMap::new())
        .unwrap();
    std::fs::write(&path, bytes).unwrap();
    for command in [eval(), lab.command("export @run --out @a.onnx")] {
        let refused = refusal(command);
        assert_says!(refused, "expected finite numbers, found NaN");
        assert_eq!(
            refused
                .lines()
                .filter(|line| line.starts_with("error"))
                .count(),
            1
        );
    }
}

/// A full disk behind standard error ended a training; help that could not be written counted as success.
#[test]
fn messages_that_cannot_be_written_end_nothing_and_lost_results_are_failures() {
    let full = || {
        std::fs::File::options()
            .write(true)
            .open("/dev/full")
            .unwrap()
    };
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange::default());
    let mut train = lab.train(&recipe, "run");
    assert!(train.stderr(full()).output().unwrap().status.success());
    for words in [&["--help"][..], &["help", "train"], &["version"]] {
        let status = tactnet(words).stdout(full()).status().unwrap();
        assert_eq!(status.code(), Some(1), "{words:?}");
    }
}

/// A killed runner left its trainings running, which kept their folders locked.
#[test]
fn the_processes_of_a_killed_runner_end() {
    let lab = Lab::new();
    let data = format!("data=\"{}\"", lab.path("twin.h5").display());
    let mut run = tactnet(["experiment", "run", "crossval_tactnet2", "--set", &data]);
    run.args(["--set", "epochs=100000", "--jobs", "1", "--out"]);
    run.arg(lab.path("killed"));
    let mut runner = run.stderr(Stdio::null()).spawn().unwrap();
    let folder = lab.path("killed").display().to_string();
    let tasks = || {
        let processes = std::fs::read_dir("/proc").unwrap().flatten();
        let lines = processes.filter_map(|entry| std::fs::read(entry.path().join("cmdline")).ok());
        lines
            .map(|line| String::from_utf8_lossy(&line).into_owned())
            .filter(|line| line.contains("\0task\0") && line.contains(&folder))
            .count()
    };
    let wait_until = |wanted: &dyn Fn() -> bool| {
        let begun = Instant::now();
        while !wanted() {
            assert!(begun.elapsed() < PATIENCE, "{} tasks", tasks());
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    wait_until(&|| tasks() > 0);
    runner.kill().unwrap();
    runner.wait().unwrap();
    wait_until(&|| tasks() == 0);
}
