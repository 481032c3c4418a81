//! Enrolment of a material into the committee of a run, which needs the run's training sweeps.

use tactnet_data::SweepView;

use super::set_aside::set_aside;
use crate::committee::enroll::{FormerSweeps, enroll_into_committee};
use crate::{Classifier, Enrolled, PipelineError, RunDir};

impl RunDir {
    /// Adds a material to the committee of this run; see [`crate::enroll`] for networks.
    ///
    /// The networks among its members learn the material on their embeddings. Its baselines are fitted again, to the run's training sweeps
    /// and the new ones. Thresholds of a calibration are fitted again to the sweeps set aside.
    ///
    /// - `classifier`: classifier of this run
    /// - `sweeps`: sweeps of the new material only, with any label in their data set
    ///
    /// # Errors
    /// A model that is not a committee; a committee that was adapted or has learnt a material before; a data set that is missing or has
    /// changed; a name that is already known; sweeps of another shape or rate, or of unequal length.
    pub fn enroll_into_committee(
        &self,
        classifier: &Classifier,
        sweeps: &SweepView<'_>,
        material: &str,
    ) -> Result<Enrolled, PipelineError> {
        if !self.enrolled()?.is_empty() || !self.adaptations()?.is_empty() {
            let reason = "a committee learns a material only once after its training, and not after an adaptation; train it again with all \
                          materials";
            return Err(PipelineError::enroll(material, reason));
        }
        let config = self.config()?;
        let lost = |reason: String| {
            PipelineError::enroll(
                material,
                format!(
                    "the baselines of a committee need the run's training sweeps again: {reason}"
                ),
            )
        };
        let dataset = config.spec.read_sweeps_of_run(None);
        let dataset = dataset.map_err(|error| lost(error.to_string()))?;
        if dataset.sha256() != config.data_sha256 {
            return Err(lost(format!("{} has changed", config.spec.data)));
        }
        let fold = self.split()?.fold(&dataset)?;
        let (fitted, aside) = set_aside(&fold, config.spec.calibration)?;
        let former = FormerSweeps {
            train: &fitted.train,
            aside: aside.as_ref().map(|(target, aside)| (*target, &**aside)),
        };
        enroll_into_committee(classifier, &former, sweeps, material)
    }
}
