//! Passes the commit of the build to the binary.

use std::collections::BTreeSet;
use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).trim().to_string())
}

fn main() {
    let commit = git(&["rev-parse", "--short=12", "HEAD"]).unwrap_or_else(|| "unknown".into());
    // Without locks git does not touch the index, whose modification time decides if this script runs again.
    let changed = git(&["--no-optional-locks", "status", "--porcelain"])
        .is_some_and(|status| !status.is_empty());
    let suffix = if changed { "-dirty" } else { "" };
    println!("cargo::rustc-env=TACTNET_GIT={commit}{suffix}");
    if let Some(folder) = git(&["rev-parse", "--absolute-git-dir"]) {
        println!("cargo::rerun-if-changed={folder}/HEAD");
        println!("cargo::rerun-if-changed={folder}/logs/HEAD");
        println!("cargo::rerun-if-changed={folder}/index");
    }
    // A change of any tracked file can make the tree differ from its commit.
    let tracked = git(&["ls-files"]).unwrap_or_default();
    let top: BTreeSet<&str> = tracked
        .lines()
        .filter_map(|path| path.split('/').next())
        .collect();
    println!("cargo::rerun-if-changed=build.rs");
    for entry in top {
        println!("cargo::rerun-if-changed={entry}");
    }
}
