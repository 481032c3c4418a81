//! Training sweeps set aside for calibration.

use tactnet_data::{Fold, SweepView, TrainSplit, ValidationSplit};

use crate::predict::judged_sweeps::JudgedSweeps;
use crate::{
    Calibration, CalibrationTarget, Classifier, ModelConfig, NoveltyScore, NoveltyScorer,
    PipelineError, RunDir, TrainEmbeddings,
};

/// Sweeps set aside, with the rates of the calibration.
pub(super) type Aside<'a> = (CalibrationTarget, ValidationSplit<'a>);

/// Fold for fitting, and the training sweeps set aside for calibration with their rates, if any.
pub(super) type SetAside<'a> = (Fold<'a>, Option<Aside<'a>>);

/// Sets sweeps aside for calibration.
pub(super) fn set_aside<'a>(
    fold: &Fold<'a>,
    target: Option<CalibrationTarget>,
) -> Result<SetAside<'a>, PipelineError> {
    match target {
        None => Ok((fold.clone(), None)),
        Some(target) => {
            let (fitted, aside) = fold.set_aside()?;
            Ok((fitted, Some((target, aside))))
        }
    }
}

/// Writes the embeddings of a network's training sweeps, and fits and writes the thresholds of a network or committee.
///
/// - `aside`: target rates, and sweeps to which nothing was fitted
///
/// The thresholds of a committee are fitted to the plain mean of its members' posteriors; no member is calibrated again.
pub(super) fn write_known(
    run: &RunDir,
    classifier: &Classifier,
    train: &TrainSplit<'_>,
    aside: Option<(CalibrationTarget, &SweepView<'_>)>,
) -> Result<Option<Calibration>, PipelineError> {
    let model = &classifier.config().model;
    let known = match model {
        ModelConfig::Network(_) => Some(TrainEmbeddings::of(&classifier.embed(train)?)),
        ModelConfig::Baseline(_) | ModelConfig::Committee(_) => None,
    };
    if let Some(known) = &known {
        run.write_train_embeddings(known)?;
    }
    let Some((target, aside)) = aside else {
        return Ok(None);
    };
    let score = NoveltyScore::best_for(model);
    let judged = match &known {
        None => JudgedSweeps::of(classifier, score, None, aside)?,
        Some(known) => {
            let held_out = classifier.embed(aside)?;
            run.write_held_out(&held_out)?;
            let scorer = NoveltyScorer::fit(classifier, known)?;
            JudgedSweeps::of_embedding(score, &scorer, &held_out)?
        }
    };
    let calibration = Calibration::fit(target, score, &judged)?;
    run.write_calibration(&calibration)?;
    Ok(Some(calibration))
}
