//! Sweeps in taxel-major order.

/// One sweep with the steps of each taxel in succession: `[taxels][steps]`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Series {
    steps: usize,
    values: Vec<f32>,
}

impl Series {
    /// Transposes frames `[steps][taxels]`.
    pub fn from_frames(frames: &[f32], taxels: usize) -> Self {
        let steps = frames.len() / taxels;
        let mut values = vec![0.0; frames.len()];
        for (step, frame) in frames.chunks_exact(taxels).enumerate() {
            for (taxel, value) in frame.iter().enumerate() {
                values[taxel * steps + step] = *value;
            }
        }
        Self { steps, values }
    }

    /// Returns the change from each step to the next, one step shorter.
    pub fn difference(&self) -> Self {
        let values = self
            .values
            .chunks_exact(self.steps)
            .flat_map(|taxel| taxel.windows(2).map(|pair| pair[1] - pair[0]))
            .collect();
        Self {
            steps: self.steps - 1,
            values,
        }
    }

    /// Returns the number of steps.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Returns the number of taxels.
    pub fn taxels(&self) -> usize {
        self.values.len() / self.steps
    }

    /// Returns all steps of one taxel.
    pub fn taxel(&self, taxel: usize) -> &[f32] {
        &self.values[taxel * self.steps..][..self.steps]
    }
}
