//! Sweeps of unequal length.

use crate::{DataError, Dataset, SweepShape, hex};
use sha2::{Digest, Sha256};

impl Dataset {
    /// Sets the number of frames of each sweep. The values after the last frame of a sweep are replaced by this frame, so
    /// they influence neither the checksum nor a result. Sweeps of equal length are cut to this length.
    ///
    /// - `lengths`: `[sweeps]`, each from 1 to the number of steps of the shape
    ///
    /// # Errors
    /// A length out of range, or another number of lengths than of sweeps.
    ///
    /// ```
    /// use tactnet_data::twin;
    ///
    /// let twin = twin::small(2, 1, 100)?.with_lengths(vec![90, 60])?;
    /// assert_eq!((twin.shape().steps, twin.steps_of(1), twin.frames()), (90, 60, 150));
    /// assert_eq!(twin.sweep(1).len(), 60 * 16);
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn with_lengths(mut self, lengths: Vec<usize>) -> Result<Self, DataError> {
        let refused = |expected: String, found: String| {
            Err(DataError::inconsistent("lengths", expected, found))
        };
        if lengths.len() != self.len() {
            return refused(
                format!("one for each of the {} sweeps", self.len()),
                lengths.len().to_string(),
            );
        }
        let most = self.shape.steps;
        if let Some(odd) = lengths.iter().position(|steps| !(1..=most).contains(steps)) {
            return refused(
                format!("1 to {most} frames"),
                format!("{} of {}", lengths[odd], self.describe(odd)),
            );
        }
        let longest = lengths.iter().copied().max().unwrap_or(most);
        let (whole, taxels) = (self.shape.values(), self.shape.taxels());
        self.shape.steps = longest;
        self.samples = self.samples.heads(whole, self.shape.values());
        self.samples
            .repeat_last_frames(self.shape.values(), taxels, &lengths);
        let unequal = lengths.iter().any(|steps| *steps != longest);
        self.lengths = unequal.then_some(lengths);
        Ok(self.with_checksum())
    }

    /// Sets the number of frames of each sweep, if they are known; see [`Dataset::with_lengths`].
    pub(crate) fn with_known_lengths(self, lengths: Option<Vec<usize>>) -> Result<Self, DataError> {
        match lengths {
            Some(lengths) => self.with_lengths(lengths),
            None => Ok(self),
        }
    }

    /// Returns the number of frames of each sweep, `[sweeps]`; `None` if all have as many as the shape.
    pub fn lengths(&self) -> Option<&[usize]> {
        self.lengths.as_deref()
    }

    /// Returns the number of frames of sweep `index`.
    ///
    /// # Panics
    /// If there is no such sweep.
    pub fn steps_of(&self, index: usize) -> usize {
        match &self.lengths {
            Some(lengths) => lengths[index],
            None => self.shape.steps,
        }
    }

    /// Returns the number of frames of the shortest sweep.
    pub fn shortest(&self) -> usize {
        let lengths = self.lengths.iter().flatten().copied();
        lengths.min().unwrap_or(self.shape.steps)
    }

    /// Returns the number of frames of all sweeps.
    pub fn frames(&self) -> usize {
        match &self.lengths {
            Some(lengths) => lengths.iter().sum(),
            None => self.len() * self.shape.steps,
        }
    }

    /// Returns the shape of the longest sweep and the range of lengths, for messages.
    pub fn describe_shape(&self) -> String {
        let SweepShape { steps, rows, cols } = self.shape;
        match &self.lengths {
            Some(_) => format!(
                "{} to {steps} steps of {rows}x{cols} taxels",
                self.shortest()
            ),
            None => self.shape.to_string(),
        }
    }
}

/// Returns the checksum of a data set whose sweeps have these lengths.
pub(super) fn digest(sha256: &str, lengths: &[usize]) -> String {
    let mut hash = Sha256::new();
    hash.update(b"tactnet lengths 1\0");
    hash.update(sha256.as_bytes());
    for steps in lengths {
        hash.update((*steps as u64).to_le_bytes());
    }
    hex(hash.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LabelSet, Samples, SweepRecord};

    /// Returns three sweeps of at most four steps of two taxels; frames beyond 4, 2 and 3 read `padding`.
    fn three(padding: u8) -> Result<Dataset, DataError> {
        let shape = SweepShape {
            steps: 4,
            rows: 1,
            cols: 2,
        };
        let mut values: Vec<u8> = (0..24).collect();
        values[12..16].fill(padding);
        values[22..].fill(padding);
        let labels = LabelSet::new(["cork", "denim"])?;
        let records = [(0, 0), (1, 0), (0, 1)].map(|(label, sweep)| SweepRecord::new(label, sweep));
        Dataset::new(
            "three",
            10.0,
            shape,
            labels,
            records.to_vec(),
            Samples::U8(values),
        )
    }

    #[test]
    fn padding_does_not_influence_the_data_set() {
        let [zero, other] = [0, 99].map(|padding| {
            let padded = three(padding).unwrap();
            padded.with_lengths(vec![4, 2, 3]).unwrap()
        });
        assert_eq!(zero.samples(), other.samples());
        assert_eq!(zero.sha256(), other.sha256());
        assert_ne!(zero.sha256(), three(0).unwrap().sha256());
        assert_eq!(zero.sweep(1), [8.0, 9.0, 10.0, 11.0]);
        assert_eq!(zero.frames(), 9);
    }

    #[test]
    fn sweeps_of_equal_length_are_an_ordinary_data_set() {
        let plain = three(7).unwrap();
        let sha256 = plain.sha256().to_owned();
        assert_eq!(plain.with_lengths(vec![4; 3]).unwrap().sha256(), sha256);
        let cut = three(7).unwrap().with_lengths(vec![2; 3]).unwrap();
        assert_eq!(cut.lengths(), None);
        assert_eq!(
            cut.sha256(),
            three(7).unwrap().first_steps(2).unwrap().sha256()
        );
    }

    #[test]
    fn derived_data_sets_keep_the_lengths_of_their_sweeps() {
        let three = || three(0).unwrap().with_lengths(vec![4, 2, 3]).unwrap();
        assert_eq!(
            three().of_materials(&[0]).unwrap().lengths(),
            Some(&[4, 3][..])
        );
        assert_eq!(three().of_materials(&[1]).unwrap().shape().steps, 2);
        assert_eq!(three().of_one_material("x").unwrap().steps_of(1), 2);
        assert_eq!(three().with_sample_rate(20.0).unwrap().steps_of(1), 2);
        assert_eq!(three().with_patch(2, 1).unwrap().steps_of(2), 3);
        assert_eq!(three().first_steps(2).unwrap().lengths(), None);
        let refused = three().first_steps(3).unwrap_err();
        assert!(refused.to_string().contains("1 to 2"), "{refused}");
    }

    #[test]
    fn lengths_that_no_sweep_can_have_are_refused() {
        for lengths in [vec![4, 2], vec![4, 0, 3], vec![5, 2, 3]] {
            assert!(three(0).unwrap().with_lengths(lengths).is_err());
        }
    }
}
