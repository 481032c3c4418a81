//! The model that serves: loaded from a run directory, checked against the skin, made anew when a material is learnt.

use std::path::{Path, PathBuf};

use tactnet_data::{Dataset, LabelSet, Samples, SweepRecord, SweepView};
use tactnet_models::Compute;
use tactnet_pipeline::{
    Classifier, EnrolledMaterial, OnlineClassifier, PipelineError, RunDir, Thresholds,
    TrainEmbeddings, enroll,
};

use crate::ServeError;
use tactnet_skin::packets::{MAX_MATERIALS, ModelNames, Text, unfit};

/// Where models come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ModelSource {
    /// One run directory.
    Run(PathBuf),
    /// A folder of run directories with numbers for names; the largest that can serves, also when it lands while another one does.
    Versions(PathBuf),
}

impl ModelSource {
    /// Numbers and run directories of the versions that have landed, newest first; a single run is version 0.
    ///
    /// # Errors
    /// No version there; a folder that cannot be read.
    pub fn versions(&self) -> Result<Vec<(u64, PathBuf)>, ServeError> {
        let folder = match self {
            Self::Run(path) => return Ok(vec![(0, path.clone())]),
            Self::Versions(folder) => folder,
        };
        let mut versions = numbered(folder)?;
        // The last file of a training is its result, of an enrolment its weights; a run without is still on its way.
        versions.retain(|(_, path)| {
            ["result.json", "enrolled.json"]
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

    /// Loads the newest version that can serve, with what is wrong with newer ones.
    ///
    /// - `mc_samples`: Monte Carlo dropout masks that it is to serve with
    ///
    /// # Errors
    /// Those of the newest version, where none can serve.
    pub fn load_newest(
        &self,
        mc_samples: usize,
    ) -> Result<(ServedModel, Vec<ServeError>), ServeError> {
        let mut damaged = Vec::new();
        for (version, path) in self.versions()? {
            let loaded = ServedModel::load(&path, version);
            match loaded.and_then(|model| model.online(mc_samples).map(|_| model)) {
                Ok(model) => return Ok((model, damaged)),
                Err(error) => damaged.push(error),
            }
        }
        Err(damaged.swap_remove(0))
    }
}

/// Whatever has a number for a name.
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

/// A trained network that can serve.
pub struct ServedModel {
    version: u64,
    run: RunDir,
    classifier: Classifier,
    /// For enrolment.
    known: Option<TrainEmbeddings>,
    thresholds: Option<Thresholds>,
}

impl ServedModel {
    /// Loads a run directory.
    ///
    /// # Errors
    /// A run that has not ended or cannot be read; more taxels or materials than packets hold.
    pub fn load(path: &Path, version: u64) -> Result<Self, ServeError> {
        let run = RunDir::open(path)?;
        let config = run.config()?;
        config.require_network(path, "be served")?;
        let config = config.classifier;
        if !run.has_final_weights() {
            return Err(ServeError::Unfit {
                path: path.into(),
                reason: run.why_no_final_weights(),
            });
        }
        if let Some(reason) = unfit(config.shape.taxels(), config.labels.len()) {
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
            classifier,
            run,
        })
    }

    /// Its number.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Its run directory.
    pub fn path(&self) -> &Path {
        self.run.path()
    }

    /// The offline classifier.
    pub fn classifier(&self) -> &Classifier {
        &self.classifier
    }

    /// Returns true if it can tell unknown materials.
    pub fn is_calibrated(&self) -> bool {
        self.thresholds.is_some()
    }

    /// A classifier for the frames of one finger.
    ///
    /// - `mc_samples`: Monte Carlo dropout masks
    ///
    /// # Errors
    /// A model that needs whole sweeps.
    pub fn online(&self, mc_samples: usize) -> Result<OnlineClassifier, ServeError> {
        let calibration = self.thresholds.as_ref().map(|of| of.calibration.clone());
        Ok(OnlineClassifier::new(
            &self.classifier,
            calibration,
            mc_samples,
        )?)
    }

    /// Refuses a model for another skin.
    ///
    /// # Errors
    /// Another shape or rate than `serving`'s, or materials that are not its own in their order and perhaps more.
    pub fn check_replaces(&self, serving: &Self) -> Result<(), ServeError> {
        let (new, old) = (self.classifier.config(), serving.classifier.config());
        let unfit = |reason: String| {
            Err(ServeError::Unfit {
                path: self.path().into(),
                reason,
            })
        };
        if new.shape != old.shape {
            return unfit(format!("sweeps of {}, served are {}", new.shape, old.shape));
        }
        if serving.is_calibrated() && !self.is_calibrated() {
            return unfit(
                "it cannot tell unknown materials, the served one can; train it with `--calibrate`"
                    .into(),
            );
        }
        if (new.sample_rate_hz - old.sample_rate_hz).abs() > 1e-6 * old.sample_rate_hz {
            return unfit(format!(
                "{} Hz, served are {} Hz",
                new.sample_rate_hz, old.sample_rate_hz
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

    /// Returns the packet for onlookers.
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
            rows: config.shape.rows as u32,
            cols: config.shape.cols as u32,
            mc_samples: mc_samples as u32,
            materials: config.labels.len() as u32,
            reserved: 0,
            names,
        }
    }

    /// Learns a material from sweeps that were just recorded, and writes the result as a run directory of its own.
    ///
    /// - `digits`: `[sweeps][steps][taxels]`
    /// - `path`: of the new run directory
    ///
    /// # Errors
    /// A name that is known; no embeddings of the training sweeps; a folder that cannot be written.
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
            // Says what is missing.
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
        let sweeps = digits.len() / config.shape.values();
        let records = (0..sweeps).map(|sweep| SweepRecord {
            label: 0,
            sweep,
            block: None,
            test: None,
        });
        let dataset = Dataset::new(
            "live",
            config.sample_rate_hz,
            config.shape,
            LabelSet::new([material]).map_err(PipelineError::from)?,
            records.collect(),
            Samples::F32(digits),
        )
        .map_err(PipelineError::from)?;
        let view = SweepView::new(&dataset, (0..sweeps).collect());
        let enrolled = enroll(
            &self.classifier,
            known,
            self.thresholds.as_ref(),
            &view,
            material,
        )?;
        let record = EnrolledMaterial::new(material, &view, &self.run.weights()?, git)?;
        // Under another name until it is whole and can be loaded.
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let draft = path.with_file_name(format!(".{name}"));
        let failed = |source| ServeError::Io {
            path: path.into(),
            source,
        };
        if draft.exists() {
            std::fs::remove_dir_all(&draft).map_err(failed)?;
        }
        self.run.create_enrolled(&draft, &enrolled, record)?;
        Self::load(&draft, version)?;
        std::fs::rename(&draft, path).map_err(failed)?;
        Self::load(path, version)
    }
}
