//! Hub, senders and receivers as separate processes, with faults.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tactnet_channel::{Table, remove_bus};
use tempfile::TempDir;

use crate::command::{expect, json, signal, stderr, stdout, tactnet};

/// A private bus with a table file; its files in shared memory are removed at the end.
struct Robot {
    folder: TempDir,
    bus: String,
}

impl Robot {
    fn new(channels: &str) -> Self {
        let folder = TempDir::new().unwrap();
        let name = folder
            .path()
            .file_name()
            .unwrap()
            .to_string_lossy()
            .into_owned();
        let bus: String = name.chars().filter(char::is_ascii_alphanumeric).collect();
        let robot = Self { folder, bus };
        std::fs::write(
            robot.table(),
            format!("bus = \"{}\"\n{channels}", robot.bus),
        )
        .unwrap();
        robot
    }

    fn table(&self) -> PathBuf {
        self.folder.path().join("channels.toml")
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = tactnet(["channel"]);
        command.args(arguments).arg("--table").arg(self.table());
        command
    }

    /// Starts a process and waits until it prints `ready`.
    fn start(&self, arguments: &[&str]) -> Running {
        let mut child = self
            .command(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let first = lines
            .next()
            .unwrap_or_else(|| panic!("{arguments:?} ended"))
            .unwrap();
        assert_eq!(first, "ready");
        Running(child)
    }

    /// Starts a process whose output is dropped.
    fn quiet(&self, arguments: &[&str]) -> Running {
        let mut command = self.command(arguments);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn().map(Running).unwrap()
    }

    /// Starts a measurement of channel `a`, and waits until its port is open.
    fn start_hz(&self, seconds: &str) -> Child {
        let mut hz = self.command(&["hz", "a", "--json", "--seconds", seconds]);
        let hz = hz.stdout(Stdio::piped()).spawn().unwrap();
        self.wait_for_ports(1, 1);
        hz
    }

    fn hub(&self) -> Running {
        self.start(&["hub"])
    }

    fn hz(&self, channel: &str, seconds: &str) -> Value {
        json(self.command(&["hz", channel, "--json", "--seconds", seconds]))
    }

    fn list(&self) -> Value {
        json(self.command(&["list", "--json"]))
    }

    /// Waits until channel 0 of the list has this many ports.
    fn wait_for_ports(&self, put: u64, get: u64) {
        let begun = Instant::now();
        loop {
            let found = self.list();
            if (&found[0]["put_ports"], &found[0]["get_ports"]) == (&put.into(), &get.into()) {
                return;
            }
            assert!(
                begun.elapsed() < Duration::from_secs(20),
                "{put} and {get} expected: {found}"
            );
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        remove_bus(&Table::new(&self.bus)).unwrap();
    }
}

/// A process that is killed when dropped, as by `kill -9`.
struct Running(Child);

impl Running {
    fn ends_well(mut self) {
        signal("TERM", self.0.id());
        assert!(self.0.wait().unwrap().success());
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

const ONE: &str = "[channels.a]\npacket = \"u8\"\nitem_bytes = 1\nitems = 1000\nput_ports = 1\nget_ports = 3\ndepth = 1024\n";

/// Minimum rate received of 200 packets per second; a loaded machine slows the sender down.
fn is_steady(rate: &Value) {
    assert!(rate["hz"].as_f64().unwrap() > 50.0, "{rate}");
    assert_eq!(rate["lost"], 0, "{rate}");
}

#[test]
fn packets_travel_between_processes() {
    let robot = Robot::new(ONE);
    let hub = robot.hub();
    let _putter = robot.start(&["put", "a"]);
    let rate = robot.hz("a", "0.5");
    is_steady(&rate);
    let [megabytes, hz] = ["megabytes_per_s", "hz"].map(|name| rate[name].as_f64().unwrap());
    assert!((megabytes * 1e3 / hz - 1.0).abs() < 1e-9, "{rate}");
    let echoed = expect(0, robot.command(&["echo", "a", "--count", "3", "--json"]));
    let sequences: Vec<u64> = stdout(&echoed)
        .lines()
        .map(|line| {
            serde_json::from_str::<Value>(line).unwrap()["sequence"]
                .as_u64()
                .unwrap()
        })
        .collect();
    assert_eq!(
        sequences,
        [sequences[0], sequences[0] + 1, sequences[0] + 2]
    );
    let listed = robot.list();
    assert_eq!(listed[0]["put_ports"], 1);
    assert_eq!(listed[0]["packet_bytes"], 1000);
    drop(_putter);
    hub.ends_well();
}

#[test]
fn without_a_hub_and_with_a_second_one_there_is_one_clear_line() {
    let robot = Robot::new(ONE);
    let none = stderr(&expect(2, robot.command(&["list"])));
    assert!(none.contains("no hub of bus"), "{none}");
    let _hub = robot.hub();
    let second = stderr(&expect(2, robot.command(&["hub"])));
    assert!(second.contains("already runs on this host"), "{second}");
    let unknown = stderr(&expect(2, robot.command(&["hz", "b"])));
    assert!(
        unknown.contains("channel `b` is not in the table; the table contains a"),
        "{unknown}"
    );
    std::fs::write(
        robot.table(),
        format!("bus = \"{}\"\n{}", robot.bus, ONE.replace("1000", "10")),
    )
    .unwrap();
    let other = stderr(&expect(2, robot.command(&["put", "a"])));
    assert!(other.contains("another table?"), "{other}");
}

#[test]
fn a_killed_putter_leaves_its_place_and_its_memory_to_the_next() {
    let robot = Robot::new(ONE);
    let _hub = robot.hub();
    for _ in 0..3 {
        let putter = robot.start(&["put", "a"]);
        is_steady(&robot.hz("a", "0.3"));
        drop(putter);
    }
    robot.wait_for_ports(0, 0);
    let memory = std::fs::read_dir(tactnet_channel::memory_folder().unwrap().join(&robot.bus))
        .unwrap()
        .flatten()
        .filter(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            name.starts_with(&robot.bus) && name.ends_with(".data")
        });
    assert_eq!(memory.count(), 0);
}

#[test]
fn a_killed_getter_and_a_stuck_one_do_not_harm_the_others() {
    let robot = Robot::new(ONE);
    let _hub = robot.hub();
    let _putter = robot.start(&["put", "a"]);
    let killed = robot.quiet(&["echo", "a"]);
    let stuck = robot.quiet(&["echo", "a"]);
    robot.wait_for_ports(1, 2);
    signal("STOP", stuck.0.id());
    drop(killed);
    is_steady(&robot.hz("a", "0.7"));
    robot.wait_for_ports(1, 1);
    is_steady(&robot.hz("a", "0.3"));
}

#[test]
fn getters_killed_while_they_open_do_not_harm_a_running_putter_and_its_getter() {
    let robot = Robot::new(&ONE.replace("get_ports = 3", "get_ports = 100"));
    let _hub = robot.hub();
    let putter = robot.start(&["put", "a"]);
    let hz = robot.start_hz("3");
    for half_milliseconds in 0..60 {
        let getter = robot.quiet(&["echo", "a"]);
        std::thread::sleep(Duration::from_micros(500 * half_milliseconds));
        drop(getter);
    }
    let output = hz.wait_with_output().unwrap();
    is_steady(&serde_json::from_slice(&output.stdout).unwrap());
    robot.wait_for_ports(1, 0);
    is_steady(&robot.hz("a", "0.3"));
    putter.ends_well();
}

#[test]
fn a_killed_hub_is_not_missed_and_the_next_one_takes_over() {
    let robot = Robot::new(ONE);
    let hub = robot.hub();
    let _putter = robot.start(&["put", "a"]);
    let hz = robot.start_hz("1.5");
    drop(hub);
    std::thread::sleep(Duration::from_millis(300));
    let hub = robot.hub();
    let output = hz.wait_with_output().unwrap();
    is_steady(&serde_json::from_slice(&output.stdout).unwrap());
    // New and old clients meet under the new hub.
    is_steady(&robot.hz("a", "0.3"));
    drop(hub);
    let _hub = robot.hub();
    is_steady(&robot.hz("a", "0.3"));
}

#[test]
fn hubs_and_clients_killed_while_they_begin_leave_nothing_that_stops_the_next() {
    let channels: String = (0..20)
        .map(|number| ONE.replace("channels.a", &format!("channels.c{number}")))
        .collect();
    let robot = Robot::new(&format!("{ONE}{channels}"));
    let begin_and_kill = |arguments: &[&str], milliseconds: u64| {
        let running = robot.quiet(arguments);
        std::thread::sleep(Duration::from_millis(milliseconds));
        drop(running);
    };
    for milliseconds in 0..20 {
        begin_and_kill(&["hub"], 2 * milliseconds);
    }
    let _hub = robot.hub();
    for milliseconds in 0..20 {
        begin_and_kill(&["put", "a"], milliseconds);
        begin_and_kill(&["echo", "a"], milliseconds);
    }
    let _putter = robot.start(&["put", "a"]);
    is_steady(&robot.hz("a", "0.5"));
    robot.wait_for_ports(1, 0);
}

#[test]
fn an_amok_putter_does_not_disturb_another_channel() {
    let robot = Robot::new(&format!(
        "{ONE}[channels.b]\npacket = \"u8\"\nitem_bytes = 1\nitems = 1000\n"
    ));
    let _hub = robot.hub();
    let _putter = robot.start(&["put", "a"]);
    let _amok = robot.start(&["put", "b", "--rate", "0"]);
    let stuck = robot.quiet(&["echo", "b"]);
    signal("STOP", stuck.0.id());
    is_steady(&robot.hz("a", "0.7"));
}

#[test]
fn too_little_shared_memory_is_an_error_and_no_crash() {
    let free = String::from_utf8(
        Command::new("df")
            .args(["--output=avail", "-B1"])
            .arg(tactnet_channel::memory_folder().unwrap())
            .output()
            .unwrap()
            .stdout,
    )
    .unwrap();
    let free: u64 = free.lines().nth(1).unwrap().trim().parse().unwrap();
    // Ten packets, each a fifth of the free memory.
    let robot = Robot::new(&format!(
        "[channels.a]\npacket = \"u8\"\nitem_bytes = 1\nitems = {}\nget_ports = 1\ndepth = 7\n",
        free / 5
    ));
    let _hub = robot.hub();
    let full = stderr(&expect(2, robot.command(&["put", "a"])));
    assert!(full.contains("bytes of shared memory"), "{full}");
    assert!(full.contains("are free"), "{full}");
    assert_eq!(full.trim().lines().count(), 1, "{full}");
    robot.wait_for_ports(0, 0);
}

#[test]
fn the_stress_test_measures_every_requested_transport() {
    let folder = TempDir::new().unwrap();
    let page = folder.path().join("stress.html");
    let picture = folder.path().join("stress.svg");
    let mut stress = tactnet([
        "channel",
        "stress",
        "--json",
        "--seconds",
        "0.05",
        "--sizes",
        "4,65536",
    ]);
    stress
        .args(["--clients", "1,3", "--against", "iceoryx2", "--html"])
        .arg(&page)
        .arg("--picture")
        .arg(&picture);
    let result = json(stress);
    let rows = result["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 2 * 2 * 2);
    for row in rows {
        assert_eq!(row["failures"], 0, "{row}");
        let [median, p99, max] =
            ["median_us", "p99_us", "max_us"].map(|name| row[name].as_f64().unwrap());
        assert!(0.0 < median && median <= p99 && p99 <= max, "{row}");
    }
    let page = std::fs::read_to_string(page).unwrap();
    assert!(
        page.contains("figure 2.6") && page.contains("figure 2.7"),
        "two sizes and two numbers of clients"
    );
    let picture = std::fs::read_to_string(picture).unwrap();
    // Figures 2.6 and 2.7, left and right, each with two lines and their samples in the legend.
    assert_eq!(picture.matches("<polyline").count(), 3 * 2 * 2);

    let mut configurations = tactnet([
        "channel",
        "stress",
        "--json",
        "--seconds",
        "0.05",
        "--sizes",
        "4",
        "--clients",
        "3",
    ]);
    configurations.args(["--domain", "process,host", "--configurations", "all"]);
    let result = json(configurations);
    let rows = result["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 10);
    assert!(rows.iter().all(|row| row["failures"] == 0), "{result}");
}
