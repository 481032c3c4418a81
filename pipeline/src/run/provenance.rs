//! Program, build and machine that produced a result.

use serde::{Deserialize, Serialize};

/// Program and machine of a session. No field identifies a single machine or a person.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of the program.
    pub version: String,
    /// Commit of the build, with `-dirty` for a modified tree, or `unknown` outside a repository.
    pub git: String,
    /// Operating system.
    pub os: String,
    /// Processor architecture.
    pub arch: String,
    /// Processor model, or `unknown`.
    pub processor: String,
    /// Number of available threads.
    pub threads: usize,
}

impl Provenance {
    /// Returns the provenance of this process; `version` and `git` come from the build.
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

/// Returns the peak resident memory of this process in MiB, or `None` if the system does not report it.
pub fn peak_rss_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kibibytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kibibytes / 1024.0)
}
