//! Remedies of the pipeline in the words of the command line.

use std::error::Error;

use tactnet_experiments::ExperimentError;
use tactnet_pipeline::{PipelineError, PipelineRemedy, quoted};
use tactnet_serving::ServeError;

use crate::commands::train::resume_command;

/// Returns the words for an error of the pipeline, or for an error that wraps one.
pub(super) fn words_of_pipeline(cause: &(dyn Error + 'static)) -> Option<String> {
    let of_experiment = || match cause.downcast_ref::<ExperimentError>()? {
        ExperimentError::Pipeline(error) => Some(error),
        _ => None,
    };
    let of_serving = || match cause.downcast_ref::<ServeError>()? {
        ServeError::Pipeline(error) => Some(error),
        _ => None,
    };
    let error = cause
        .downcast_ref::<PipelineError>()
        .or_else(of_experiment)
        .or_else(of_serving)?;
    error.pipeline_remedy().as_ref().map(worded)
}

/// Returns a remedy as a clause that follows the description of the error.
fn worded(remedy: &PipelineRemedy) -> String {
    match remedy {
        PipelineRemedy::Data(remedy) => super::remedy::words_of(remedy),
        PipelineRemedy::ConfirmAxes => "if they are in the right order, add --axes-are-right".into(),
        PipelineRemedy::AcceptWarnings => "without --strict it is a warning".into(),
        PipelineRemedy::TrainWithRate => {
            "if the classifier's data were recorded at this rate, train again with `--rate`".into()
        }
        PipelineRemedy::NameData => "`--data FILE` names the data set".into(),
        PipelineRemedy::NameRun => "name a folder that `tactnet train` made".into(),
        PipelineRemedy::NameFolder => "name another folder with `--out`".into(),
        PipelineRemedy::Resume { run } => format!("continue it with `{}`", resume_command(run)),
        PipelineRemedy::ResumeOrNameFolder { run } => format!(
            "continue it with `{}`, or name another folder with `--out`",
            resume_command(run)
        ),
        PipelineRemedy::ChooseModel { models } => match &models[..] {
            [one] => format!("`--model {one}` learns from fewer"),
            several => format!(
                "`--model {}` learn from fewer",
                several.join("` and `--model ")
            ),
        },
        PipelineRemedy::TrainNetwork => "train one with `tactnet train --data FILE`".into(),
        PipelineRemedy::Distill { run } => format!(
            "make a network of it with `tactnet distill {}`",
            quoted(&run.display().to_string())
        ),
        PipelineRemedy::EnrollOrCalibrate => {
            "`tactnet enroll` adds one; a network or committee of `train --calibrate` can detect unknown materials"
                .into()
        }
        PipelineRemedy::Calibrate => "a network or committee of `train --calibrate` can detect unknown materials".into(),
        PipelineRemedy::EnrollFewerSweeps => {
            "`enroll --sweeps N` leaves the other sweeps of a file for tests".into()
        }
        PipelineRemedy::RelaxTargets {
            false_alarms,
            coverage,
        } => {
            let options = [("false-alarms", false_alarms), ("coverage", coverage)];
            let options = options.iter().filter_map(|(name, share)| {
                share.map(|share| format!("`--{name} {share:.2}`"))
            });
            let options: Vec<String> = options.collect();
            format!("{} is possible with them", options.join(" with "))
        }
        PipelineRemedy::AcceptRisk => {
            "record sweeps of all materials in about equal numbers, or adapt nevertheless with `--accept-risk`"
                .into()
        }
        PipelineRemedy::ChooseScaledModel => {
            "train a network, `--model lda`, `svm-spectra` or `minirocket` instead".into()
        }
        PipelineRemedy::AdaptWithoutLabels => {
            "give the sweeps by `--data`, without labels, or train a network, `--model lda` or `minirocket` instead"
                .into()
        }
        PipelineRemedy::ListNetworks => {
            "export a network: that in the run's folder `network`, or one that `tactnet distill` makes of the run".into()
        }
        PipelineRemedy::RecordMore => "record more sweeps".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remedies_name_options() {
        let targets = PipelineRemedy::RelaxTargets {
            false_alarms: Some(0.2),
            coverage: Some(0.8),
        };
        let models = PipelineRemedy::ChooseModel {
            models: vec!["fast", "knn-h"],
        };
        for (remedy, expected) in [
            (
                targets,
                "`--false-alarms 0.20` with `--coverage 0.80` is possible with them",
            ),
            (
                models,
                "`--model fast` and `--model knn-h` learn from fewer",
            ),
            (
                PipelineRemedy::Resume {
                    run: "runs/my run".into(),
                },
                "continue it with `tactnet train --resume 'runs/my run'`",
            ),
        ] {
            assert_eq!(worded(&remedy), expected);
        }
    }
}
