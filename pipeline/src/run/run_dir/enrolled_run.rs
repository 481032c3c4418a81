//! Run directories of classifiers to which a material was added.

use std::fs;
use std::path::Path;

use tactnet_data::SweepView;

use super::{ENROLLED, ENVIRONMENT, HELD_OUT};
use crate::{
    Enrolled, EnrolledMaterial, PipelineError, PipelineRemedy, Provenance, RunConfig, RunDir,
};

/// Prefix of the name of a folder that is still incomplete.
const DRAFT: &str = ".enrolling-";

impl RunDir {
    /// Creates a run directory for a classifier with one more material. It holds the content of `self` without training metrics and results.
    /// The folder is built next to `path` under another name and renamed to `path` once it is complete.
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
        let mut materials = self.enrolled()?;
        materials.push(material);
        let config = RunConfig {
            classifier: enrolled.config.clone(),
            ..self.config()?
        };
        let sessions: Vec<Provenance> = self.read_json(ENVIRONMENT)?;
        let Some(last) = sessions.last() else {
            return Err(self.refused("environment.json lists no session"));
        };
        let run = Self::create(&draft, &config, &self.split()?, last)?;
        run.write_json(ENVIRONMENT, &sessions)?;
        run.write_json(ENROLLED, &materials)?;
        run.write_train_embeddings(&enrolled.known)?;
        if let Some(calibration) = &enrolled.calibration {
            run.write_calibration(calibration)?;
        }
        let held_out = self.file(HELD_OUT);
        if held_out.exists() {
            fs::copy(&held_out, run.file(HELD_OUT))
                .map_err(|error| PipelineError::io(&held_out, "copy", error))?;
        }
        if let Some(likeness) = self.likeness()? {
            let label = enrolled.config.labels.len() - 1;
            run.write_likeness(&likeness.extended(sweeps, label)?)?;
        }
        run.write_weights(&enrolled.weights)?;
        run.write_manifest()?;
        drop(run);
        fs::rename(&draft, path).map_err(failed)?;
        Self::open(path)
    }
}
