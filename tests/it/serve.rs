//! The online classifier with hub, skin and service as separate processes.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tactnet_channel::{Bus, Domain, GetPort, Priority, PutPort, Start, Wait, remove_bus};
use tactnet_data::SweepView;
use tactnet_models::Compute;
use tactnet_pipeline::{Classifier, PredictionMethod, RunDir};
use tactnet_skin::packets::{
    Command as Wish, Event, ModelNames, Stage, SweepCommand, TactileBelief, TactileStatus, Text,
    Verdict,
};
use tactnet_skin::{SegmenterConfig, ServeConfig};

use crate::command::{Lab, RecipeChange, expect, stderr, stdout, tactnet};

pub(crate) const STEPS: usize = 120;
const SOON: Wait = Wait::Block {
    timeout: Duration::from_secs(20),
};

/// A bus, a small network, and its data set.
pub(crate) struct Robot {
    pub(crate) lab: Lab,
    table: tactnet_channel::Table,
}

/// A process that is killed when dropped, as by `kill -9`.
pub(crate) struct Running(pub(crate) Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Running {
    /// Starts a process and waits until it prints `ready`.
    pub(crate) fn start(mut command: Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let out = child.stdout.as_mut().unwrap();
        let mut said = Vec::new();
        while !said.ends_with(b"ready\n") {
            let mut byte = [0];
            assert_eq!(out.read(&mut byte).unwrap(), 1, "{command:?} ended");
            said.push(byte[0]);
        }
        Self(child)
    }

    /// Asks the process to end and returns its output.
    pub(crate) fn end(mut self) -> String {
        let killed = Command::new("kill")
            .args(["-TERM", &self.0.id().to_string()])
            .status();
        assert!(killed.unwrap().success());
        let mut said = String::new();
        let mut out = BufReader::new(self.0.stdout.take().unwrap());
        out.read_to_string(&mut said).unwrap();
        assert!(self.0.wait().unwrap().success());
        said
    }
}

impl Robot {
    pub(crate) fn new(name: &str) -> Self {
        let lab = Lab::new();
        let recipe = lab.recipe(RecipeChange {
            epochs: Some(4),
            ..RecipeChange::default()
        });
        let mut twin = tactnet(["data", "twin", "--materials", "4", "--sweeps", "40"]);
        twin.args(["--steps", &STEPS.to_string(), "--out"]);
        twin.arg(lab.path("data.h5"));
        expect(0, twin);
        let mut train = tactnet(["train", "--calibrate", "--data"]);
        train.arg(lab.path("data.h5")).arg("--recipe").arg(&recipe);
        train.arg("--out").arg(lab.path("models/1"));
        expect(0, train);
        let config = ServeConfig {
            anytime_ms: 40.0,
            segmenter: SegmenterConfig {
                skip: 20.into(),
                ..SegmenterConfig::default()
            },
            ..ServeConfig::default()
        };
        let table = config.table(&format!("{name}{}", std::process::id()));
        std::fs::write(lab.path("robot.toml"), toml::to_string(&table).unwrap()).unwrap();
        Self { lab, table }
    }

    pub(crate) fn start(&self, arguments: &[&str]) -> Running {
        let mut command = tactnet(arguments);
        command.arg("--table").arg(self.lab.path("robot.toml"));
        Running::start(command)
    }

    pub(crate) fn serve(&self, model: &str) -> Running {
        let path = self.lab.path(model).display().to_string();
        let which = if model == "models" {
            "--models"
        } else {
            "--run"
        };
        self.start(&["serve", "--json", "--metrics", "off", which, &path])
    }

    pub(crate) fn skin(&self, sweeps: &str) -> Running {
        let data = self.lab.path("data.h5").display().to_string();
        let objects = ["--sweeps-per-object", "none"];
        let skin = ["simulate", "skin", "--data", &data, "--sweeps", sweeps];
        self.start(&[&skin[..], &objects].concat())
    }

    pub(crate) fn bus(&self) -> Bus {
        Bus::open(Domain::Host, &self.table).unwrap()
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        remove_bus(&self.table).unwrap();
    }
}

/// The offline classifier of a run.
fn classifier(robot: &Robot, run: &str) -> Classifier {
    let run = RunDir::open(&robot.lab.path(run)).unwrap();
    let (config, weights) = (run.config().unwrap().classifier, run.weights().unwrap());
    Classifier::new(config, &weights, &Compute::Cpu.open().unwrap()).unwrap()
}

/// Returns the offline prediction of a run for a sweep: `[materials]` probabilities.
pub(crate) fn offline(robot: &Robot, run: &str, sweep: usize) -> Vec<f64> {
    let classifier = classifier(robot, run);
    let dataset = tactnet_data::format::read(&robot.lab.path("data.h5")).unwrap();
    let view = SweepView::new(&dataset, vec![sweep]);
    let found = classifier.predict(&view, PredictionMethod::Plain).unwrap();
    let log_p = &found.sweeps[0].log_probability;
    log_p.iter().map(|log_p| log_p.exp()).collect()
}

/// Returns the next packet for which `wanted` returns true.
fn next<T: tactnet_channel::Packet>(port: &GetPort<T>, mut wanted: impl FnMut(&T) -> bool) -> T {
    let begun = Instant::now();
    loop {
        let packet = port.get(SOON).unwrap().expect("a packet within 20 s");
        if wanted(&packet[0]) {
            return packet[0];
        }
        assert!(
            begun.elapsed() < Duration::from_secs(60),
            "not among the packets"
        );
    }
}

fn wish(commands: &PutPort<SweepCommand>, kind: Wish, material: &str, sweeps: u32) {
    let command = SweepCommand {
        kind: kind as u32,
        finger: 0,
        motion: 0,
        sweeps,
        reserved: 0,
        material: Text::new(material),
    };
    commands.put_copy(&[command]).unwrap();
}

#[test]
fn a_taken_port_ends_the_demo_before_anything_is_trained() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let out = expect(2, tactnet(["demo", "--listen", &address]));
    // One line: no training was started.
    let text = stderr(&out);
    let begin = format!("error: cannot listen at {address}: ");
    assert!(text.starts_with(&begin), "{text}");
    assert!(text.trim_end().ends_with(" is free"), "{text}");
    assert_eq!(
        (text.lines().count(), text.matches("error:").count()),
        (1, 1)
    );
}

#[test]
fn beliefs_of_live_sweeps_are_those_of_the_offline_classifier() {
    let robot = Robot::new("live");
    let _hub = robot.start(&["channel", "hub"]);
    let service = robot.serve("models/1");
    let bus = robot.bus();
    let beliefs = bus
        .get_port::<TactileBelief>("tactile/belief", Start::Now)
        .unwrap();
    let mut dashboard = robot.start(&["dashboard", "--listen", "127.0.0.1:0"]);
    let mut skin = robot.skin("5");
    let mut seen: Vec<TactileBelief> = Vec::new();
    while seen
        .iter()
        .filter(|b| b.stage == Stage::Dropout as u32)
        .count()
        < 5
    {
        seen.push(next(&beliefs, |_| true));
        if seen.len() == 4 {
            // The dashboard ends; the service does not depend on it.
            dashboard.0.kill().unwrap();
        }
    }
    assert!(skin.0.wait().unwrap().success());
    let played: Vec<usize> = BufReader::new(skin.0.stdout.take().unwrap())
        .lines()
        .map(|line| line.unwrap())
        .filter_map(|line| {
            Some(
                line.split_once("sweep ")?
                    .1
                    .split(',')
                    .next()?
                    .parse()
                    .unwrap(),
            )
        })
        .collect();
    assert_eq!(played.len(), 5);

    let classifier = classifier(&robot, "models/1");
    let dataset = tactnet_data::format::read(&robot.lab.path("data.h5")).unwrap();
    let view = SweepView::new(&dataset, played.clone());
    for (stage, method) in [
        (Stage::Plain, PredictionMethod::Plain),
        (
            Stage::Dropout,
            PredictionMethod::McDropout { mc_samples: 100 },
        ),
    ] {
        let offline = classifier.predict(&view, method).unwrap();
        let live: Vec<&TactileBelief> = seen.iter().filter(|b| b.stage == stage as u32).collect();
        assert_eq!(live.len(), 5);
        for (number, (live, sweep)) in live.iter().zip(&played).enumerate() {
            let offline = offline.sweeps.iter().find(|o| o.index == *sweep).unwrap();
            assert_eq!(
                (live.motion, live.frames, live.filled_in),
                (number as u64 + 1, STEPS as u32, 0)
            );
            for (live, offline) in live.posterior.iter().zip(&offline.log_probability) {
                assert!(
                    (f64::from(*live) - offline.exp()).abs() < 1e-4,
                    "{live} {}",
                    offline.exp()
                );
            }
        }
    }
    // Without a reset all sweeps belong to one object.
    let calibration = RunDir::open(&robot.lab.path("models/1")).unwrap();
    let calibration = calibration.calibration().unwrap().unwrap();
    let whole = seen.iter().filter(|b| b.stage == Stage::Dropout as u32);
    let mut sum = 0.0;
    for (sweeps, live) in (1..).zip(whole) {
        sum += f64::from(live.strangeness);
        let verdict = match calibration.object_is_unknown(sum / sweeps as f64, sweeps) {
            None => Verdict::NotTold,
            Some(false) => Verdict::Known,
            Some(true) => Verdict::Unknown,
        };
        assert_ne!(verdict, Verdict::NotTold);
        assert_eq!(live.fused_verdict, verdict as u32, "{sweeps} sweeps");
    }
    // 40 ms are 30 frames, so three provisional beliefs precede the final one of 120 frames.
    let anytime = seen
        .iter()
        .filter(|b| b.stage == Stage::Anytime as u32)
        .count();
    assert_eq!(anytime, 3 * 5);
    let last = seen.last().unwrap();
    assert!(last.fused_sweeps <= 5);
    let total: f32 = last.fused.iter().sum();
    assert!((total - 1.0).abs() < 1e-4);

    let served: Value = serde_json::from_str(&service.end()).unwrap();
    assert_eq!(served["sweeps"], 5, "{served}");
    assert_eq!(served["dropped_frames"], 0, "{served}");
    assert_eq!(served["rejected"], 0, "{served}");
    assert_eq!(served["allocations"], 0, "{served}");
    let ends = &served["sequences"][0];
    let sent = ends[1].as_u64().unwrap() - ends[0].as_u64().unwrap() + 1;
    assert_eq!(served["frames"], sent, "{served}");
}

#[test]
fn systemd_and_prometheus_are_told() {
    let robot = Robot::new("told");
    let _hub = robot.start(&["channel", "hub"]);
    let socket = robot.lab.path("notify");
    let manager = UnixDatagram::bind(&socket).unwrap();
    manager
        .set_read_timeout(Some(Duration::from_secs(20)))
        .unwrap();
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let mut serve = tactnet(["serve", "--run"]);
    serve.arg(robot.lab.path("models/1"));
    serve.args(["--metrics", &port.to_string(), "--cpu", "100000", "--table"]);
    serve.arg(robot.lab.path("robot.toml"));
    serve.env("NOTIFY_SOCKET", &socket);
    serve.env("WATCHDOG_USEC", "200000");
    serve.stderr(Stdio::piped());
    let mut service = Running::start(serve);
    let mut told = [0; 64];
    let mut next_word = || {
        let length = manager.recv(&mut told).unwrap();
        String::from_utf8(told[..length].to_vec()).unwrap()
    };
    assert_eq!(next_word(), "READY=1");
    assert_eq!(next_word(), "WATCHDOG=1");
    assert_eq!(next_word(), "WATCHDOG=1");
    let mut skin = robot.skin("1");
    assert!(skin.0.wait().unwrap().success());
    let mut http = TcpStream::connect(port).unwrap();
    http.write_all(b"GET /metrics HTTP/1.0\r\n\r\n").unwrap();
    let mut answer = String::new();
    http.read_to_string(&mut answer).unwrap();
    assert!(answer.contains("text/plain; version=0.0.4"), "{answer}");
    for line in [
        "tactnet_inference_total{stage=\"plain\"} 1",
        "tactnet_inference_total{stage=\"dropout\"} 1",
        "tactnet_compute_seconds_count{stage=\"plain\"} 1",
        "tactnet_dropped_frames_total 0",
    ] {
        assert!(
            answer.lines().any(|found| found == line),
            "{line}\n{answer}"
        );
    }
    let mut said = service.0.stderr.take().unwrap();
    service.end();
    let mut last = String::new();
    while last != "STOPPING=1" {
        last = next_word();
        assert!(
            ["WATCHDOG=1", "STOPPING=1"].contains(&last.as_str()),
            "{last}"
        );
    }
    let mut lines = String::new();
    said.read_to_string(&mut lines).unwrap();
    assert!(
        lines.contains("cannot pin the thread to core 100000"),
        "{lines}"
    );
}

#[test]
fn every_sweep_of_a_data_set_is_classified_alike_frame_by_frame() {
    let robot = Robot::new("alike");
    let mut eval = tactnet(["eval", "--json", "--runtime", "online", "--data"]);
    eval.arg(robot.lab.path("data.h5"))
        .arg(robot.lab.path("models/1"));
    let found: Value = serde_json::from_str(&stdout(&expect(0, eval))).unwrap();
    for way in ["plain", "mc_dropout"] {
        let compared = &found["runtimes"][way];
        let apart = compared["largest_difference"].as_f64().unwrap();
        assert!(apart < 1e-4, "{found}");
        assert!(compared["p50_us"].as_f64().unwrap() > 0.0);
    }
}

#[test]
fn a_material_is_learnt_while_it_serves_and_a_wrong_model_is_refused() {
    let robot = Robot::new("learn");
    let _hub = robot.start(&["channel", "hub"]);
    let service = robot.serve("models");
    let bus = robot.bus();
    let status = bus
        .get_port::<TactileStatus>("tactile/status", Start::Now)
        .unwrap();
    let model = bus
        .get_port::<ModelNames>("tactile/model", Start::History(1))
        .unwrap();
    let commands = bus
        .put_port::<SweepCommand>("sweep/command", Priority::High)
        .unwrap();
    assert_eq!(next(&model, |_| true).materials, 4);
    wish(&commands, Wish::Enroll, "felt", 2);
    let refused = next(&status, |s| s.event == Event::Refused as u32);
    assert!(
        refused
            .text
            .as_str()
            .contains("2 sweeps requested, 0 complete sweeps since the last reset"),
        "{:?}",
        refused.text
    );

    // Sweeps of another skin are refused before they are sent to this network.
    for sweep in 0..2 {
        let file = robot.lab.path(&format!("other/felt/{sweep}.csv"));
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, format!("1,{sweep},3\n").repeat(STEPS)).unwrap();
    }
    let mut other = tactnet(["simulate", "skin", "--rate", "750", "--data"]);
    other.arg(robot.lab.path("other")).arg("--table");
    other.arg(robot.lab.path("robot.toml"));
    let other = stderr(&expect(2, other));
    assert!(
        other.contains("expects 4x4 taxels at 750 Hz, these sweeps have 1x3"),
        "{other}"
    );

    let _skin = robot.skin("1000");
    for _ in 0..2 {
        next(&status, |s| s.event == Event::Classified as u32);
    }
    wish(&commands, Wish::Enroll, "felt", 2);
    let learnt = next(&status, |s| s.event == Event::Enrolled as u32);
    assert!(
        learnt.text.as_str().starts_with("`felt` enrolled in "),
        "{:?}",
        learnt.text
    );
    let names = next(&model, |_| true);
    assert_eq!((names.version, names.materials), (2, 5));
    assert_eq!(names.names[4].as_str(), "felt");
    assert!(robot.lab.path("models/2/enrolled.json").exists());
    // Enroll on the command line.
    let by_hand = |code: i32, words: &[&str]| {
        let mut command = tactnet(["channel", "command"]);
        command.args(words).arg("--table");
        expect(code, {
            command.arg(robot.lab.path("robot.toml"));
            command
        })
    };
    let twice = ["enroll", "--material", "felt", "--sweeps", "1"];
    let twice = stderr(&by_hand(2, &twice));
    assert!(twice.contains("knows a material of this name"), "{twice}");
    let nowhere = stderr(&by_hand(2, &["reset", "--finger", "7"]));
    assert!(nowhere.contains("no finger 7; there are 1"), "{nowhere}");
    let nameless = stderr(&by_hand(2, &["enroll", "--sweeps", "1"]));
    assert!(nameless.contains("--material"), "{nameless}");
    next(&status, |s| s.event == Event::Refused as u32);

    // A version without the served materials.
    copy(&robot.lab.path("models/1"), &robot.lab.path("models/.3"));
    std::fs::rename(robot.lab.path("models/.3"), robot.lab.path("models/3")).unwrap();
    let wrong = next(&status, |s| s.event == Event::ModelRejected as u32);
    assert!(
        wrong.text.as_str().contains("material `felt` is missing"),
        "{:?}",
        wrong.text
    );
    // A version that fits.
    copy(&robot.lab.path("models/2"), &robot.lab.path("models/.7"));
    std::fs::rename(robot.lab.path("models/.7"), robot.lab.path("models/7")).unwrap();
    let swapped = next(&status, |s| s.event == Event::Swapped as u32);
    assert_eq!(swapped.model_version, 7);
    let classified = next(&status, |s| s.event == Event::Classified as u32);
    assert_eq!(classified.model_version, 7);
    assert_eq!(classified.counters.dropped_frames, 0);
    assert_eq!(classified.counters.rejected, 0);
    let reset = stdout(&by_hand(0, &["reset"]));
    assert!(reset.starts_with("reset, finger 0"), "{reset}");
    service.end();
    let nobody = stderr(&by_hand(2, &["stop"]));
    assert!(nobody.contains("no classifier listens"), "{nobody}");
}

#[test]
fn damaged_versions_are_named_and_the_newest_good_one_serves() {
    let robot = Robot::new("damaged");
    let _hub = robot.start(&["channel", "hub"]);
    let put = |from: &str, to: &str, damaged: bool| {
        copy(&robot.lab.path(from), &robot.lab.path("models/.new"));
        if damaged {
            let weights = robot.lab.path("models/.new/weights.safetensors");
            let whole = std::fs::read(&weights).unwrap();
            std::fs::write(&weights, &whole[..whole.len() / 2]).unwrap();
        }
        std::fs::rename(robot.lab.path("models/.new"), robot.lab.path(to)).unwrap();
    };
    put("models/1", "models/2", true);
    put("models/1", "models/9", true);
    let bus = robot.bus();
    let status = bus
        .get_port::<TactileStatus>("tactile/status", Start::Now)
        .unwrap();
    let service = robot.serve("models");
    let rejected = || {
        let status = next(&status, |s| s.event == Event::ModelRejected as u32);
        status.text.as_str().to_owned()
    };
    assert_eq!(
        next(&status, |s| s.event == Event::Swapped as u32).model_version,
        1
    );
    assert!(rejected().contains("models/9"));
    assert!(rejected().contains("models/2"));
    // A valid version below a damaged one.
    put("models/1", "models/8", false);
    assert_eq!(
        next(&status, |s| s.event == Event::Swapped as u32).model_version,
        8
    );
    let said = service.end();
    assert!(said.contains("\"rejected\""), "{said}");

    // No version can serve.
    std::fs::remove_dir_all(robot.lab.path("models/1")).unwrap();
    std::fs::remove_dir_all(robot.lab.path("models/8")).unwrap();
    let mut serve = tactnet(["serve", "--metrics", "off", "--models"]);
    serve.arg(robot.lab.path("models"));
    serve.arg("--table").arg(robot.lab.path("robot.toml"));
    let none = stderr(&expect(2, serve));
    assert!(none.contains("models/9"), "{none}");
    assert_eq!(none.trim().lines().count(), 1, "{none}");
}

#[test]
fn what_is_missing_is_said_in_one_line() {
    let line = |arguments: &[&str]| stderr(&expect(2, tactnet(arguments)));
    assert!(line(&["serve"]).contains("name a run directory with `--run`"));
    assert!(line(&["serve", "--run", "nowhere"]).contains("name a table with `--table`"));
    let table = stdout(&expect(0, tactnet(["serve", "--print-table"])));
    let lab = Lab::new();
    std::fs::write(
        lab.path("robot.toml"),
        table.replace("\"robot\"", "\"nohub\""),
    )
    .unwrap();
    for (model, missing) in [
        ("--run", "nowhere: no run here"),
        ("--models", "no hub of bus `nohub`"),
    ] {
        let mut serve = tactnet(["serve", model, "nowhere", "--table"]);
        serve.arg(lab.path("robot.toml"));
        let none = stderr(&expect(2, serve));
        assert!(none.contains(missing), "{none}");
    }
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        std::fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}
