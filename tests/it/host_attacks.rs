//! Regression tests of attacks on the files of a bus by other programs and users of its host.

use std::fs::Permissions;
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown, symlink};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant, SystemTime};

use tactnet_channel::{MEMORY_FOLDER_VARIABLE, memory_folder, remove_bus};
use tactnet_skin::ServeConfig;

use crate::command::{Lab, expect, stderr};
use crate::robot::Running;

const PATIENCE: Duration = Duration::from_secs(20);

/// A link in shared memory made the hub empty a file of its user, and a file with a future timestamp prevented its start.
#[test]
fn a_hub_follows_no_link_and_waits_for_no_file_from_the_future() {
    let lab = Lab::new();
    let table = ServeConfig::default().table(&format!("links{}", std::process::id()));
    let written = toml::to_string(&table).unwrap();
    std::fs::write(lab.path("robot.toml"), &written).unwrap();
    let bus = format!("{}{}", table.bus, table.network.host);
    let hub = || lab.command("channel hub --table @robot.toml");
    let memory = memory_folder().unwrap().join(&bus);
    std::fs::create_dir(&memory).unwrap();
    let lock = memory.join("hub");
    symlink(lab.path("robot.toml"), &lock).unwrap();
    let refused = stderr(&expect(1, hub()));
    assert!(refused.contains("it is a link"), "{refused}");
    let victim = std::fs::read_to_string(lab.path("robot.toml")).unwrap();
    assert_eq!(victim, written, "nothing was emptied");
    std::fs::remove_file(&lock).unwrap();

    let connection = memory.join(format!("{bus}_x.connection"));
    let file = std::fs::File::create(&connection).unwrap();
    file.set_modified(SystemTime::now() + Duration::from_secs(100_000_000))
        .unwrap();
    let begun = Instant::now();
    Running::start(hub()).end();
    assert!(begun.elapsed() < PATIENCE, "{begun:?}");
    assert!(!connection.exists());
    remove_bus(&table).unwrap();
}

fn may_change_user() -> bool {
    let own = tempfile::tempfile().unwrap();
    own.metadata().unwrap().uid() == 0
}

/// Returns the files in a folder and its folders.
fn files_below(folder: PathBuf) -> Vec<PathBuf> {
    let (mut files, mut folders) = (Vec::new(), vec![folder]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                &mut folders
            } else {
                &mut files
            }
            .push(path);
        }
    }
    files
}

/// Runs a shell command as another user, and returns true if it succeeds.
fn stranger_can(command: &str) -> bool {
    let mut stranger = Command::new("sh");
    stranger.args(["-c", command]).uid(65534).gid(65534);
    stranger.output().unwrap().status.success()
}

/// Other users could empty, lock or create files of a bus in advance. This test needs root to act as two users.
#[test]
fn another_user_gets_nowhere_near_a_bus() {
    if !may_change_user() {
        eprintln!("left out: it takes root to be two users");
        return;
    }
    let place = tempfile::tempdir_in("/dev/shm").unwrap();
    std::fs::set_permissions(place.path(), Permissions::from_mode(0o755)).unwrap();
    let lab = Lab::new();
    let table = ServeConfig::default().table(&format!("users{}", std::process::id()));
    let written = toml::to_string(&table).unwrap();
    std::fs::write(lab.path("robot.toml"), &written).unwrap();
    let hub = |folder: &Path| {
        let mut hub = lab.command("channel hub --table @robot.toml");
        hub.env(MEMORY_FOLDER_VARIABLE, folder);
        hub
    };
    let own = place.path().join("own");
    let running = Running::start(hub(&own));
    let files = files_below(own);
    assert!(files.len() > 5, "{files:?}");
    assert!(stranger_can("cat /etc/passwd"), "an ordinary user");
    for file in files {
        let shown = file.display();
        for attack in [
            format!("cat '{shown}'"),
            format!("truncate -s 0 '{shown}'"),
            format!("flock -n '{shown}' true"),
            format!("rm '{shown}'"),
        ] {
            assert!(!stranger_can(&attack), "{attack}");
        }
    }
    running.end();

    // A folder that a stranger created first.
    let theirs = place.path().join("theirs");
    std::fs::create_dir(&theirs).unwrap();
    chown(&theirs, Some(65534), Some(65534)).unwrap();
    let refused = stderr(&expect(1, hub(&theirs)));
    assert!(refused.contains("it belongs to user 65534"), "{refused}");
    assert!(refused.contains(MEMORY_FOLDER_VARIABLE), "{refused}");
    assert_eq!(refused.lines().count(), 1, "{refused}");
}

/// The sandbox of the hub's systemd unit was almost open.
#[test]
fn units_are_closed_to_what_they_do_not_need() {
    for unit in ["tactnet.service", "tactnet-hub.service"] {
        let path = format!("{}/serving/{unit}", env!("CARGO_MANIFEST_DIR"));
        let checked = Command::new("systemd-analyze")
            // In tenths of the exposure level.
            .args(["security", "--offline=yes", "--threshold=22", &path])
            .output();
        let Ok(checked) = checked else {
            eprintln!("left out: there is no systemd-analyze");
            return;
        };
        let said = String::from_utf8_lossy(&checked.stdout);
        assert!(checked.status.success(), "{said}");
        assert!(said.contains("Overall exposure level"), "{said}");
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains("RuntimeDirectory=tactnet\n"), "{unit}");
        assert!(text.contains("LimitNOFILE="), "{unit}");
    }
}
