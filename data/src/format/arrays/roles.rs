//! Names of the arrays that hold samples, labels and sample rate.

use super::super::read_options::ReadOptions;

/// Array that a data set needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::format) enum Role<'n> {
    /// The sweeps.
    Samples,
    /// The material of every sweep.
    Labels,
    /// The array of this name.
    Named(&'n str),
}

/// Names of arrays by what they hold, in order of preference.
#[derive(Debug, Clone, Default)]
pub(in crate::format) struct Roles {
    pub(in crate::format) samples: Vec<String>,
    pub(in crate::format) labels: Vec<String>,
    pub(in crate::format) rate: Vec<String>,
}

/// Names of the samples in MATLAB files, in lower case.
const SAMPLES: [&str; 8] = [
    "samples",
    "x",
    "sweeps",
    "data",
    "recordings",
    "signals",
    "signal",
    "x_train",
];
/// Names of the labels in MATLAB files, in lower case.
const LABELS: [&str; 9] = [
    "labels", "y", "label", "class", "classes", "material", "target", "targets", "y_train",
];
/// Names of the sample rate, in lower case.
pub(in crate::format) const RATES: [&str; 10] = [
    "sample_rate_hz",
    "sampling_rate_hz",
    "rate_hz",
    "sample_rate",
    "samplerate",
    "sampling_rate",
    "rate",
    "fs",
    "hz",
    "fps",
];

fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

impl Roles {
    /// Returns the names of this project's own files. Names in the options replace them.
    pub(in crate::format) fn own(options: &ReadOptions) -> Self {
        let named = |name: &Option<String>, usual: &[&str]| match name {
            Some(name) => vec![name.clone()],
            None => owned(usual),
        };
        Self {
            samples: named(&options.samples, &["samples", "X"]),
            labels: named(&options.labels, &["labels", "y"]),
            rate: vec![super::RATE_ATTRIBUTE.into()],
        }
    }

    /// Returns those of `names` that usually hold samples, labels and rate in a MATLAB file, in any case of letters.
    /// Names in the options replace them.
    pub(in crate::format) fn of_matlab<'n>(
        options: &ReadOptions,
        names: impl Iterator<Item = &'n str> + Clone,
    ) -> Self {
        let own = Self::own(options);
        let usual = |usual: &[&str]| -> Option<Vec<String>> {
            let alike = |usual: &&str| names.clone().find(|name| name.eq_ignore_ascii_case(usual));
            usual.iter().find_map(alike).map(|name| vec![name.into()])
        };
        let unless_named = |named: &Option<String>, own, usual: Option<Vec<String>>| match named {
            Some(_) => own,
            None => usual.unwrap_or(own),
        };
        Self {
            samples: unless_named(&options.samples, own.samples, usual(&SAMPLES)),
            labels: unless_named(&options.labels, own.labels, usual(&LABELS)),
            rate: usual(&RATES).unwrap_or(own.rate),
        }
    }

    /// Returns the names of a role.
    pub(in crate::format) fn names<'r>(&'r self, role: Role<'r>) -> Vec<&'r str> {
        match role {
            Role::Samples => self.samples.iter().map(String::as_str).collect(),
            Role::Labels => self.labels.iter().map(String::as_str).collect(),
            Role::Named(name) => vec![name],
        }
    }

    /// Returns true if one of the roles has this name.
    pub(in crate::format) fn contain(&self, name: &str) -> bool {
        let all = self.samples.iter().chain(&self.labels).chain(&self.rate);
        all.into_iter().any(|known| known == name)
    }
}
