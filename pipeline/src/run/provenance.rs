//! Where a result comes from: program, machine, build.

use serde::{Deserialize, Serialize};

/// What was running, and where. Nothing in it identifies a machine or a person.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of the program.
    pub version: String,
    /// Commit it was built from, `-dirty` where the tree had changes, `unknown` outside a repository.
    pub git: String,
    /// Operating system.
    pub os: String,
    /// Processor architecture.
    pub arch: String,
    /// Processor model, where the system tells.
    pub processor: String,
    /// Threads that could be used.
    pub threads: usize,
}

impl Provenance {
    /// Of this process; `version` and `git` come from the build.
    pub fn of_this_process(version: &str, git: &str) -> Self {
        Self {
            version: version.into(),
            git: git.into(),
            os: std::env::consts::OS.into(),
            arch: std::env::consts::ARCH.into(),
            processor: processor_model().unwrap_or_else(|| "unknown".into()),
            threads: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        }
    }
}

fn processor_model() -> Option<String> {
    let info = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = info.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_string())
}

/// Largest resident memory of this process so far in MiB, where the system tells.
pub fn peak_rss_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kibibytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kibibytes / 1024.0)
}
