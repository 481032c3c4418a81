//! The Rerun viewer, and the error of a build without it.

#[cfg(not(feature = "rerun"))]
#[test]
fn a_build_without_the_viewer_names_what_is_missing() {
    use crate::command::{Lab, assert_says};
    let lab = Lab::new();
    let said = lab.refused("data view @twin.h5");
    assert_says!(said, "`cargo install --path . --features rerun`");
}

#[cfg(feature = "rerun")]
mod with_rerun {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    use serde_json::Value;

    use crate::command::{Lab, expect, json, output_of, refusal, stderr};
    use crate::robot::{Robot, Running};

    fn view(robot: &Robot, more: &[&str]) -> Command {
        let mut view = robot.lab.command("view --json --table @robot.toml");
        view.args(more);
        view
    }

    /// Rerun's viewer without a screen, started by a launcher in Python.
    struct Viewer(Running);

    impl Viewer {
        /// Starts the viewer and returns it with its port.
        fn start(python: &str) -> (Self, u16) {
            let port = {
                let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
                free.local_addr().unwrap().port()
            };
            let mut viewer = Command::new(python);
            viewer.args(["-m", "rerun", "--headless", "--bind", "127.0.0.1"]);
            viewer
                .args(["--port", &port.to_string()])
                .stderr(Stdio::null());
            let viewer = Viewer(Running(viewer.spawn().unwrap()));
            let begun = Instant::now();
            while std::net::TcpStream::connect(("127.0.0.1", port)).is_err() {
                assert!(begun.elapsed() < Duration::from_secs(60));
                std::thread::sleep(Duration::from_millis(100));
            }
            (viewer, port)
        }

        /// Signals the viewer itself.
        fn signal(&self, signal: &str) -> bool {
            let mut kill = Command::new("pkill");
            kill.args([signal, "-P", &self.0.0.id().to_string()]);
            kill.status().unwrap().success()
        }
    }

    impl Drop for Viewer {
        fn drop(&mut self) {
            self.signal("-KILL");
        }
    }

    #[test]
    fn a_data_set_becomes_a_file_for_the_viewer() {
        let lab = Lab::new();
        let file = lab.path("sweeps.rrd");
        let view = |more: &[&str]| {
            let mut view = lab.command("data view --json @twin.h5");
            view.arg("--save").arg(&file).args(more);
            view
        };
        let unknown = refusal(view(&["--material", "kryptonite"]));
        assert!(unknown.contains("no material `kryptonite`"), "{unknown}");
        assert!(!file.exists());
        let told = json(view(&["--sweeps", "2"]));
        assert_eq!(
            (&told["materials"], &told["sweeps"]),
            (&4.into(), &8.into())
        );
        assert_eq!(told["frames"], 8 * 120);
        assert!(std::fs::read(&file).unwrap().starts_with(b"RRF2"));
        let twice = refusal(view(&[]));
        assert!(twice.contains("exists"), "{twice}");
    }

    #[test]
    fn nobody_notices_who_looks_on() {
        let robot = Robot::new("view");
        let _hub = robot.start(&["channel", "hub"]);
        let service = robot.serve("models/1");
        let path = |name: &str| robot.lab.path(name).display().to_string();
        let looks_on = Running::start(view(&robot, &["--save", &path("live.rrd")]));
        let killed = Running::start(view(&robot, &["--save", &path("killed.rrd")]));
        let nobody = ["--connect", "rerun+http://127.0.0.1:9/proxy"];
        let refused = stderr(&expect(1, view(&robot, &nobody)));
        assert!(refused.contains("no Rerun viewer"), "{refused}");
        let mut skin = robot.skin("8");
        std::thread::sleep(Duration::from_millis(700));
        drop(killed);
        assert!(skin.0.wait().unwrap().success());
        std::thread::sleep(Duration::from_millis(500));
        let served: Value = serde_json::from_str(&service.end()).unwrap();
        let told: Value = serde_json::from_str(&looks_on.end()).unwrap();
        assert_eq!(served["dropped_frames"], 0, "{served}");
        assert_eq!(served["sweeps"], 8, "{served}");
        assert_eq!(told["frames"], served["frames"], "{told} {served}");
        assert_eq!(told["beliefs"], served["beliefs"], "{told} {served}");
        assert_eq!((&told["lost"], &told["left_out"]), (&0.into(), &0.into()));
    }

    #[test]
    #[ignore = "needs TACTNET_PYTHON, a Python with rerun-sdk 0.36.3 and numpy, and a Vulkan driver"]
    fn the_viewer_shows_data_sets_recordings_and_what_happens_now() {
        let python = std::env::var("TACTNET_PYTHON").expect("TACTNET_PYTHON names a Python");
        let pictures = std::env::var("TACTNET_PICTURES").unwrap_or_default();
        let robot = Robot::new("viewer");
        let path = |name: &str| robot.lab.path(name).display().to_string();
        let check = |what: &[&str]| {
            let mut check = Command::new(&python);
            check.arg("tests/check_view.py").args(what).arg(&pictures);
            // The script kills a hanging viewer.
            let said = output_of(check);
            assert!(said.contains("fine"), "{said}");
        };
        robot.lab.run("data export @data.h5 --out @data.npz");
        robot
            .lab
            .run("data view --sweeps 2 --save @data.rrd @data.h5");
        check(&["sweeps", &path("data.npz"), &path("data.rrd")]);

        robot
            .lab
            .run("catch throw-series --throws 1 --view @throw.rrd");
        check(&["throw", &path("throw.rrd")]);

        let _hub = robot.start(&["channel", "hub"]);
        let service = robot.serve("models/1");
        let file = path("a.mcap");
        let recorder = robot.start(&["record", "--json", "--out", &file]);
        // A real viewer that is suspended for a while.
        let (viewer, port) = Viewer::start(&python);
        let url = format!("rerun+http://127.0.0.1:{port}/proxy");
        let looks_on = Running::start(view(&robot, &["--connect", &url]));
        let mut skin = robot.skin("30");
        std::thread::sleep(Duration::from_secs(5));
        check(&["live", &url]);
        assert!(viewer.signal("-STOP"));
        std::thread::sleep(Duration::from_secs(12));
        assert!(viewer.signal("-CONT"));
        assert!(skin.0.wait().unwrap().success());
        let served: Value = serde_json::from_str(&service.end()).unwrap();
        let told: Value = serde_json::from_str(&looks_on.end()).unwrap();
        // The data for the suspended viewer was queued.
        assert_eq!(told["left_out"], 0, "{told}");
        drop(viewer);
        assert_eq!(served["dropped_frames"], 0, "{served}");
        assert_eq!(told["frames"], served["frames"], "{told} {served}");
        recorder.end();

        robot.lab.run("view --save @a.rrd @a.mcap");
        check(&["recording", &file, &path("a.rrd")]);
    }
}
