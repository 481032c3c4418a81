//! One thing that a check found, and many of them for people to read.

use crate::Remedy;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Training would fail or its result would mean nothing; it is refused.
    Error,
    /// Likely a fault of sensor or recording.
    Warning,
    /// Normal for some sensors, but good to know.
    Note,
}

/// What a finding is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// NaN or infinite values.
    NotFinite,
    /// Sweeps of several lengths.
    UnequalLengths,
    /// A sweep in which no taxel ever changes.
    ConstantSweep,
    /// Two sweeps with the same values.
    IdenticalSweeps,
    /// A material with fewer than two sweeps, or fewer than the usual folds.
    FewSweeps,
    /// A taxel that has one value in the whole data set.
    DeadTaxel,
    /// A taxel that keeps one value throughout a sweep.
    ConstantTaxel,
    /// Many values at the ceiling of the sensor.
    Saturation,
    /// Values unlike those of the other sweeps.
    OutOfRange,
    /// Materials with unequal numbers of sweeps.
    UnbalancedMaterials,
    /// A sample rate that nobody named.
    AssumedRate,
    /// Materials that have numbers for names.
    NumberedMaterials,
    /// More taxels side by side than time steps.
    AxisOrder,
    /// Sweeps of less than a twentieth of a second.
    ShortSweeps,
    /// Sweeps of more than ten minutes.
    LongSweeps,
    /// A taxel that rises steadily, and alike in all sweeps.
    ClockTaxel,
    /// A single material, so that there is nothing to tell apart.
    SingleMaterial,
    /// Materials whose names differ in nothing but case or blanks.
    AlikeNames,
    /// Taxels in one row, since the file does not say how they are arranged.
    AssumedPatch,
    /// Something in the file that is not read.
    NotRead,
}

impl FindingKind {
    /// True if it says something of the materials, and nothing of the values.
    pub fn is_about_materials(self) -> bool {
        matches!(
            self,
            Self::FewSweeps
                | Self::UnbalancedMaterials
                | Self::NumberedMaterials
                | Self::SingleMaterial
                | Self::AlikeNames
        )
    }
}

/// Where a finding is, as far as it has a place.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Place {
    /// Index of the sweep in the data set.
    pub sweep: Option<usize>,
    /// Number of the taxel, row by row.
    pub taxel: Option<usize>,
    /// Time step.
    pub step: Option<usize>,
}

/// One thing that is wrong or odd.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// What it is about.
    pub kind: FindingKind,
    /// The first place where it shows.
    pub at: Place,
    /// A sentence for people: material, sweep, taxels, numbers.
    pub message: String,
    /// Cure, if the caller can apply one; [`Finding::message`] does not contain it.
    #[serde(skip)]
    pub remedy: Option<Remedy>,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Error => "error",
            Self::Warning => "warning",
            Self::Note => "note",
        })
    }
}

impl fmt::Display for FindingKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::NotFinite => "values that are not finite",
            Self::UnequalLengths => "sweeps of several lengths",
            Self::ConstantSweep => "constant sweeps",
            Self::IdenticalSweeps => "identical sweeps",
            Self::FewSweeps => "too few sweeps",
            Self::DeadTaxel => "dead taxels",
            Self::ConstantTaxel => "constant taxels",
            Self::Saturation => "saturation",
            Self::OutOfRange => "values out of range",
            Self::UnbalancedMaterials => "unbalanced materials",
            Self::AssumedRate => "assumed sample rate",
            Self::NumberedMaterials => "numbered materials",
            Self::AxisOrder => "suspicious order of axes",
            Self::ShortSweeps => "short sweeps",
            Self::LongSweeps => "long sweeps",
            Self::ClockTaxel => "a clock among the taxels",
            Self::SingleMaterial => "a single material",
            Self::AlikeNames => "names that are alike",
            Self::AssumedPatch => "assumed arrangement of the taxels",
            Self::NotRead => "not read",
        })
    }
}

impl Finding {
    /// Returns true if it is about the data set as a whole, not about one sweep or taxel.
    pub fn is_general(&self) -> bool {
        self.at == Place::default()
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.severity, self.message)
    }
}

/// All findings of a check, with the numbers of errors and warnings.
#[derive(Debug, Clone, Serialize)]
pub struct CheckReport {
    /// Findings of [`Severity::Error`].
    pub errors: usize,
    /// Findings of [`Severity::Warning`].
    pub warnings: usize,
    /// All findings, errors first.
    pub findings: Vec<Finding>,
}

impl CheckReport {
    /// Counts `findings`.
    pub fn of(findings: Vec<Finding>) -> Self {
        let count = |severity| findings.iter().filter(|f| f.severity == severity).count();
        Self {
            errors: count(Severity::Error),
            warnings: count(Severity::Warning),
            findings,
        }
    }
}

/// Findings of one kind and severity.
#[derive(Debug, Clone, Serialize)]
pub struct FindingGroup {
    /// How bad they are.
    pub severity: Severity,
    /// What they are about.
    pub kind: FindingKind,
    /// All of them, in the order of the sweeps.
    pub findings: Vec<Finding>,
}

/// Puts findings of one kind and severity together, errors first.
pub fn group_findings(findings: &[Finding]) -> Vec<FindingGroup> {
    let mut groups: BTreeMap<(Severity, FindingKind), Vec<Finding>> = BTreeMap::new();
    for finding in findings {
        groups
            .entry((finding.severity, finding.kind))
            .or_default()
            .push(finding.clone());
    }
    groups
        .into_iter()
        .map(|((severity, kind), findings)| FindingGroup {
            severity,
            kind,
            findings,
        })
        .collect()
}
