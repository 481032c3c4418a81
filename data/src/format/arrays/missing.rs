//! Errors about missing arrays: the arrays of the file, and which of them may be meant.

use super::super::named_sweeps::some_of;
use super::{Arrays, Container, Role};
use crate::{DataError, Remedy};

/// Names, in lower case, of arrays that probably hold the sweeps under a wrong name.
const MEANT_AS_SAMPLES: &[&str] = &[
    "arr_0",
    "data",
    "input",
    "inputs",
    "recordings",
    "sample",
    "signal",
    "signals",
    "sweeps",
    "values",
    "x",
    "x_train",
];
/// Names, in lower case, of arrays that probably hold the materials under a wrong name.
const MEANT_AS_LABELS: &[&str] = &[
    "arr_1", "class", "classes", "label", "material", "target", "targets", "y", "y_train",
];
/// Names, in lower case, of arrays that may hold block numbers.
pub(super) const MEANT_AS_BLOCKS: &[&str] = &[
    "block",
    "block_id",
    "block_ids",
    "blocks",
    "session",
    "session_id",
    "session_ids",
    "sessions",
];
/// Names, in lower case, of arrays that probably hold the sample rate under a wrong name.
pub(super) const MEANT_AS_RATE: &[&str] = &[
    "fps",
    "fs",
    "hz",
    "rate",
    "rate_hz",
    "sample_rate",
    "samplerate",
    "sampling_rate",
    "sampling_rate_hz",
];

impl Arrays<'_> {
    /// Returns the error of a missing array: the arrays of the file, and which may be meant.
    pub(super) fn missing(&self, role: Role<'_>) -> DataError {
        let there = self.there();
        let found = match there.is_empty() {
            true => format!("no {}", self.container.word()),
            false => some_of(there),
        };
        let names = self.roles.names(role);
        // The documentation uses the first name for HDF5 and the last one for the others.
        let name = match self.container {
            Container::Hdf5 => names.first(),
            Container::Npz | Container::Mat => names.last(),
        };
        let name = name.copied().unwrap_or_default();
        let error = self.error(
            name,
            self.expected(role, &names),
            format!("only {found}{}", self.hint(role, name)),
        );
        match (role, self.container) {
            (Role::Samples, Container::Mat | Container::Hdf5) => {
                error.with_remedy(Remedy::NameSamples)
            }
            _ => error,
        }
    }

    /// Returns names, shapes and types of all arrays.
    fn there(&self) -> Vec<String> {
        let shown = |name: &str, shape: Option<&Vec<usize>>, of_type: Option<&str>| {
            let shape = shape.filter(|shape| !shape.is_empty());
            let shape = shape.map_or(String::new(), |shape| format!(" {shape:?}"));
            let of_type = of_type.map_or(String::new(), |name| format!(" {name}"));
            format!("`{name}`{shape}{of_type}")
        };
        let taken = self.taken.iter();
        let taken = taken.map(|(name, shape)| shown(name, Some(shape), None));
        let known = self.by_name.iter().map(|(name, array)| {
            let array = array.as_ref().ok();
            let of_type = array.map(super::Array::type_name);
            let of_type = of_type.filter(|_| self.container != Container::Npz);
            shown(name, array.map(|array| &array.shape), of_type.as_deref())
        });
        let others = self.others.iter();
        let others = others.map(|of| shown(&of.name, of.shape.as_ref(), of.type_name.as_deref()));
        taken.chain(known).chain(others).collect()
    }

    /// Returns the place and shape of a missing array.
    fn expected(&self, role: Role<'_>, names: &[&str]) -> String {
        match (self.container, role, names) {
            (Container::Npz, Role::Samples, [_, _]) => {
                "to be in the archive: np.savez_compressed(\"sweeps.npz\", X=X, y=y) \
                    with X [n][steps][taxels] and y [n]"
                    .to_owned()
            }
            (Container::Npz, _, [other, _]) => format!("to be in the archive (or `{other}`)"),
            (Container::Npz, _, _) => "to be in the archive".to_owned(),
            (Container::Mat, _, [other, _]) | (Container::Hdf5, _, [_, other]) => {
                format!("to be in the file (or `{other}`)")
            }
            _ => "to be in the file".to_owned(),
        }
    }

    /// Returns advice about arrays that may be meant.
    fn hint(&self, role: Role<'_>, name: &str) -> String {
        if self.container != Container::Npz {
            return String::new();
        }
        // Sweeps and labels under wrong names are reported together.
        let labels = match role {
            Role::Samples if !self.has(Role::Labels) => self.meant(Role::Labels),
            _ => None,
        };
        match (self.meant(role), labels) {
            (Some(meant), Some(labels)) => format!(
                "; rename `{meant}` to `{name}` and `{labels}` to `y`, if that is what they hold"
            ),
            (Some(meant), None) => {
                format!("; rename `{meant}` to `{name}`, if that is what it holds")
            }
            (None, _) if role == Role::Samples => self.one_for_each_material().unwrap_or_default(),
            (None, _) => String::new(),
        }
    }

    /// Returns the array that probably holds the values under a wrong name.
    fn meant(&self, role: Role<'_>) -> Option<&str> {
        let usual = match role {
            Role::Samples => MEANT_AS_SAMPLES,
            Role::Labels => MEANT_AS_LABELS,
            Role::Named(_) => &[],
        };
        let mut others = self.others.iter().map(|of| of.name.as_str());
        others.find(|other| usual.contains(&other.to_lowercase().as_str()))
    }

    /// Returns a hint to concatenate several arrays of sweeps of one shape, for example one per material.
    fn one_for_each_material(&self) -> Option<String> {
        let mut shapes = self.others.iter().map(|of| of.shape.as_deref());
        let of_sweep = shapes.next()??.get(1..)?.to_vec();
        let alike = |shape: Option<&[usize]>| shape.and_then(|s| s.get(1..)) == Some(&of_sweep);
        let many = self.others.len() > 1 && of_sweep.len() > 1 && shapes.all(alike);
        many.then(|| {
            "; one array for each material? `d = dict(np.load(FILE)); np.savez_compressed(\"sweeps.npz\", X=np.concatenate(list(d.values())), \
             y=np.repeat(list(d), [len(x) for x in d.values()]))`"
                .into()
        })
    }
}
