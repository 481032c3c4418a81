//! The classifier of a run, and its predictions for the sweeps of a file.

use std::path::{Path, PathBuf};

use anyhow::bail;
use tactnet_data::Dataset;
use tactnet_data::format::Keep;
use tactnet_models::Compute;
use tactnet_pipeline::{
    ClassifiedSweeps, Classifier, ModelRecipe, PredictionMethod, RunConfig, RunDir, TestSweeps,
    UnknownDetector, quoted,
};

use super::choices::DeviceChoice;
use super::classified_text;
use crate::source;

/// A classifier and its run.
pub struct RunClassifier {
    dir: PathBuf,
    run: RunDir,
    config: RunConfig,
    classifier: Classifier,
    detector: Option<UnknownDetector>,
    method: PredictionMethod,
}

impl RunClassifier {
    /// Opens the classifier of the run in `dir`.
    ///
    /// - `mc`: number of Monte Carlo dropout samples; 0 for none, `None` for the recipe's
    pub fn open(dir: &Path, mc: Option<u32>, device: DeviceChoice) -> anyhow::Result<Self> {
        let run = RunDir::open(dir)?;
        let config = run.config()?;
        if let (Some(1..), ModelRecipe::Baseline(baseline)) = (mc, &config.recipe) {
            bail!(
                "--mc: `{}` is a baseline without dropout; leave out --mc",
                baseline.name
            );
        }
        let method = match mc {
            None => config.recipe.method(),
            Some(0) => PredictionMethod::Plain,
            Some(mc) => PredictionMethod::McDropout {
                mc_samples: mc as usize,
            },
        };
        let device = Compute::from(device).open()?;
        let classifier =
            Classifier::new(config.classifier.clone(), &run.final_weights()?, &device)?;
        let detector = run.unknown_detector()?;
        Ok(Self {
            dir: dir.into(),
            run,
            config,
            classifier,
            detector,
            method,
        })
    }

    /// Masks dead taxels.
    pub fn mask(&mut self, dead: &[usize]) -> anyhow::Result<()> {
        Ok(self.classifier.mask(dead)?)
    }

    /// Reads the sweeps of `data`, classifies them, and prints notes about the file.
    ///
    /// - `rate`: sample rate of data that does not state it, in Hz
    /// - `steps`: time steps of each sweep to use; `None`: as in training
    /// - `one_object`: true if all sweeps are of the same object
    pub fn classify(
        &self,
        data: &str,
        rate: Option<f64>,
        steps: Option<Keep>,
        one_object: bool,
    ) -> anyhow::Result<ClassifiedSweeps> {
        source::announce(data);
        let mut spec = self.config.spec.clone();
        spec.rate_hz = rate;
        if let Some(steps) = steps {
            spec.set_keep(steps);
        }
        let known = &self.config.classifier;
        let sweeps = spec
            .read_to_classify(data, known)
            .map_err(|error| source::in_file(data, rate, error))?;
        let found = ClassifiedSweeps::of(
            &sweeps,
            &self.classifier,
            self.detector.as_ref(),
            self.run.likeness()?.as_ref(),
            self.method,
            one_object,
        );
        let found = found.map_err(|error| source::in_file(data, rate, error))?;
        source::warn_of_findings(sweeps.dataset.reading_findings());
        // Refused sweeps have no notes.
        if sweeps.arranged {
            source::note_arranged(known.taxel_shape());
        }
        if let Some(still) = classified_text::still(&found) {
            say!("warning: {still}");
        }
        let seen = self.learnt_from(&sweeps.dataset)?;
        if seen > 0 {
            let all = sweeps.dataset.len();
            let those = match seen == all {
                true if all == 1 => "this sweep".to_owned(),
                true => format!("all of these {all} sweeps"),
                false => format!("{seen} of these {all} sweeps"),
            };
            say!(
                "note: the run was trained on {those}, so these predictions do not show its accuracy; evaluate held-out sweeps with `tactnet eval {}`",
                quoted(&self.dir.display().to_string())
            );
        }
        Ok(found)
    }

    /// Returns the number of sweeps that the run was trained on or has enrolled. It counts no training sweeps if the
    /// training data cannot be read.
    fn learnt_from(&self, sweeps: &Dataset) -> anyhow::Result<usize> {
        let unseen = TestSweeps::unseen(sweeps, &self.config, &self.run.split()?)?;
        Ok(sweeps.len() - unseen.without_enrolled(&self.run)?.view.len())
    }
}
