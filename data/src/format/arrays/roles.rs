//! Names of the arrays that hold samples, labels and sample rate.

use super::super::read_options::ReadOptions;
use super::Container;

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
#[derive(Debug, Clone)]
pub(in crate::format) struct Roles {
    pub(in crate::format) samples: Vec<String>,
    pub(in crate::format) labels: Vec<String>,
    pub(in crate::format) rate: Vec<String>,
    /// Name of the blocks, and true if the caller named it.
    pub(in crate::format) blocks: (String, bool),
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
            blocks: match &options.blocks {
                Some(name) => (name.clone(), true),
                None => ("blocks".into(), false),
            },
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
            blocks: own.blocks,
        }
    }

    /// Returns the paths of samples, labels and rate among those of a file. Labels and rate are looked for in the group of
    /// the samples, then at the top.
    pub(in crate::format) fn of_paths(
        container: Container,
        paths: &[&str],
        options: &ReadOptions,
    ) -> Self {
        let named = ReadOptions {
            samples: options.samples.as_ref().map(|name| path_of(paths, name)),
            labels: options.labels.as_ref().map(|name| path_of(paths, name)),
            blocks: options.blocks.as_ref().map(|name| path_of(paths, name)),
            ..ReadOptions::default()
        };
        let group = group_of(named.samples.as_deref().unwrap_or_default());
        let in_group = |group: &str| match container {
            Container::Mat => Self::of_matlab(&named, names_in(paths, group)),
            Container::Npz | Container::Hdf5 => Self::own(&named),
        };
        let mut roles = in_group("");
        if !group.is_empty() && named.labels.is_none() {
            let inside = in_group(group).labels.into_iter();
            let mut labels: Vec<String> = inside.map(|name| format!("{group}{name}")).collect();
            labels.append(&mut roles.labels);
            roles.labels = labels;
        }
        let is_rate = |name: &&str| RATES.contains(&name.to_ascii_lowercase().as_str());
        let rates = |group| {
            names_in(paths, group)
                .filter(is_rate)
                .map(move |name| format!("{group}{name}"))
        };
        roles.rate = rates(group).chain(rates("")).collect();
        roles
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
        all.into_iter().any(|known| known == name) || self.blocks.0 == name
    }
}

/// Returns a path as the file has it: without slashes at the ends. The dots of MATLAB are slashes.
fn path_of(paths: &[&str], name: &str) -> String {
    let path = name.trim_matches('/').to_owned();
    let dotted = path.replace('.', "/");
    match !paths.contains(&path.as_str()) && paths.contains(&dotted.as_str()) {
        true => dotted,
        false => path,
    }
}

/// Returns the group in a path, with a slash at the end; empty at the top.
fn group_of(path: &str) -> &str {
    path.rfind('/').map_or("", |slash| &path[..=slash])
}

/// Returns the names in a group, without its path.
fn names_in<'p>(paths: &'p [&str], group: &'p str) -> impl Iterator<Item = &'p str> + Clone {
    let names = paths
        .iter()
        .filter_map(move |path| path.strip_prefix(group));
    names.filter(|name| !name.contains('/'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_and_rate_are_looked_for_beside_the_samples() {
        let paths = ["a/skin", "a/label", "a/fs", "y", "Rate", "b/y"];
        let options = ReadOptions {
            samples: Some("/a.skin".into()),
            ..ReadOptions::default()
        };
        let roles = Roles::of_paths(Container::Mat, &paths, &options);
        assert_eq!(roles.samples, ["a/skin"]);
        assert_eq!(roles.labels, ["a/label", "y"]);
        assert_eq!(roles.rate, ["a/fs", "Rate"]);
    }
}
