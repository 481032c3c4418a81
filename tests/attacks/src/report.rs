//! Attacks on all targets, each in its own process.

use std::process::{Command, Stdio};

use serde::Serialize;

use crate::run::{HANGS, Limits, Row, last_input};
use crate::targets;

/// Document printed by `tactnet-attacks`.
#[derive(Debug, Serialize)]
pub struct Report {
    schema_version: u32,
    seed: u64,
    rows: Vec<Row>,
    skipped: Vec<Skipped>,
}

/// Target that this build lacks.
#[derive(Debug, Serialize)]
struct Skipped {
    target: String,
    reason: &'static str,
}

impl Report {
    /// Attacks all targets, or one, by running this program again.
    ///
    /// # Errors
    /// Fails as [`crate::attack`] does.
    pub fn of(target: Option<&str>, limits: &Limits) -> anyhow::Result<Self> {
        let names = match target {
            Some(name) => vec![name],
            None => targets::NAMES.to_vec(),
        };
        let (mut rows, mut skipped) = (Vec::new(), Vec::new());
        for name in names {
            if let Some(reason) = targets::lacking(name) {
                eprintln!("{name}: skipped, {reason}");
                skipped.push(Skipped {
                    target: name.into(),
                    reason,
                });
                continue;
            }
            eprintln!("{name} …");
            rows.push(row(name, limits)?);
        }
        Ok(Self {
            schema_version: 1,
            seed: limits.seed,
            rows,
            skipped,
        })
    }

    /// Returns true if there was no failure.
    pub fn is_clean(&self) -> bool {
        self.rows
            .iter()
            .all(|row| row.panics + row.hangs + row.over_memory + row.lost == 0)
    }
}

fn row(name: &str, limits: &Limits) -> anyhow::Result<Row> {
    let child = Command::new(std::env::current_exe()?)
        .args(["--child", "--target", name])
        .args(["--seconds", &limits.seconds.to_string()])
        .args(["--executions", &limits.executions.to_string()])
        .args(["--seed", &limits.seed.to_string()])
        .arg("--out")
        .arg(&limits.out)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    let last = last_input(child.id());
    let output = child.wait_with_output()?;
    if !output.status.success() && last.exists() {
        std::fs::copy(&last, limits.out.join(format!("{name}-last")))?;
    }
    let _ = std::fs::remove_file(&last);
    if output.status.success() {
        return Ok(serde_json::from_slice(&output.stdout)?);
    }
    let hangs = output.status.code() == Some(HANGS);
    // The process was ended by a signal: out of memory, or a panic that could not unwind.
    if hangs || output.status.code().is_none() {
        return Ok(Row {
            target: name.into(),
            hangs: u64::from(hangs),
            panics: u64::from(!hangs),
            ..Row::default()
        });
    }
    anyhow::bail!("{}", String::from_utf8_lossy(&output.stderr).trim());
}
