//! Test sweeps of a trained classifier: sweeps that nothing was fitted to.

use std::collections::BTreeSet;

use tactnet_data::{Dataset, SplitManifest, SweepView};

use crate::predict::overlap::{without_sweeps, without_sweeps_of};
use crate::{PipelineError, PipelineRemedy, RunConfig, RunDir};

/// Sweeps of a data set without the training sweeps of a classifier.
#[derive(Debug, Clone)]
pub struct TestSweeps<'a> {
    /// The sweeps.
    pub view: SweepView<'a>,
    /// Description of the sweeps.
    pub description: String,
    /// False if the training data could not be read, so that training sweeps may be included.
    pub training_sweeps_known: bool,
}

impl<'a> TestSweeps<'a> {
    /// Returns the run's own test sweeps if `dataset` is its training data, else all sweeps except those of the training set. Enrolled sweeps, and
    /// those whose labels an adaptation used, are left out in both cases.
    ///
    /// # Errors
    /// A damaged run directory; no remaining sweep.
    pub fn of_run(run: &RunDir, dataset: &'a Dataset) -> Result<Self, PipelineError> {
        let (config, manifest) = (run.config()?, run.split()?);
        let mut found = if dataset.sha256() == config.data_sha256 {
            Self {
                view: SweepView::clone(&manifest.fold(dataset)?.test),
                description: "test split of the run".into(),
                training_sweeps_known: true,
            }
        } else {
            Self::unseen(dataset, &config, &manifest)?
        };
        found = found.without_enrolled(run)?.without_adapted(run)?;
        if found.view.is_empty() {
            return Err(PipelineError::incompatible(
                "test sweeps",
                "sweeps that it has not been trained on",
                format!(
                    "none: all sweeps of {} were trained on, enrolled, or used with their labels",
                    dataset.name()
                ),
            )
            .with_remedy(PipelineRemedy::EnrollFewerSweeps));
        }
        Ok(found)
    }

    /// Removes the sweeps from which materials were enrolled.
    ///
    /// # Errors
    /// A damaged run directory.
    pub fn without_enrolled(mut self, run: &RunDir) -> Result<Self, PipelineError> {
        let enrolled = run.enrolled()?;
        let before = self.view.len();
        if !enrolled.is_empty() {
            let hashes = enrolled.iter().flat_map(|it| it.sweeps_sha256.clone());
            self.view = without_sweeps(&self.view, &hashes.collect()).0;
        }
        let dataset = self.view.dataset();
        // Earlier versions identify sweeps by file and index only.
        let of_file: Vec<usize> = enrolled
            .into_iter()
            .filter(|material| material.data_sha256 == dataset.sha256())
            .flat_map(|material| material.sweeps)
            .collect();
        let all = self.view.indices().iter().copied();
        let left: Vec<usize> = all.filter(|index| !of_file.contains(index)).collect();
        let dropped = before - left.len();
        if dropped > 0 {
            self.view = SweepView::new(dataset, left);
            self.description += &format!("; {dropped} enrolled sweeps are left out");
        }
        Ok(self)
    }

    /// Removes the sweeps whose labels an adaptation used. Sweeps that it used without labels stay; the description counts them.
    ///
    /// # Errors
    /// A damaged run directory.
    pub fn without_adapted(mut self, run: &RunDir) -> Result<Self, PipelineError> {
        let (mut labelled, mut unlabelled) = (BTreeSet::new(), BTreeSet::new());
        for adaptation in run.adaptations()? {
            labelled.extend(
                adaptation
                    .labelled
                    .into_iter()
                    .flat_map(|of| of.sweeps_sha256),
            );
            unlabelled.extend(
                adaptation
                    .unlabelled
                    .into_iter()
                    .flat_map(|of| of.sweeps_sha256),
            );
        }
        if labelled.is_empty() && unlabelled.is_empty() {
            return Ok(self);
        }
        let (view, dropped) = without_sweeps(&self.view, &labelled);
        let (_, adapted_to) = without_sweeps(&view, &unlabelled);
        self.view = view;
        if dropped > 0 {
            self.description += &format!("; {dropped} sweeps of the adaptation are left out");
        }
        if adapted_to > 0 {
            self.description += &format!("; {adapted_to} were adapted to without their labels");
        }
        Ok(self)
    }

    /// Returns all sweeps of `dataset` except those of the training set that `config` and `manifest` describe.
    ///
    /// If `dataset` has the content of the training data, its own split identifies them; else the training data is read from its original path.
    ///
    /// # Errors
    /// A damaged manifest.
    pub fn unseen(
        dataset: &'a Dataset,
        config: &RunConfig,
        manifest: &SplitManifest,
    ) -> Result<Self, PipelineError> {
        let all = SweepView::all(dataset);
        if dataset.sha256() == config.data_sha256 {
            let train = manifest.fold(dataset)?.train;
            return Ok(Self::except(&all, &train));
        }
        let spec = &config.spec;
        let own = spec
            .read_sweeps()
            .ok()
            .filter(|own| own.sha256() == config.data_sha256);
        let Some(own) = own else {
            return Ok(Self {
                view: all,
                description:
                    "all sweeps; the training data cannot be read, so training sweeps may be among them"
                        .into(),
                training_sweeps_known: false,
            });
        };
        Ok(Self::except(&all, &manifest.fold(&own)?.train))
    }

    /// Returns the sweeps of `all` that are not in `train`.
    fn except(all: &SweepView<'a>, train: &SweepView<'_>) -> Self {
        let (view, dropped) = without_sweeps_of(all, train);
        Self {
            view,
            description: match dropped {
                0 => "all sweeps".into(),
                dropped => format!("all sweeps except {dropped} of the training set"),
            },
            training_sweeps_known: true,
        }
    }
}
