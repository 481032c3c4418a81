//! Recent sweeps from which a new material can be enrolled.

/// Maximum number of complete sweeps kept per finger.
const KEPT_SWEEPS: usize = 20;

/// The most recent complete sweeps of one finger.
pub(super) struct RecentSweeps {
    /// `[KEPT_SWEEPS][values]`
    digits: Vec<f32>,
    values: usize,
    came: usize,
}

impl RecentSweeps {
    pub(super) fn new(values: usize) -> Self {
        Self {
            digits: vec![0.0; KEPT_SWEEPS * values],
            values,
            came: 0,
        }
    }

    pub(super) fn keep(&mut self, sweep: &[f32]) {
        let at = self.came % KEPT_SWEEPS * self.values;
        self.digits[at..at + self.values].copy_from_slice(sweep);
        self.came += 1;
    }

    /// Returns the newest `sweeps` sweeps, oldest first, or `None` if fewer are kept.
    pub(super) fn newest(&self, sweeps: usize) -> Option<Vec<f32>> {
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

    /// Returns the number of sweeps kept.
    pub(super) fn kept(&self) -> usize {
        self.came.min(KEPT_SWEEPS)
    }

    /// Discards all sweeps.
    pub(super) fn forget(&mut self) {
        self.came = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_sweeps_are_given_in_their_order_and_never_more_than_came() {
        let mut recent = RecentSweeps::new(2);
        assert_eq!(recent.newest(1), None);
        for number in 0..KEPT_SWEEPS + 3 {
            recent.keep(&[number as f32, -1.0]);
        }
        assert_eq!(recent.newest(0), None);
        assert_eq!(recent.newest(2).unwrap(), [21.0, -1.0, 22.0, -1.0]);
        let all = recent.newest(KEPT_SWEEPS).unwrap();
        assert_eq!(
            all.iter().step_by(2).copied().collect::<Vec<_>>(),
            (3..23).map(|n| n as f32).collect::<Vec<_>>()
        );
        assert_eq!(recent.newest(KEPT_SWEEPS + 1), None);
        recent.forget();
        assert_eq!((recent.kept(), recent.newest(1)), (0, None));
    }
}
