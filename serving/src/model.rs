//! The serving model: loaded from a run directory, checked against the skin, changed by enrolment and adaptation.

use std::path::{Path, PathBuf};

use tactnet_data::{Dataset, LabelSet, Samples, SweepRecord, SweepView};
use tactnet_models::Compute;
use tactnet_pipeline::{
    Adaptation, Classifier, ClassifierConfig, EnrolledMaterial, Likeness, LikenessReport,
    NewSweeps, OnlineClassifier, PipelineError, RiskPolicy, RunDir, Thresholds, TrainEmbeddings,
    adapt, enroll,
};
use tactnet_skin::packets::{MAX_MATERIALS, ModelNames, Text, unfit};

use crate::ServeError;

/// Source of models.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ModelSource {
    /// One run directory.
    Run(PathBuf),
    /// A folder of run directories named by version numbers. The largest usable version serves, also if it appears later.
    Versions(PathBuf),
}

impl ModelSource {
    /// Returns numbers and run directories of all complete versions, newest first. A single run is version 0.
    ///
    /// # Errors
    /// Fails if the folder cannot be read or contains no complete version.
    pub fn versions(&self) -> Result<Vec<(u64, PathBuf)>, ServeError> {
        let folder = match self {
            Self::Run(path) => return Ok(vec![(0, path.clone())]),
            Self::Versions(folder) => folder,
        };
        let mut versions = numbered(folder)?;
        // Training writes its result last, enrolment and adaptation their weights; a run without them is incomplete.
        versions.retain(|(_, path)| {
            ["result.json", "enrolled.json", "adapted.json"]
                .iter()
                .any(|file| path.join(file).exists())
                && RunDir::open(path).is_ok_and(|run| run.has_final_weights())
        });
        if versions.is_empty() {
            return Err(ServeError::NoVersion {
                folder: folder.clone(),
            });
        }
        versions.sort_unstable_by(|a, b| b.cmp(a));
        Ok(versions)
    }

    /// Loads the newest version that can serve, and returns it with the errors of newer ones.
    ///
    /// - `mc_samples`: number of Monte Carlo dropout masks
    /// - `dead`: taxels to mask
    ///
    /// # Errors
    /// Returns the newest version's error if no version can serve.
    pub fn load_newest(
        &self,
        mc_samples: usize,
        dead: &[usize],
    ) -> Result<(ServedModel, Vec<ServeError>), ServeError> {
        let mut damaged = Vec::new();
        for (version, path) in self.versions()? {
            let loaded = ServedModel::load(&path, version);
            match loaded.and_then(|mut model| model.online(mc_samples, dead).map(|_| model)) {
                Ok(model) => return Ok((model, damaged)),
                Err(error) => damaged.push(error),
            }
        }
        Err(damaged.swap_remove(0))
    }
}

/// Returns all entries of a folder whose names are numbers.
pub(crate) fn numbered(folder: &Path) -> Result<Vec<(u64, PathBuf)>, ServeError> {
    let failed = |source| ServeError::Io {
        path: folder.into(),
        source,
    };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        if let Some(number) = entry
            .file_name()
            .to_str()
            .and_then(|name| name.parse().ok())
        {
            found.push((number, entry.path()));
        }
    }
    Ok(found)
}

/// A trained network that can serve, with its run directory.
pub struct ServedModel {
    version: u64,
    run: RunDir,
    classifier: Classifier,
    /// Embeddings of the training sweeps, needed for enrolment.
    known: Option<TrainEmbeddings>,
    thresholds: Option<Thresholds>,
    /// Description of the training sweeps; `None` for a run with too few of them, or of an earlier version.
    likeness: Option<Likeness>,
}

impl ServedModel {
    /// Loads a run directory.
    ///
    /// # Errors
    /// Fails if the run is incomplete or unreadable, or if it has more taxels or materials than packets hold.
    pub fn load(path: &Path, version: u64) -> Result<Self, ServeError> {
        let run = RunDir::open(path)?.network("be served")?;
        let config = run.config()?.classifier;
        if !run.has_final_weights() {
            return Err(run.no_final_weights().into());
        }
        if let Some(reason) = unfit(config.taxel_shape().taxels(), config.labels.len()) {
            return Err(ServeError::Unfit {
                path: path.into(),
                reason,
            });
        }
        let weights = run.weights()?;
        let classifier = Classifier::new(config, &weights, &Compute::Cpu.open()?)?;
        Ok(Self {
            version,
            known: run.train_embeddings().ok(),
            thresholds: run.thresholds(&classifier)?,
            likeness: run.likeness()?,
            classifier,
            run,
        })
    }

    /// Returns the version number.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Returns the run directory.
    pub fn path(&self) -> &Path {
        self.run.path()
    }

    /// Returns the offline classifier.
    pub fn classifier(&self) -> &Classifier {
        &self.classifier
    }

    /// Returns true if the model can detect unknown materials.
    pub fn is_calibrated(&self) -> bool {
        self.thresholds.is_some()
    }

    /// Returns true if sweeps can be compared with the training sweeps.
    pub fn compares(&self) -> bool {
        self.likeness.is_some()
    }

    /// Compares recent sweeps with the training sweeps; returns `None` if the run has no description of these.
    ///
    /// - `digits`: `[sweeps][steps][taxels]`
    ///
    /// # Errors
    /// Fails if there are no sweeps.
    pub fn assess(&self, digits: Vec<f32>) -> Result<Option<LikenessReport>, ServeError> {
        let Some(likeness) = &self.likeness else {
            return Ok(None);
        };
        let config = self.classifier.config();
        let recent = recent_dataset(config, "unlabelled", digits)?;
        Ok(Some(likeness.assess(&SweepView::all(&recent), config.seed)))
    }

    /// Returns the taxels that are most likely dead; none if the run has no description of its training sweeps.
    ///
    /// - `digits`: `[sweeps][steps][taxels]`
    ///
    /// # Errors
    /// Fails if there are no sweeps.
    pub fn dead_taxels(&self, digits: Vec<f32>) -> Result<Vec<usize>, ServeError> {
        let Some(likeness) = &self.likeness else {
            return Ok(Vec::new());
        };
        let recent = recent_dataset(self.classifier.config(), "unlabelled", digits)?;
        Ok(likeness.dead_taxels(&SweepView::all(&recent)))
    }

    /// Masks dead taxels in place of those masked before.
    ///
    /// # Errors
    /// Fails for a taxel that does not exist, and if no other taxel remains.
    pub fn mask(&mut self, dead: &[usize]) -> Result<(), ServeError> {
        Ok(self.classifier.mask(dead)?)
    }

    /// Writes the readings of masked taxels into sweeps.
    ///
    /// - `digits`: `[sweeps][steps][taxels]`
    ///
    /// # Errors
    /// Fails for a taxel that does not exist, and if no other taxel remains.
    pub fn write_masked(&mut self, dead: &[usize], digits: &mut [f32]) -> Result<(), ServeError> {
        self.mask(dead)?;
        let taxels = self.classifier.config().shape.taxels();
        self.classifier.dead().apply(digits, taxels);
        Ok(())
    }

    /// Creates a classifier for the frames of one finger.
    ///
    /// - `mc_samples`: number of Monte Carlo dropout masks
    /// - `dead`: taxels to mask
    ///
    /// # Errors
    /// Fails if the model needs complete sweeps, or the taxels cannot be masked.
    pub fn online(
        &mut self,
        mc_samples: usize,
        dead: &[usize],
    ) -> Result<OnlineClassifier, ServeError> {
        self.mask(dead)?;
        let calibration = self.thresholds.as_ref().map(|of| of.calibration.clone());
        Ok(OnlineClassifier::new(
            &self.classifier,
            calibration,
            mc_samples,
        )?)
    }

    /// Checks that the model fits the same skin as `serving`.
    ///
    /// # Errors
    /// Fails on another shape or sample rate. Fails unless the materials start with those of `serving`, in the same order.
    pub fn check_replaces(&self, serving: &Self) -> Result<(), ServeError> {
        let (new, old) = (self.classifier.config(), serving.classifier.config());
        let unfit = |reason: String| {
            Err(ServeError::Unfit {
                path: self.path().into(),
                reason,
            })
        };
        if new.shape != old.shape {
            return unfit(format!(
                "expected sweeps of {}, found {}",
                old.shape, new.shape
            ));
        }
        if serving.is_calibrated() && !self.is_calibrated() {
            return unfit(
                "it is not calibrated to detect unknown materials, but the serving model is".into(),
            );
        }
        if (new.sample_rate_hz - old.sample_rate_hz).abs() > 1e-6 * old.sample_rate_hz {
            return unfit(format!(
                "expected a sample rate of {} Hz, found {} Hz",
                old.sample_rate_hz, new.sample_rate_hz
            ));
        }
        let mut names = new.labels.names();
        if let Some(missing) = old.labels.names().find(|name| names.next() != Some(name)) {
            return unfit(format!(
                "material `{missing}` is missing or has another label"
            ));
        }
        Ok(())
    }

    /// Returns the packet with materials and shape.
    pub fn names(&self, mc_samples: usize) -> ModelNames {
        let config = self.classifier.config();
        let mut names = [Text::default(); MAX_MATERIALS];
        for (text, name) in names.iter_mut().zip(config.labels.names()) {
            *text = Text::new(name);
        }
        ModelNames {
            version: self.version,
            sample_rate_hz: config.sample_rate_hz,
            steps: config.shape.steps as u32,
            rows: config.taxel_shape().rows as u32,
            cols: config.taxel_shape().cols as u32,
            mc_samples: mc_samples as u32,
            materials: config.labels.len() as u32,
            reserved: 0,
            names,
        }
    }

    /// Enrolls a material from recent sweeps and writes the result as a new run directory.
    ///
    /// - `digits`: `[sweeps][steps][taxels]`
    /// - `path`: the new run directory
    /// - `git`: commit of the program, recorded in the run
    ///
    /// # Errors
    /// Fails if the material exists, if the run has no embeddings of the training sweeps, or if the folder cannot be written.
    pub fn enroll(
        &self,
        material: &str,
        digits: Vec<f32>,
        path: &Path,
        version: u64,
        git: &str,
    ) -> Result<Self, ServeError> {
        let known = match &self.known {
            Some(known) => known,
            // The error names the missing file.
            None => &self.run.train_embeddings()?,
        };
        let config = self.classifier.config();
        if config.labels.len() == MAX_MATERIALS {
            return Err(ServeError::TooManyMaterials {
                material: material.into(),
                number: MAX_MATERIALS + 1,
                most: MAX_MATERIALS,
            });
        }
        let dataset = recent_dataset(config, material, digits)?;
        let view = SweepView::new(&dataset, (0..dataset.len()).collect());
        let enrolled = enroll(
            &self.classifier,
            known,
            self.thresholds.as_ref(),
            &view,
            material,
        )?;
        let record = EnrolledMaterial::new(material, &view, &self.run.weights()?, git)?;
        // The folder gets its final name once it is complete and can be loaded.
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let draft = path.with_file_name(format!(".{name}"));
        let failed = |source| ServeError::Io {
            path: path.into(),
            source,
        };
        if draft.exists() {
            std::fs::remove_dir_all(&draft).map_err(failed)?;
        }
        self.run.create_enrolled(&draft, &enrolled, record, &view)?;
        Self::load(&draft, version)?;
        std::fs::rename(&draft, path).map_err(failed)?;
        Self::load(path, version)
    }

    /// Adapts the model to recent sweeps of mixed materials and writes the result as a new run directory; returns the model and
    /// the record of the adaptation.
    ///
    /// - `digits`: `[sweeps][steps][taxels]`
    /// - `path`: the new run directory
    /// - `git`: commit of the program, recorded in the run
    ///
    /// # Errors
    /// Fails if the sweeps are too few, or of too few materials, and if the folder cannot be written.
    pub fn adapt(
        &self,
        digits: Vec<f32>,
        path: &Path,
        version: u64,
        git: &str,
    ) -> Result<(Self, Adaptation), ServeError> {
        let recent = recent_dataset(self.classifier.config(), "unlabelled", digits)?;
        let view = SweepView::all(&recent);
        let new = NewSweeps {
            unlabelled: Some(&view),
            labelled: None,
        };
        let adapted = adapt(
            &self.classifier,
            self.likeness.as_ref(),
            new,
            RiskPolicy::Refuse,
        )?;
        let record = Adaptation::new(&adapted, new, &self.run.weights()?, git)?;
        self.run.create_adapted(path, adapted, record.clone())?;
        Ok((Self::load(path, version)?, record))
    }
}

/// Returns recent sweeps of one material, or of unknown ones, as a data set.
fn recent_dataset(
    config: &ClassifierConfig,
    material: &str,
    digits: Vec<f32>,
) -> Result<Dataset, PipelineError> {
    let shape = config.taxel_shape();
    let sweeps = digits.len() / shape.values();
    let records = (0..sweeps).map(|sweep| SweepRecord::new(0, sweep));
    Ok(Dataset::new(
        "live",
        config.sample_rate_hz,
        shape,
        LabelSet::new([material])?,
        records.collect(),
        Samples::F32(digits),
    )?)
}
