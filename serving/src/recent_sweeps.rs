//! Recent complete sweeps of one finger: compared with the training data, used to enroll materials and to adapt the model.

/// Maximum number of complete sweeps kept per finger.
pub(crate) const KEPT_SWEEPS: usize = 64;

/// Numbers by which packets name a sweep.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SweepId {
    /// Index of the finger.
    pub(crate) finger: u32,
    /// Number of the sweep.
    pub(crate) sweep: u64,
    /// Number of the motion.
    pub(crate) motion: u64,
}

/// A complete sweep of a finger.
#[derive(Debug)]
pub(crate) struct CompleteSweep {
    pub(crate) id: SweepId,
    /// Number of resets of the finger before the sweep.
    pub(crate) object: u64,
    /// `[steps][taxels]`
    pub(crate) digits: Vec<f32>,
}

/// The most recent complete sweeps of one finger.
pub(crate) struct RecentSweeps {
    /// `[KEPT_SWEEPS][values]`
    digits: Vec<f32>,
    values: usize,
    came: usize,
    /// Number of resets before the newest sweep.
    object: u64,
    /// Number of sweeps since the newest of these resets.
    of_object: usize,
}

impl RecentSweeps {
    pub(crate) fn new(values: usize) -> Self {
        Self {
            // Not zero, so that all pages are mapped at the start and memory does not grow in service.
            digits: vec![f32::NAN; KEPT_SWEEPS * values],
            values,
            came: 0,
            object: 0,
            of_object: 0,
        }
    }

    pub(crate) fn keep(&mut self, sweep: &CompleteSweep) {
        let at = self.came % KEPT_SWEEPS * self.values;
        self.digits[at..at + self.values].copy_from_slice(&sweep.digits);
        self.came += 1;
        if sweep.object != self.object {
            self.object = sweep.object;
            self.of_object = 0;
        }
        self.of_object += 1;
    }

    /// Returns the newest `sweeps` sweeps, of whichever object, oldest first, or `None` if fewer are kept.
    pub(crate) fn newest(&self, sweeps: usize) -> Option<Vec<f32>> {
        if sweeps == 0 || sweeps > self.kept() {
            return None;
        }
        let mut digits = Vec::with_capacity(sweeps * self.values);
        for number in self.came - sweeps..self.came {
            let at = number % KEPT_SWEEPS * self.values;
            digits.extend_from_slice(&self.digits[at..at + self.values]);
        }
        Some(digits)
    }

    /// Returns the number of sweeps kept, of all objects.
    pub(crate) fn kept(&self) -> usize {
        self.came.min(KEPT_SWEEPS)
    }

    /// Returns the number of sweeps kept of an object.
    ///
    /// - `object`: number of resets before its sweeps
    pub(crate) fn kept_of(&self, object: u64) -> usize {
        match object == self.object {
            true => self.of_object.min(KEPT_SWEEPS),
            false => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(number: usize, object: u64) -> CompleteSweep {
        CompleteSweep {
            id: SweepId::default(),
            object,
            digits: vec![number as f32, -1.0],
        }
    }

    #[test]
    fn the_newest_sweeps_are_given_in_their_order_and_never_more_than_came() {
        let mut recent = RecentSweeps::new(2);
        assert_eq!(recent.newest(1), None);
        for number in 0..KEPT_SWEEPS + 3 {
            recent.keep(&sweep(number, 0));
        }
        assert_eq!(recent.newest(0), None);
        let last = KEPT_SWEEPS as f32 + 2.0;
        assert_eq!(recent.newest(2).unwrap(), [last - 1.0, -1.0, last, -1.0]);
        let all = recent.newest(KEPT_SWEEPS).unwrap();
        assert_eq!(
            all.iter().step_by(2).copied().collect::<Vec<_>>(),
            (3..KEPT_SWEEPS + 3).map(|n| n as f32).collect::<Vec<_>>()
        );
        assert_eq!(recent.newest(KEPT_SWEEPS + 1), None);
        assert_eq!((recent.kept_of(0), recent.kept_of(1)), (KEPT_SWEEPS, 0));
        // After a reset the sweeps of the next object count.
        recent.keep(&sweep(KEPT_SWEEPS + 3, 1));
        assert_eq!((recent.kept_of(0), recent.kept_of(1)), (0, 1));
        assert_eq!(recent.newest(2).unwrap(), [last, -1.0, last + 1.0, -1.0]);
    }
}
