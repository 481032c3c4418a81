//! The tutorial's commands, run as they are printed.

use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

#[test]
fn the_tutorial_runs_as_it_stands() {
    let page = include_str!("../../docs/tutorial.md");
    let (_, rest) = page.split_once("```sh\n").unwrap();
    let (script, _) = rest.split_once("```").unwrap();
    let calls = script.lines().filter(|line| line.starts_with("tactnet "));
    assert_eq!(calls.count(), 10, "ten commands");
    let folder = TempDir::new().unwrap();
    // A private bus, so that two tests do not share one.
    let bus = format!("tutorial{}", std::process::id());
    let script = script.replace(
        "> robot.toml\n",
        &format!("| sed 's/^bus = .*/bus = \"{bus}\"/' > robot.toml\n"),
    );
    let programs = Path::new(env!("CARGO_BIN_EXE_tactnet")).parent().unwrap();
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap());
    let output = Command::new("bash")
        // Jobs have numbers only with `-m`.
        .args(["-m", "-e", "-o", "pipefail", "-c", &script])
        .current_dir(folder.path())
        .env("PATH", path)
        .output()
        .unwrap();
    let table = tactnet_channel::Table::load(&folder.path().join("robot.toml")).unwrap();
    tactnet_channel::remove_bus(&table).unwrap();
    let (out, errors) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert!(output.status.success(), "{out}\n{errors}");
    assert!(
        errors.contains("tuesday.npz: 30 sweeps of 3 materials"),
        "{errors}"
    );
    let last = out.trim().lines().last().unwrap();
    assert!(last.contains(" 0 lost; 30 sweeps, "), "{last}\n{errors}");
    assert!(
        last.ends_with("differ: another network, as requested"),
        "{last}"
    );
}
