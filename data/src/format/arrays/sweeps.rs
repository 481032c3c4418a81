//! Sweeps from the arrays of one file.

use super::super::named_sweeps::{Labels, UNLABELLED, block_numbers, records};
use super::super::narrow::HELD;
use super::super::npy::Array;
use super::{Arrays, Container, LENGTHS, Role, normal_texts};
use crate::format::tactmat::SYNTHETIC_ATTRIBUTE;
use crate::twin::TwinVersion;
use crate::{DataError, Dataset, Finding, FindingKind, LabelSet, Severity, SweepShape};

impl Arrays<'_> {
    /// Returns the sweeps, and true if the file names their materials.
    ///
    /// # Errors
    /// An array that is missing or of the wrong shape or type.
    pub(in crate::format) fn into_sweeps(
        mut self,
        labels: Labels,
    ) -> Result<(Dataset, bool), DataError> {
        let labelled = labels == Labels::Needed || self.name_materials();
        let (samples_name, mut samples) = self.take_samples()?;
        let samples_name = samples_name.as_str();
        if !labelled && samples.shape.len() == 2 {
            // Two dimensions are a single sweep.
            samples.shape.insert(0, 1);
        }
        // Three dimensions do not define the arrangement of the taxels.
        let is_row = samples.shape.len() == 3;
        let layout = Layout::of(&self, samples_name, &samples.shape)?;
        let (labels, of_sweep) = match layout.sweeps {
            Some(sweeps) => label_blocks(&self, samples_name, samples.shape[0], sweeps)?,
            None if labelled => self.labels(&samples.shape, samples_name)?,
            None => (
                self.label_set(vec![UNLABELLED.into()])?,
                vec![0; samples.shape[0]],
            ),
        };
        let leading = match layout.sweeps {
            Some(_) => &samples.shape[..2],
            None => &samples.shape[..1],
        };
        let conditions = self.take_conditions(leading);
        let blocks = self.blocks(leading)?;
        let flags = self.test_flags(leading)?;
        let lengths = self.lengths(leading)?;
        if let Some(some) = samples.some_sweeps() {
            some.check(self.path, layout.shape)?;
        }
        let mut findings = self.left_out();
        findings.extend(self.axes_read(samples_name, &samples.shape));
        findings.append(&mut self.findings);
        let type_name = samples.type_name();
        let values = match samples.into_numbers() {
            Some(Ok(values)) => values,
            Some(Err(value)) => return Err(self.error(samples_name, HELD, value.0)),
            None => return Err(self.error(samples_name, "numbers", type_name)),
        };
        let records = records(&of_sweep, labels.len(), blocks, flags);
        let name = crate::format::stem(self.path);
        let dataset = Dataset::at_rate(name, self.rate()?, layout.shape, labels, records, values)
            .and_then(|dataset| dataset.with_known_lengths(lengths))
            .map_err(|error| crate::format::in_file(self.path, error))?;
        let dataset = match self.twin_version()? {
            Some(version) => dataset.into_twin(version),
            None => dataset,
        };
        let mut dataset = dataset.with_reading_findings(findings);
        if is_row {
            dataset = dataset.with_assumed_patch();
        }
        let dataset = dataset.with_conditions(&conditions);
        Ok((
            dataset.map_err(|error| crate::format::in_file(self.path, error))?,
            labelled,
        ))
    }

    /// Returns the block number of each sweep.
    fn blocks(&self, shape: &[usize]) -> Result<Option<Vec<u32>>, DataError> {
        let (name, is_named) = &self.roles.blocks;
        let array = self.optional(name)?;
        if *is_named && array.is_none() {
            return Err(self.missing(Role::Named(name)));
        }
        let Some(texts) = array.and_then(normal_texts) else {
            return self.per_sweep(name, shape);
        };
        if texts.len() != shape.iter().product::<usize>() {
            let found = format!("{} names", texts.len());
            return Err(self.error(name, format!("shape {shape:?}"), found));
        }
        Ok(Some(block_numbers(&texts)))
    }

    fn test_flags(&self, shape: &[usize]) -> Result<Option<Vec<bool>>, DataError> {
        let flags = self.per_sweep("test_flag", shape)?;
        if let Some(odd) = flags.iter().flatten().find(|&&flag| flag > 1) {
            return Err(self.error("test_flag", "0 or 1", odd.to_string()));
        }
        Ok(flags.map(|flags| flags.into_iter().map(|flag| flag == 1).collect()))
    }

    /// Returns the number of frames of each sweep, if the file states it. An array of this name that has another shape or
    /// holds other numbers means something else; a note says that it is ignored.
    fn lengths(&mut self, shape: &[usize]) -> Result<Option<Vec<usize>>, DataError> {
        let Some(array) = self.optional(LENGTHS)? else {
            return Ok(None);
        };
        let numbers = (array.shape == shape).then(|| array.whole_numbers());
        if let Some(numbers) = numbers.flatten() {
            let frames = numbers.into_iter().map(|n| usize::try_from(n).unwrap_or(0));
            return Ok(Some(frames.collect()));
        }
        let found = format!("{:?} of {}", array.shape, array.type_name());
        let word = self.container.word();
        self.findings.push(Finding::not_read(format!(
            "{word} `{LENGTHS}` that is ignored: expected the number of frames of each sweep, whole numbers of shape {shape:?}, found {found}"
        )));
        Ok(None)
    }

    /// Returns the version of the twin that generated the sweeps, if the file is marked.
    fn twin_version(&self) -> Result<Option<TwinVersion>, DataError> {
        let mark = self.optional(SYNTHETIC_ATTRIBUTE)?.and_then(Array::floats);
        let mark = mark.and_then(|mark| mark.first().copied());
        Ok(mark.and_then(TwinVersion::of_mark))
    }

    /// Returns the meaning that the axes of a MATLAB array were given.
    fn axes_read(&self, name: &str, shape: &[usize]) -> Option<Finding> {
        if self.container != Container::Mat {
            return None;
        }
        let axes = match shape.len() {
            3 => "sweeps x steps x taxels",
            4 => "sweeps x steps x rows x cols",
            _ => "materials x sweeps x steps x rows x cols",
        };
        let size: Vec<String> = shape.iter().map(usize::to_string).collect();
        let message = format!(
            "`{name}`: the size {} in MATLAB is read as {axes}",
            size.join("x")
        );
        Some(Finding::new(Severity::Note, FindingKind::AxesRead, message))
    }
}

/// Meaning of the dimensions of the array of sweeps.
struct Layout {
    /// Number of sweeps per material, if the array has a dimension of materials.
    sweeps: Option<usize>,
    /// Shape of every sweep.
    shape: SweepShape,
}

impl Layout {
    /// Returns the layout of the array `name` with these extents.
    fn of(arrays: &Arrays<'_>, name: &str, extents: &[usize]) -> Result<Self, DataError> {
        let of = |sweeps, steps, rows, cols| Self {
            sweeps,
            shape: SweepShape { steps, rows, cols },
        };
        match *extents {
            [.., 1] if extents.len() == 5 && !arrays.contains("materials") => Err(arrays.error(
                name,
                "4 dimensions [n][steps][rows][cols]",
                format!("{extents:?}; an axis of channels at the end? `{name}[..., 0]` drops it"),
            )),
            [_, sweeps, steps, rows, cols] => Ok(of(Some(sweeps), steps, rows, cols)),
            [_, steps, rows, cols] => Ok(of(None, steps, rows, cols)),
            [_, steps, cols] => Ok(of(None, steps, 1, cols)),
            _ => {
                let cure = match (arrays.container, extents.len()) {
                    (Container::Mat, 2) => one_taxel(name),
                    _ => String::new(),
                };
                Err(arrays.error(
                    name,
                    "3 dimensions [n][steps][taxels], 4 [n][steps][rows][cols] or 5 [materials][sweeps][steps][rows][cols]",
                    format!("{} dimensions {extents:?}{cure}", extents.len()),
                ))
            }
        }
    }
}

/// Returns the labels of sweeps that are ordered by material.
///
/// - `name`: array of the sweeps
/// - `materials`, `sweeps`: its first two extents
fn label_blocks(
    arrays: &Arrays<'_>,
    name: &str,
    materials: usize,
    sweeps: usize,
) -> Result<(LabelSet, Vec<usize>), DataError> {
    let names = arrays.names("materials")?;
    if names.len() != materials {
        let expected = format!("{materials} names, one per material of `{name}`");
        return Err(arrays.error("materials", expected, format!("{} names", names.len())));
    }
    let of_sweep = (0..materials)
        .flat_map(|m| std::iter::repeat_n(m, sweeps))
        .collect();
    Ok((arrays.label_set(names)?, of_sweep))
}

/// Returns the cure for an array of MATLAB that lost its last axis of length 1.
fn one_taxel(name: &str) -> String {
    format!(
        "; MATLAB drops a last axis of length 1, so sweeps of one taxel need another file: \
         `d = scipy.io.loadmat(FILE); np.savez_compressed(\"sweeps.npz\", X=d[\"{name}\"][..., None], y=d[\"y\"].ravel())`"
    )
}
