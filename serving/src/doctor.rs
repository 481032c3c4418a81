//! What a machine has for `tactnet`, and what to do about what it lacks: `tactnet doctor`.

mod limits;
mod machine;
mod memory;
mod ports;
mod programs;

use std::fmt;

use serde::Serialize;

/// Whether something is as it should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// As it should be.
    Ok,
    /// Optional, and not there.
    Note,
    /// Works, but not as well as it could.
    Warning,
    /// Something that does not work.
    Failure,
}

/// One thing that was looked at.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Check {
    /// What it is.
    pub name: &'static str,
    /// Whether it is as it should be.
    pub status: Status,
    /// What was found.
    pub found: String,
    /// What to do about it; absent if nothing needs to be done.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub advice: Option<String>,
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

/// Everything that was looked at; as text, one line for each and one more for what to do about it.
#[derive(Debug, Serialize)]
pub struct Diagnosis {
    schema_version: u32,
    version: String,
    checks: Vec<Check>,
}

impl Diagnosis {
    /// Looks at this machine as this user sees it; changes nothing but that the folder of channels is made.
    ///
    /// - `version`: the program, its commit and features
    /// - `features`: optional cargo features of this build
    pub fn of_this_machine(version: &str, features: &[&str]) -> Self {
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

    /// Returns the worst of what was found.
    pub fn worst(&self) -> Status {
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
            "{} looked at: {} fail, {} to mend, {} optional",
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
    fn whatever_is_not_well_comes_with_advice() {
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
