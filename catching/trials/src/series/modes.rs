//! The three objectives of the planners on one throw (thesis, figure 3.9).

use std::fmt::Write;

use tactnet_catching::plan::Objective;
use tactnet_catching_packets::joint;
use tactnet_plot::stand_alone;

use super::Series;
use super::page::rates;
use crate::error::TrialError;
use crate::picture::{HEIGHT, WIDTH, content};
use crate::throw_config::ThrowConfig;

/// Width of the drawn joint rates, in pixels.
const RATES: f64 = 640.0;

impl Series {
    /// Simulates a throw with each objective. Returns a file that draws robot and ball from the side, and the joint
    /// rates of the arm that catches, one row for each: soft, latest, cool.
    ///
    /// # Errors
    /// Same as [`Series::run`].
    pub fn modes_picture(&self, number: u64) -> Result<String, TrialError> {
        let mut svg = String::new();
        let all = [
            ("soft", Objective::Soft),
            ("latest", Objective::Latest),
            ("cool", Objective::Cool),
        ];
        for (row, (name, objective)) in all.into_iter().enumerate() {
            let config = ThrowConfig {
                objective,
                ..self.config.clone()
            };
            let trace = Self { config, ..*self }.again(number, 0.0)?;
            let plan = trace.plans.last();
            let catch = plan.map_or(String::new(), |plan| format!(", at {:.2} s", plan.catch));
            let arm = plan.map_or(0, |plan| plan.arm);
            let (axes, lines) = rates(&trace, joint::ARM[arm].clone());
            let (side, grid) = (content(&trace).unwrap_or_default(), axes.grid());
            let _ = write!(
                svg,
                "<g transform=\"translate(0 {:.0})\">{side}<text x=\"12\" y=\"20\">{name}{catch}</text>\
                 <g transform=\"translate({WIDTH} 0)\">{grid}{lines}</g></g>",
                row as f64 * HEIGHT
            );
        }
        let title = "The soft, the latest and the cool catch of one ball";
        Ok(stand_alone(WIDTH + RATES, 3.0 * HEIGHT, title, &svg))
    }
}
