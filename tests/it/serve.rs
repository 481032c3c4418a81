//! The online classifier with hub, skin and service as separate processes.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::process::{Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tactnet_channel::{GetPort, Priority, PutPort, Start, Wait};
use tactnet_data::SweepView;
use tactnet_pipeline::{PredictionMethod, RunDir};
use tactnet_skin::packets::{
    Command as Wish, Event, ModelNames, Stage, SweepCommand, TactileBelief, TactileStatus, Text,
    Verdict,
};

use crate::command::{Lab, assert_says, expect, json, output_of, refusal, stderr, stdout, tactnet};
use crate::robot::{Robot, Running, STEPS, classifier};

const SOON: Wait = Wait::Block {
    timeout: Duration::from_secs(20),
};

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

/// Returns the next status of a kind of event.
fn next_event(status: &GetPort<TactileStatus>, event: Event) -> TactileStatus {
    next(status, |status| status.event == event as u32)
}

/// Returns the text of the next status of a kind of event.
fn next_text(status: &GetPort<TactileStatus>, event: Event) -> String {
    next_event(status, event).text.as_str().to_owned()
}

/// Returns the sweeps that a simulated skin played.
fn played(skin: &mut Running) -> Vec<usize> {
    let lines = BufReader::new(skin.0.stdout.take().unwrap()).lines();
    let sweep = |line: String| {
        let number = line.split_once("sweep ")?.1.split(',').next()?;
        Some(number.parse().unwrap())
    };
    lines.map(Result::unwrap).filter_map(sweep).collect()
}

fn of_stage(beliefs: &[TactileBelief], stage: Stage) -> Vec<&TactileBelief> {
    let wanted = |belief: &&TactileBelief| belief.stage == stage as u32;
    beliefs.iter().filter(wanted).collect()
}

/// Compares live beliefs of all stages with predictions of the offline classifier for the `played` sweeps.
fn assert_as_offline(robot: &Robot, played: &[usize], beliefs: &[TactileBelief]) {
    let classifier = classifier(robot, "models/1");
    let dataset = tactnet_data::format::read(&robot.lab.path("data.h5")).unwrap();
    let view = SweepView::new(&dataset, played.to_vec());
    for (stage, method) in [
        (Stage::Plain, PredictionMethod::Plain),
        (
            Stage::Dropout,
            PredictionMethod::McDropout { mc_samples: 100 },
        ),
    ] {
        let offline = classifier.predict(&view, method).unwrap();
        let live = of_stage(beliefs, stage);
        assert_eq!(live.len(), played.len());
        for (number, (live, sweep)) in live.iter().zip(played).enumerate() {
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
}

/// Compares the verdicts on one object with those of the calibration; without a reset all sweeps belong to one object.
fn assert_verdicts_of_calibration(robot: &Robot, beliefs: &[TactileBelief]) {
    let calibration = RunDir::open(&robot.lab.path("models/1")).unwrap();
    let calibration = calibration.calibration().unwrap().unwrap();
    let mut sum = 0.0;
    for (sweeps, live) in (1..).zip(of_stage(beliefs, Stage::Dropout)) {
        sum += f64::from(live.strangeness);
        let verdict = match calibration.object_is_unknown(sum / sweeps as f64, sweeps) {
            None => Verdict::NotTold,
            Some(false) => Verdict::Known,
            Some(true) => Verdict::Unknown,
        };
        assert_ne!(verdict, Verdict::NotTold);
        assert_eq!(live.fused_verdict, verdict as u32, "{sweeps} sweeps");
    }
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
    let beliefs = robot.beliefs();
    let mut dashboard = robot.start(&["dashboard", "--listen", "127.0.0.1:0"]);
    let mut skin = robot.skin("5");
    let mut seen: Vec<TactileBelief> = Vec::new();
    while of_stage(&seen, Stage::Dropout).len() < 5 {
        seen.push(next(&beliefs, |_| true));
        if seen.len() == 4 {
            // The dashboard ends; the service does not depend on it.
            dashboard.0.kill().unwrap();
        }
    }
    assert!(skin.0.wait().unwrap().success());
    let played = played(&mut skin);
    assert_eq!(played.len(), 5);
    assert_as_offline(&robot, &played, &seen);
    assert_verdicts_of_calibration(&robot, &seen);
    // 40 ms are 30 frames, so three provisional beliefs precede the final one of 120 frames.
    assert_eq!(of_stage(&seen, Stage::Anytime).len(), 3 * 5);
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

/// Requests the metrics of a service as Prometheus does.
fn metrics(address: SocketAddr) -> String {
    let mut http = TcpStream::connect(address).unwrap();
    http.write_all(b"GET /metrics HTTP/1.0\r\n\r\n").unwrap();
    let mut answer = String::new();
    http.read_to_string(&mut answer).unwrap();
    answer
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
    let mut serve = robot.lab.command(&format!(
        "serve --run @models/1 --metrics {port} --cpu 100000 --table @robot.toml"
    ));
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
    let answer = metrics(port);
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
    assert_says!(lines, "cannot pin the thread to core 100000");
}

#[test]
fn every_sweep_of_a_data_set_is_classified_alike_frame_by_frame() {
    let robot = Robot::new("alike");
    let found = json(
        robot
            .lab
            .command("eval --json --runtime online --data @data.h5 @models/1"),
    );
    for way in ["plain", "mc_dropout"] {
        let compared = &found["runtimes"][way];
        let apart = compared["largest_difference"].as_f64().unwrap();
        assert!(apart < 1e-4, "{found}");
        assert!(compared["p50_us"].as_f64().unwrap() > 0.0);
    }
}

/// Sweeps of another skin are refused before they are sent to this network.
fn assert_another_skin_is_refused(robot: &Robot) {
    for sweep in 0..2 {
        let file = robot.lab.path(&format!("other/felt/{sweep}.csv"));
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, format!("1,{sweep},3\n").repeat(STEPS)).unwrap();
    }
    let other = robot
        .lab
        .command("simulate skin --rate 750 --data @other --table @robot.toml");
    let other = refusal(other);
    assert_says!(other, "expects 4x4 taxels at 750 Hz, these sweeps have 1x3");
}

/// Sends a command to the classifier with the command line.
fn command_by_hand(robot: &Robot, code: i32, words: &[&str]) -> Output {
    let mut command = tactnet(["channel", "command"]);
    command.args(words).arg("--table");
    command.arg(robot.lab.path("robot.toml"));
    expect(code, command)
}

/// The classifier of finger 0 knows the material `felt`.
fn assert_impossible_commands_are_refused(robot: &Robot) {
    let refused = |words: &[&str]| stderr(&command_by_hand(robot, 2, words));
    let twice = ["enroll", "--material", "felt", "--sweeps", "1"];
    let twice = refused(&twice);
    assert!(twice.contains("knows a material of this name"), "{twice}");
    let nowhere = refused(&["reset", "--finger", "7"]);
    assert!(nowhere.contains("no finger 7; there are 1"), "{nowhere}");
    let nameless = refused(&["enroll", "--sweeps", "1"]);
    assert!(nameless.contains("--material"), "{nameless}");
}

/// Adds a version of the models by renaming a complete copy of another one.
fn add_version(robot: &Robot, from: &str, to: &str) {
    let draft = robot.lab.path("models/.draft");
    copy(&robot.lab.path(from), &draft);
    std::fs::rename(draft, robot.lab.path(to)).unwrap();
}

#[test]
fn a_material_is_learnt_while_it_serves_and_a_wrong_model_is_refused() {
    let robot = Robot::new("learn");
    let _hub = robot.start(&["channel", "hub"]);
    let service = robot.serve("models");
    let bus = robot.bus();
    let status = robot.status();
    let model = bus
        .get_port::<ModelNames>("tactile/model", Start::History(1))
        .unwrap();
    let commands = bus
        .put_port::<SweepCommand>("sweep/command", Priority::High)
        .unwrap();
    assert_eq!(next(&model, |_| true).materials, 4);
    wish(&commands, Wish::Enroll, "felt", 2);
    let refused = next_text(&status, Event::Refused);
    let few = "2 sweeps requested, 0 complete sweeps since the last reset";
    assert!(refused.contains(few), "{refused}");

    assert_another_skin_is_refused(&robot);

    let _skin = robot.skin("1000");
    for _ in 0..2 {
        next_event(&status, Event::Classified);
    }
    wish(&commands, Wish::Enroll, "felt", 2);
    let learnt = next_text(&status, Event::Enrolled);
    assert!(learnt.starts_with("`felt` enrolled in "), "{learnt}");
    let names = next(&model, |_| true);
    assert_eq!((names.version, names.materials), (2, 5));
    assert_eq!(names.names[4].as_str(), "felt");
    assert!(robot.lab.path("models/2/enrolled.json").exists());
    assert_impossible_commands_are_refused(&robot);
    next_event(&status, Event::Refused);

    // A version without the served materials.
    add_version(&robot, "models/1", "models/3");
    let wrong = next_text(&status, Event::ModelRejected);
    assert!(wrong.contains("material `felt` is missing"), "{wrong}");
    // A version that fits.
    add_version(&robot, "models/2", "models/7");
    let swapped = next_event(&status, Event::Swapped);
    assert_eq!(swapped.model_version, 7);
    let classified = next_event(&status, Event::Classified);
    assert_eq!(classified.model_version, 7);
    assert_eq!(classified.counters.dropped_frames, 0);
    assert_eq!(classified.counters.rejected, 0);
    let reset = stdout(&command_by_hand(&robot, 0, &["reset"]));
    assert!(reset.starts_with("reset, finger 0"), "{reset}");
    service.end();
    let nobody = stderr(&command_by_hand(&robot, 2, &["stop"]));
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
    let status = robot.status();
    let service = robot.serve("models");
    let rejected = || next_text(&status, Event::ModelRejected);
    assert_eq!(next_event(&status, Event::Swapped).model_version, 1);
    assert!(rejected().contains("models/9"));
    assert!(rejected().contains("models/2"));
    // A valid version below a damaged one.
    put("models/1", "models/8", false);
    assert_eq!(next_event(&status, Event::Swapped).model_version, 8);
    let said = service.end();
    assert!(said.contains("\"rejected\""), "{said}");

    // No version can serve.
    std::fs::remove_dir_all(robot.lab.path("models/1")).unwrap();
    std::fs::remove_dir_all(robot.lab.path("models/8")).unwrap();
    let serve = robot
        .lab
        .command("serve --metrics off --models @models --table @robot.toml");
    let none = refusal(serve);
    assert!(none.contains("models/9"), "{none}");
    assert_eq!(none.trim().lines().count(), 1, "{none}");
}

#[test]
fn what_is_missing_is_said_in_one_line() {
    let line = |arguments: &[&str]| refusal(tactnet(arguments));
    assert!(line(&["serve"]).contains("name a run directory with `--run`"));
    assert!(line(&["serve", "--run", "nowhere"]).contains("name a table with `--table`"));
    let table = output_of(tactnet(["serve", "--print-table"]));
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
        let serve = lab.command(&format!("serve {model} nowhere --table @robot.toml"));
        let none = refusal(serve);
        assert!(none.contains(missing), "{none}");
    }
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        std::fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}
