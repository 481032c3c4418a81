//! Live runs of a robot with calibration errors, with and without its calibration.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use tactnet_catching::Robot;
use tactnet_catching::calibrate::{Model, Priors, draw_candidate};
use tactnet_catching::safety::Bodies;
use tactnet_catching_packets::packets::{
    CalibrationHold, CalibrationState, JointCommand, JointState, MarkerFeature, MarkerFeatures,
};
use tactnet_catching_packets::{ARMS, joint};
use tactnet_catching_roles::{RoleSettings, catching_channels};
use tactnet_catching_world::{PlantedErrors, TendonSlip, World, WorldConfig};
use tactnet_channel::{Bus, Domain, GetPort, Priority, PutPort, Start, Table, Wait, remove_bus};

use crate::catch_run::{Run, a_recording_tells_the_same};
use crate::command::{expect, stderr, tactnet};
use crate::robot::Running;

const SHORTLY: Wait = Wait::Block {
    timeout: Duration::from_millis(50),
};

/// Arguments that plant calibration errors in the simulated robot.
pub(crate) const PLANTED: [&str; 2] = ["--planted", "7"];

/// Runs `catch calibrate` and returns the calibration file in a folder.
pub(crate) fn calibrated(folder: &Path) -> PathBuf {
    let path = folder.join("calibration.toml");
    let mut calibrate = tactnet(["catch", "calibrate", "--simulate", "--seed", PLANTED[1]]);
    // Few configurations leave a hand error of about 2 mm.
    calibrate.args(["--configurations", "6", "--throws", "0", "--out"]);
    calibrate.arg(&path);
    expect(0, calibrate);
    path
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Returns the first throw of a run and the run's report.
fn first_throw(arguments: &[&str]) -> (String, serde_json::Value) {
    let mut run = Run::start(&[&["--seed", "3"], &PLANTED[..], arguments].concat());
    let line = run.wait_for("throw 1:");
    (line, run.end())
}

#[test]
fn a_robot_that_is_not_as_described_misses_live() {
    let (line, report) = first_throw(&[]);
    assert!(
        line.contains("missed") && !line.contains("out of"),
        "{line}"
    );
    assert_eq!(
        (report["catchable"].as_u64(), report["caught"].as_u64()),
        (Some(1), Some(0))
    );
}

/// The same throw, calibrated. Tracker and planners reproduce their results from the recording.
#[test]
fn a_robot_that_is_not_as_described_catches_live_with_its_calibration() {
    let place = tempfile::tempdir().unwrap();
    let (calibration, record) = (calibrated(place.path()), place.path().join("run.mcap"));
    let with = [
        "--calibration",
        text(&calibration),
        "--record",
        text(&record),
    ];
    let (line, report) = first_throw(&with);
    assert!(line.contains("caught"), "{line}");
    // Paths may come late on a loaded machine; no other path is refused.
    let refusals = report["refusals"].as_object().unwrap();
    assert!(
        refusals.keys().all(|why| why == "a path that came late"),
        "{report}"
    );
    a_recording_tells_the_same(&record, &report);
}

#[test]
fn a_calibration_that_cannot_be_used_is_one_line_before_anything_starts() {
    let place = tempfile::tempdir().unwrap();
    let good = calibrated(place.path());
    let kept = std::fs::read(&good).unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = place.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let nominal = include_str!("../../catching/packets/src/robot.toml");
    let longer = nominal.replacen("elbow_to_wrist = 0.39", "elbow_to_wrist = 0.40", 1);
    assert_ne!(longer, nominal);
    let other = write("other.toml", longer.as_bytes());
    let described = write("described.toml", nominal.as_bytes());
    for (calibration, robot, named) in [
        (
            &write("half.toml", &kept[..kept.len() / 2]),
            &described,
            "half.toml: invalid calibration file",
        ),
        (
            &write("empty.toml", b""),
            &described,
            "empty.toml: invalid calibration file",
        ),
        (
            &write("picture.png", &[0x89, b'P', 0xff, 0, 7]),
            &described,
            "picture.png: invalid calibration file",
        ),
        (
            &described,
            &described,
            "described.toml: invalid calibration file",
        ),
        (&place.path().join("none.toml"), &described, "none.toml"),
        (&good, &other, "calibration of another robot"),
    ] {
        for command in [&["run"][..], &["throw-series"]] {
            let mut catch = tactnet(["catch"]);
            catch.args(command).args(["--throws", "1", "--calibration"]);
            catch.arg(calibration).arg("--robot").arg(robot);
            let said = stderr(&expect(2, catch));
            assert!(said.contains(named), "{said}");
            assert_eq!(said.trim().lines().count(), 1, "{said}");
        }
    }
    // The valid calibration file is unchanged, and a refused one does not replace it.
    let mut again = tactnet(["catch", "calibrate", "--from"]);
    again.arg(&described).arg("--out").arg(&good);
    expect(2, again);
    assert_eq!(std::fs::read(&good).unwrap(), kept);
}

/// A simulated robot that holds its right hand in front of its cameras.
struct Standing {
    world: World,
    stay: JointCommand,
    joints: PutPort<JointState>,
    features: PutPort<MarkerFeatures>,
    said: GetPort<CalibrationState>,
}

impl Standing {
    fn new(bus: &Bus) -> Self {
        let robot = Robot::nominal();
        let bodies = Bodies::new(robot.description());
        let (model, guess) = (Model::new(&robot), Priors::default().guess());
        // Knuth's linear congruential generator; any configurations are suitable.
        let mut state = 7_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let pose =
            std::iter::repeat_with(|| draw_candidate(&model, &bodies, &guess, 1, &mut uniform));
        let pose = pose.flatten().next().unwrap();
        let mut q = robot.waiting();
        q[joint::ARM[1].clone()].copy_from_slice(&pose.q);
        q[joint::NECK].copy_from_slice(&pose.gaze);
        let config = WorldConfig {
            errors: PlantedErrors::uncalibrated(PLANTED[1].parse().unwrap()),
            ..WorldConfig::default()
        };
        Self {
            world: World::new(robot.description(), &config, 1, &q).unwrap(),
            stay: JointCommand::still(q),
            joints: bus.put_port("joint/state", Priority::RealTime).unwrap(),
            features: bus.put_port("marker/features", Priority::Normal).unwrap(),
            said: bus.get_port("calibration/state", Start::Now).unwrap(),
        }
    }

    /// Holds still for a number of images, faster than real time, and returns the last calibration state.
    fn pictures(&mut self, mut pictures: usize) -> CalibrationState {
        while pictures > 0 {
            let sensed = *self.world.step(&self.stay, &[None; ARMS]);
            self.joints.put_copy(&[sensed.joints]).unwrap();
            if let Some([left, _]) = sensed.circles {
                let [ours, theirs] = self.world.marker_features();
                self.features
                    .put_copy(&[MarkerFeatures {
                        frame: left.frame,
                        exposure_ns: left.exposure_ns,
                        left: ours.map(MarkerFeature::of),
                        right: theirs.map(MarkerFeature::of),
                    }])
                    .unwrap();
                pictures -= 1;
                // Give the process time to read the joint states before its queue is full.
                std::thread::sleep(Duration::from_millis(4));
            }
        }
        // The process reports twice a second.
        let mut last = None;
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_millis(700) {
            let next = self.said.get(SHORTLY).unwrap();
            last = next.and_then(|packet| packet.first().copied()).or(last);
        }
        last.expect("a word on the calibration")
    }
}

/// The process receives only markers and joints.
#[test]
fn a_slipped_tendon_is_noticed_by_the_process_that_watches_and_by_one_that_begins_again() {
    let place = tempfile::tempdir().unwrap();
    let settings = RoleSettings {
        calibration: Some(calibrated(place.path())),
        ..RoleSettings::default()
    };
    let name = format!("slip{}", std::process::id());
    let table = settings.into_table(catching_channels(Table::new(&name), None));
    let path = place.path().join("robot.toml");
    std::fs::write(&path, table.to_toml()).unwrap();
    let start = |words: &[&str]| {
        let mut command = tactnet(words);
        command.arg("--table").arg(&path);
        Running::start(command)
    };
    let hub = start(&["channel", "hub"]);
    let watch = start(&["catch", "role", "slip-watch"]);
    let bus = Bus::open(Domain::Host, &table).unwrap();
    let mut robot = Standing::new(&bus);
    let state = robot.pictures(5);
    assert_eq!(state.hold(), Some(CalibrationHold::NotTold), "{state:?}");
    // A robot without errors, and some false features.
    let state = robot.pictures(150);
    assert_eq!(state.hold(), Some(CalibrationHold::Holds), "{state:?}");
    assert!(
        state.innovations[1] > 200 && state.mean_square[1] < 6.0,
        "{state:?}"
    );
    let kept = settings.kept().unwrap().unwrap();
    assert_eq!(state.identity.as_str(), kept.identity());
    robot
        .world
        .slip(&TendonSlip {
            arm: 1,
            joint: 1,
            angle: 0.0175,
        })
        .unwrap();
    let state = robot.pictures(30);
    assert_eq!(state.hold(), Some(CalibrationHold::Lost), "{state:?}");
    assert!(
        state.since_ns > 0 && state.mean_square[1] > 10.0,
        "{state:?}"
    );
    // The process is killed; the new one starts without knowledge and detects the slip again.
    drop(watch);
    let watch = start(&["catch", "role", "slip-watch"]);
    let state = robot.pictures(40);
    assert_eq!(state.hold(), Some(CalibrationHold::Lost), "{state:?}");
    assert!(state.innovations[1] < 100, "{state:?}");
    let report: serde_json::Value = serde_json::from_str(&watch.end()).unwrap();
    assert!(report["count"].as_u64().unwrap() >= 40, "{report}");
    drop((robot, bus));
    hub.end();
    remove_bus(&table).unwrap();
}

#[test]
fn without_a_calibration_there_is_nothing_to_watch() {
    let place = tempfile::tempdir().unwrap();
    let name = format!("watch{}", std::process::id());
    let table = RoleSettings::default().into_table(catching_channels(Table::new(&name), None));
    let path = place.path().join("robot.toml");
    std::fs::write(&path, table.to_toml()).unwrap();
    let mut hub = tactnet(["channel", "hub", "--table"]);
    hub.arg(&path);
    let hub = Running::start(hub);
    let mut watch = tactnet(["catch", "role", "slip-watch", "--table"]);
    watch.arg(&path);
    let said = stderr(&expect(2, watch));
    assert!(said.contains("calibration = "), "{said}");
    assert_eq!(said.trim().lines().count(), 1, "{said}");
    hub.end();
    remove_bus(&table).unwrap();
}
