//! The remedies of typed errors, in the words of the command line. Libraries name no options; this table does.

use std::error::Error;

use tactnet_data::{DataError, Remedy};
use tactnet_experiments::{ExperimentError, ExperimentRemedy};
use tactnet_models::MissingFeature;
use tactnet_pipeline::PipelineError;
use tactnet_serving::ServeError;
use tactnet_simulation::SimulationError;

/// Appends the words of a remedy to a message, if there is one.
pub fn with_cure(message: &str, remedy: Option<&Remedy>) -> String {
    match remedy {
        Some(remedy) => format!("{message}; {}", words_of(remedy)),
        None => message.to_owned(),
    }
}

/// Returns the options and commands that apply a remedy.
pub(super) fn words_of(remedy: &Remedy) -> String {
    match remedy {
        Remedy::NameRate => "set it with `--rate HZ`".into(),
        Remedy::NameLabels => {
            "use `tactnet predict` for unlabelled sweeps, or label all with `tactnet data import --material NAME`"
                .into()
        }
        Remedy::NameSamples => "name the one that holds the taxels with `--samples NAME`".into(),
        Remedy::NameShape { rows, cols } => format!(
            "for a grid of taxels: `tactnet data import FILE --shape {rows}x{cols} --out NEW.npz`"
        ),
        Remedy::KeepLengths { steps } => format!(
            "keep the length of every sweep with `--steps all`, or the first {steps} frames of all with `--steps shortest`"
        ),
        Remedy::KeepSteps { steps } => format!(
            "keep the first {steps} frames of every sweep with `--steps shortest` or `--steps {steps}`"
        ),
        Remedy::Resample => {
            "`tactnet data import FILE --out NEW.npz --resample HZ` gives all sweeps one rate".into()
        }
        Remedy::CutWindows => {
            "`tactnet data import FILE --out NEW.npz --window 1s` cuts recordings into sweeps, between gaps and changes of the label"
                .into()
        }
        Remedy::DropUnlabelled => "leave them out with `--drop-label ''`".into(),
        Remedy::SubtractOffset => {
            "subtract the offset of each taxel first, the same one in all files: `X - X.mean((0, 1))` of the training sweeps"
                .into()
        }
        Remedy::ChooseFolds => "choose another split with `--folds N` or `--split hold-out`".into(),
        Remedy::LeaveBlocksOut => "split by blocks with `--split leave-block-out`".into(),
        Remedy::ListFindings { data } => format!("list all with `tactnet data check {data}`"),
        Remedy::ConvertRecording => {
            "convert it to a data set with `tactnet data import FILE --out NEW.npz`".into()
        }
        Remedy::PassDownloadedFile => {
            "then pass it with `--data FILE` or convert it with `tactnet data import FILE`".into()
        }
    }
}

/// Returns the command that builds a program with the missing cargo feature; `None` for other errors.
pub(super) fn words_of_missing_feature(cause: &(dyn Error + 'static)) -> Option<String> {
    let MissingFeature { feature } = cause.downcast_ref()?;
    Some(format!(
        "in a checkout of the source, `cargo install --path . --features {feature}` builds one that has it"
    ))
}

/// Returns the remedy of an error of this workspace; `None` for other errors.
pub(super) fn remedy_of(cause: &(dyn Error + 'static)) -> Option<Remedy> {
    if let Some(ServeError::Pipeline(error)) = cause.downcast_ref() {
        return error.remedy();
    }
    #[cfg(feature = "fetch")]
    if let Some(error) = cause.downcast_ref::<tactnet_data::FetchError>() {
        return error.remedy();
    }
    #[cfg(feature = "recording")]
    if let Some(tactnet_recording::RecordingError::Data(error)) = cause.downcast_ref() {
        return error.remedy();
    }
    None.or_else(|| cause.downcast_ref().and_then(DataError::remedy))
        .or_else(|| cause.downcast_ref().and_then(PipelineError::remedy))
        .or_else(|| cause.downcast_ref().and_then(ExperimentError::remedy))
}

/// Returns the words for errors of the simulation, whose variants are their own remedies.
pub(super) fn words_of_simulation(cause: &(dyn Error + 'static)) -> Option<&'static str> {
    match cause.downcast_ref()? {
        SimulationError::TooFewSweeps { .. } => {
            Some("set the number of sweeps per object with `--sweeps-per-object N`")
        }
        _ => None,
    }
}

/// Returns the options that apply the remedy of an experiment's error.
pub(super) fn words_of_experiment(cause: &(dyn Error + 'static)) -> Option<String> {
    let error: &ExperimentError = cause.downcast_ref()?;
    Some(match error.experiment_remedy()? {
        ExperimentRemedy::Run => "name a folder of `tactnet experiment run`".into(),
        ExperimentRemedy::OtherFolder => "name another folder with `--out`".into(),
        ExperimentRemedy::Set(settings) => {
            let options = settings.iter().map(|setting| {
                let setting = format!("{}={}", setting.field, setting.value);
                format!("`--set {}`", tactnet_pipeline::quoted(&setting))
            });
            format!("possible with {}", options.collect::<Vec<_>>().join(" "))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The wording of the remedies is asserted only here.
    #[test]
    fn an_error_is_printed_with_its_remedy() {
        let error = || DataError::inconsistent("sweeps", "150 frames", "300");
        let cut = || error().with_remedy(Remedy::KeepSteps { steps: 150 });
        for error in [
            anyhow::Error::from(cut()),
            PipelineError::from(cut()).into(),
            ExperimentError::from(PipelineError::from(cut())).into(),
            ServeError::from(PipelineError::from(cut())).into(),
        ] {
            let remedy = error.chain().find_map(remedy_of);
            assert_eq!(remedy, Some(Remedy::KeepSteps { steps: 150 }));
        }
        for (remedy, words) in [
            (Remedy::NameRate, "--rate HZ"),
            (Remedy::NameLabels, "data import --material NAME"),
            (Remedy::NameSamples, "--samples NAME"),
            (Remedy::NameShape { rows: 4, cols: 5 }, "--shape 4x5"),
            (Remedy::KeepLengths { steps: 150 }, "--steps all`"),
            (Remedy::KeepSteps { steps: 150 }, "--steps 150`"),
            (Remedy::Resample, "--resample HZ`"),
            (Remedy::CutWindows, "--window 1s`"),
            (Remedy::DropUnlabelled, "--drop-label ''`"),
            (Remedy::SubtractOffset, "`X - X.mean((0, 1))`"),
            (Remedy::ChooseFolds, "--split hold-out"),
            (Remedy::LeaveBlocksOut, "--split leave-block-out"),
            (
                Remedy::ListFindings {
                    data: "a.h5".into(),
                },
                "data check a.h5`",
            ),
            (Remedy::ConvertRecording, "data import FILE"),
            (Remedy::PassDownloadedFile, "--data FILE"),
        ] {
            let text = with_cure("no", Some(&remedy));
            assert!(text.starts_with("no; ") && text.contains(words), "{text}");
        }
    }

    #[test]
    fn errors_of_experiments_name_the_settings() {
        let error = ExperimentError::Unsuitable {
            origin: "a".into(),
            reason: "too few sweeps".into(),
            settings: vec![tactnet_experiments::Setting {
                field: "models",
                value: "[\"fast\"]".into(),
            }],
        };
        let words = words_of_experiment(&error).unwrap();
        assert_eq!(words, "possible with `--set 'models=[\"fast\"]'`");
        let path = "out".into();
        let words = words_of_experiment(&ExperimentError::NotPlanned { path }).unwrap();
        assert!(words.contains("tactnet experiment run"));
    }

    #[test]
    fn errors_of_the_simulation_name_the_option() {
        let error = SimulationError::TooFewSweeps {
            material: "cork".into(),
            found: 4,
            in_a_row: 5,
        };
        let words = words_of_simulation(&error).unwrap();
        assert!(words.contains("--sweeps-per-object"));
        assert_eq!(words_of_simulation(&SimulationError::Stopped), None);
    }
}
