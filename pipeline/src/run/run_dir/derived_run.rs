//! Run directories of classifiers that were made from a trained one: with another material, or adapted to another skin.

use std::fs;
use std::path::Path;

use tactnet_data::SweepView;
use tactnet_models::Weights;

use super::{ENROLLED, ENVIRONMENT, HELD_OUT};
use crate::{
    Adaptation, Adapted, Calibration, ClassifierConfig, Enrolled, EnrolledMaterial, Likeness,
    ModelConfig, PipelineError, PipelineRemedy, Provenance, RunConfig, RunDir, TrainEmbeddings,
};

/// Prefix of the name of a folder that is still incomplete.
const DRAFT: &str = ".incomplete-";

/// Classifier made from that of a run.
struct Derived<'a> {
    classifier: &'a ClassifierConfig,
    weights: &'a Weights,
    /// Embeddings of the training sweeps; `None` for baselines and committees.
    known: Option<&'a TrainEmbeddings>,
    /// Thresholds, if it is calibrated.
    calibration: Option<&'a Calibration>,
    likeness: Option<Likeness>,
    enrolled: Vec<EnrolledMaterial>,
    adaptations: Vec<Adaptation>,
}

impl RunDir {
    /// Creates a run directory for a classifier with one more material.
    ///
    /// - `sweeps`: sweeps of the new material
    ///
    /// # Errors
    /// A folder that is not empty; a file that cannot be written.
    pub fn create_enrolled(
        &self,
        path: &Path,
        enrolled: &Enrolled,
        material: EnrolledMaterial,
        sweeps: &SweepView<'_>,
    ) -> Result<Self, PipelineError> {
        let label = enrolled.config.labels.len() - 1;
        let likeness = self.likeness()?;
        let mut materials = self.enrolled()?;
        materials.push(material);
        let derived = Derived {
            classifier: &enrolled.config,
            weights: &enrolled.weights,
            known: enrolled.known.as_ref(),
            calibration: enrolled.calibration.as_ref(),
            likeness: likeness
                .map(|likeness| likeness.extended(sweeps, label))
                .transpose()?,
            enrolled: materials,
            adaptations: self.adaptations()?,
        };
        self.create_derived(path, derived)
    }

    /// Creates a run directory for a classifier that was adapted to other sweeps. Thresholds for unknown materials are left out, since they were
    /// fitted to sweeps of the training skin.
    ///
    /// # Errors
    /// A folder that is not empty; a file that cannot be written.
    pub fn create_adapted(
        &self,
        path: &Path,
        adapted: Adapted,
        adaptation: Adaptation,
    ) -> Result<Self, PipelineError> {
        let known = match &adapted.config.model {
            ModelConfig::Network(_) => Some(self.train_embeddings()?),
            ModelConfig::Baseline(_) | ModelConfig::Committee(_) => None,
        };
        let mut adaptations = self.adaptations()?;
        adaptations.push(adaptation);
        let derived = Derived {
            classifier: &adapted.config,
            weights: &adapted.weights,
            known: known.as_ref(),
            calibration: None,
            likeness: adapted.likeness,
            enrolled: self.enrolled()?,
            adaptations,
        };
        self.create_derived(path, derived)
    }

    /// Creates a run directory with the content of `self` and another classifier, without training metrics and results. The folder is built next
    /// to `path` under another name and renamed to `path` once it is complete.
    fn create_derived(&self, path: &Path, derived: Derived<'_>) -> Result<Self, PipelineError> {
        let occupied = fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_some());
        if occupied {
            return Err(PipelineError::run(path, "the folder is not empty")
                .with_remedy(PipelineRemedy::NameFolder));
        }
        let mut name = std::ffi::OsString::from(DRAFT);
        name.push(path.file_name().unwrap_or_default());
        let draft = path.with_file_name(name);
        let failed = |error| PipelineError::io(path, "make the run directory", error);
        if draft.exists() {
            // Left over from a process that was killed.
            fs::remove_dir_all(&draft).map_err(failed)?;
        }
        let config = RunConfig {
            classifier: derived.classifier.clone(),
            ..self.config()?
        };
        let sessions: Vec<Provenance> = self.read_json(ENVIRONMENT)?;
        let Some(last) = sessions.last() else {
            return Err(self.refused("environment.json lists no session"));
        };
        let run = Self::create(&draft, &config, &self.split()?, last)?;
        run.write_json(ENVIRONMENT, &sessions)?;
        if !derived.enrolled.is_empty() {
            run.write_json(ENROLLED, &derived.enrolled)?;
        }
        if !derived.adaptations.is_empty() {
            run.write_adaptations(&derived.adaptations)?;
        }
        if let Some(calibration) = derived.calibration {
            run.write_calibration(calibration)?;
            let held_out = self.file(HELD_OUT);
            if held_out.exists() {
                fs::copy(&held_out, run.file(HELD_OUT))
                    .map_err(|error| PipelineError::io(&held_out, "copy", error))?;
            }
        }
        if let Some(likeness) = &derived.likeness {
            run.write_likeness(likeness)?;
        }
        match derived.known {
            Some(known) => {
                run.write_train_embeddings(known)?;
                run.write_weights(derived.weights)?;
            }
            None => run.write_baseline(derived.weights)?,
        }
        run.write_manifest()?;
        drop(run);
        fs::rename(&draft, path).map_err(failed)?;
        Self::open(path)
    }
}
