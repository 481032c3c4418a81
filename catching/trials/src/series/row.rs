//! Series of rows: balls one after the other, without a return to the waiting pose (thesis, figure 3.10).

use std::fmt::Write;

use tactnet_plot::stand_alone;

use super::{Series, SeriesReport};
use crate::error::TrialError;
use crate::in_a_row::RowThrow;
use crate::parallel::on_all_cores;
use crate::picture::{HEIGHT, WIDTH, content};

/// Number of drawn catches side by side.
const COLUMNS: usize = 2;

impl Series {
    /// Runs whole rows of `length` throws, at least as many throws as [`Series::throws`]; `done` is called after each
    /// throw.
    ///
    /// # Errors
    /// Invalid settings, or a robot that does not get to rest.
    pub fn run_in_a_row(
        &self,
        length: u64,
        done: impl Fn() + Sync,
    ) -> Result<SeriesReport, TrialError> {
        let rows = on_all_cores(0..self.throws.div_ceil(length), |number| {
            let row = self.row(number, length);
            (0..length).for_each(|_| done());
            row
        })?;
        let outcomes = rows.into_iter().flatten().map(|(outcome, _)| outcome);
        Ok(SeriesReport {
            in_a_row: Some(length),
            ..self.report(outcomes.collect())
        })
    }

    fn row(&self, number: u64, length: u64) -> Result<Vec<RowThrow>, TrialError> {
        let oracle = self.config.oracle();
        self.config.row(self.seed, number, length, &oracle)
    }

    /// Simulates the first row and returns a file that draws the robot from the side at the end of each flight, and
    /// faintly at the throw, in the pose of the catch before.
    ///
    /// # Errors
    /// Same as [`Series::run_in_a_row`].
    pub fn row_picture(&self, length: u64) -> Result<String, TrialError> {
        let mut svg = String::new();
        for (place, (outcome, trace)) in self.row(0, length)?.iter().enumerate() {
            let caught = outcome.all_caught();
            let plan = trace.plans.last();
            let arm = plan.map_or("no", |plan| ["left", "right"][plan.arm]);
            let [column, row] = [place % COLUMNS, place / COLUMNS].map(|i| i as f64);
            let (x, y) = (column * WIDTH, row * HEIGHT);
            let _ = write!(
                svg,
                "<svg x=\"{x:.0}\" y=\"{y:.0}\" width=\"{WIDTH}\" height=\"{HEIGHT}\">{}<text x=\"12\" y=\"20\">ball {}, {arm} arm, {}</text></svg>",
                content(trace).unwrap_or_default(),
                place + 1,
                if caught { "caught" } else { "missed" }
            );
        }
        let height = (length as usize).div_ceil(COLUMNS) as f64 * HEIGHT;
        let title = "Balls caught one after the other";
        Ok(stand_alone(COLUMNS as f64 * WIDTH, height, title, &svg))
    }
}
