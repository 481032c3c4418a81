//! The build script, compiled and run in a test repository.

use std::fs;
use std::path::Path;
use std::process::Command;

fn git(folder: &Path, arguments: &[&str]) {
    let who = [
        "-c",
        "user.name=tester",
        "-c",
        "user.email=tester@example.org",
    ];
    let mut command = Command::new("git");
    let status = command
        .args(who)
        .args(arguments)
        .current_dir(folder)
        .status();
    assert!(status.unwrap().success(), "git {arguments:?}");
}

#[test]
fn an_unstaged_edit_in_any_tracked_folder_marks_the_commit_as_dirty() {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("build-script");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("build.rs");
    let compiled = Command::new("rustc")
        .args(["--edition", "2024", "-o"])
        .args([&script, &source])
        .status();
    assert!(compiled.unwrap().success());

    let repository = folder.path().join("repository");
    let edited = repository.join("experiments/recipes/nshot.toml");
    fs::create_dir_all(edited.parent().unwrap()).unwrap();
    fs::write(&edited, "splits = 3\n").unwrap();
    fs::create_dir_all(repository.join("serving/src")).unwrap();
    fs::write(repository.join("serving/src/lib.rs"), "").unwrap();
    git(&repository, &["init", "--quiet"]);
    git(&repository, &["add", "--all"]);
    git(&repository, &["commit", "--quiet", "--message", "first"]);
    let says = || {
        let output = Command::new(&script).current_dir(&repository).output();
        String::from_utf8(output.unwrap().stdout).unwrap()
    };

    let clean = says();
    for watched in ["experiments", "serving", "build.rs"] {
        let line = format!("cargo::rerun-if-changed={watched}");
        assert!(
            clean.lines().any(|found| found == line),
            "{line} in {clean}"
        );
    }
    assert!(!clean.contains("-dirty"), "{clean}");
    fs::write(&edited, "splits = 4\n").unwrap();
    assert!(says().contains("-dirty"), "after an edit");
}
