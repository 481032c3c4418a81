//! Attacks that succeeded once, with real processes: each stays mended.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use tactnet_channel::{Start, Wait};
use tactnet_skin::packets::{TactileBelief, TactileStatus};

use crate::command::tactnet;
use crate::serve::{Robot, Running};

const PATIENCE: Duration = Duration::from_secs(20);

/// Sets how many descriptors a process may have open.
fn limit_descriptors(pid: u32, most: usize) {
    let limited = Command::new("prlimit")
        .args(["--pid", &pid.to_string()])
        .arg(format!("--nofile={most}:"))
        .status();
    assert!(limited.unwrap().success());
}

/// The least number that a process has no descriptor of: with that limit it gets no more.
fn first_free_descriptor(pid: u32) -> usize {
    (0..)
        .find(|number| std::fs::symlink_metadata(format!("/proc/{pid}/fd/{number}")).is_err())
        .unwrap()
}

/// What a process says on its standard error, line by line.
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

/// Idle connections to the port of the counters once took all descriptors, and a skin that came then was never heard, without a word.
#[test]
fn a_service_without_descriptors_says_so_and_reaches_its_skin_when_it_has_some_again() {
    let robot = Robot::new("descriptors");
    let _hub = robot.start(&["channel", "hub"]);
    let mut serve = tactnet(["serve", "--metrics", "off", "--run"]);
    serve.arg(robot.lab.path("models/1"));
    serve.arg("--table").arg(robot.lab.path("robot.toml"));
    serve.stderr(Stdio::piped());
    let mut service = Running::start(serve);
    let heard = said(&mut service);
    let pid = service.0.id();
    limit_descriptors(pid, first_free_descriptor(pid));
    let _skin = robot.skin("1000");
    let bus = robot.bus();
    let status = bus
        .get_port::<TactileStatus>("tactile/status", Start::Now)
        .unwrap();
    let beliefs = bus
        .get_port::<TactileBelief>("tactile/belief", Start::Now)
        .unwrap();
    wait_for(&heard, "a component cannot be reached");
    assert!(status.try_get().unwrap().is_none(), "it cannot be reached");
    limit_descriptors(pid, 1024);
    wait_for(&heard, "every component is reached again");
    let patience = Wait::Block { timeout: PATIENCE };
    assert!(status.get(patience).unwrap().is_some(), "its status comes");
    assert!(beliefs.get(patience).unwrap().is_some(), "it sees the skin");
}
