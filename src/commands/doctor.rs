//! `tactnet doctor`: checks of this machine, with advice for everything that is missing.

mod limits;
mod machine;
mod memory;
mod ports;
mod programs;

use std::fmt;
use std::process::ExitCode;

use clap::Args;
use serde::Serialize;

use super::version;
use crate::failure;
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(
    after_help = "Examples:\n  tactnet doctor\n  tactnet doctor --json\n\n\
    The command changes nothing. It exits with code 1 if something does not work, else with 0."
)]
pub struct DoctorArgs {
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Prints the diagnosis.
pub fn run(arguments: &DoctorArgs) -> anyhow::Result<ExitCode> {
    let found = Diagnosis::of_this_machine(version::name(), &version::features());
    let code = if found.worst() == Status::Failure {
        ExitCode::from(failure::FAILED)
    } else {
        ExitCode::SUCCESS
    };
    match OutputFormat::from_flag(arguments.json) {
        OutputFormat::Json => output::print_json(&found)?,
        OutputFormat::Table => output::print(found)?,
    }
    Ok(code)
}

/// Result of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
enum Status {
    /// Works.
    Ok,
    /// An optional part is missing.
    Note,
    /// Works with limitations.
    Warning,
    /// Does not work.
    Failure,
}

/// One check.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
struct Check {
    /// Name of the checked item.
    name: &'static str,
    /// Result of the check.
    status: Status,
    /// State that was found.
    found: String,
    /// Action to take; absent if the result is ok.
    #[serde(skip_serializing_if = "Option::is_none")]
    advice: Option<String>,
}

impl Check {
    fn ok(name: &'static str, found: impl Into<String>) -> Self {
        Self {
            name,
            status: Status::Ok,
            found: found.into(),
            advice: None,
        }
    }

    fn not_ok(
        status: Status,
        name: &'static str,
        found: impl Into<String>,
        advice: impl Into<String>,
    ) -> Self {
        Self {
            name,
            status,
            found: found.into(),
            advice: Some(advice.into()),
        }
    }
}

/// Results of all checks. As text: one line per check, and one for its advice.
#[derive(Debug, Serialize)]
struct Diagnosis {
    schema_version: u32,
    version: String,
    checks: Vec<Check>,
}

impl Diagnosis {
    /// Checks this machine with the permissions of this user. The only side effect is that the folder of channels is created.
    ///
    /// - `version`: version, commit and features of the program
    /// - `features`: optional cargo features of this build
    fn of_this_machine(version: &str, features: &[&str]) -> Self {
        let mut checks = machine::checks();
        checks.extend(memory::checks());
        checks.extend(limits::checks());
        checks.extend(ports::checks());
        checks.extend(programs::checks(features));
        Self {
            schema_version: 1,
            version: version.into(),
            checks,
        }
    }

    /// Returns the worst result.
    fn worst(&self) -> Status {
        let statuses = self.checks.iter().map(|check| check.status);
        statuses.max().unwrap_or(Status::Ok)
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "tactnet {}", self.version)?;
        for check in &self.checks {
            let mark = match check.status {
                Status::Ok => "ok",
                Status::Note => "-",
                Status::Warning => "warning",
                Status::Failure => "FAILS",
            };
            writeln!(f, "{mark:<8} {:<18} {}", check.name, check.found)?;
            if let Some(advice) = &check.advice {
                writeln!(f, "{:<27} {advice}", "")?;
            }
        }
        let count = |status| self.checks.iter().filter(|it| it.status == status).count();
        write!(
            f,
            "{} checks: {} failed, {} warnings, {} optional parts missing",
            self.checks.len(),
            count(Status::Failure),
            count(Status::Warning),
            count(Status::Note)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_problem_comes_with_advice() {
        let found = Diagnosis::of_this_machine("0.1.0", &[]);
        assert!(found.checks.len() > 10, "{found}");
        for check in &found.checks {
            assert_eq!(
                check.status == Status::Ok,
                check.advice.is_none(),
                "{check:?}"
            );
            assert!(!check.found.is_empty(), "{check:?}");
        }
        let names: std::collections::BTreeSet<_> =
            found.checks.iter().map(|check| check.name).collect();
        assert_eq!(names.len(), found.checks.len(), "one name for each");
    }
}
