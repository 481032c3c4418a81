//! Wording of remedies as options of the command line.

use tactnet_pipeline::Remedy;

use crate::commands::train::resume_command;

/// Returns a remedy as a clause that follows the description of the error.
pub fn worded(remedy: &Remedy) -> String {
    match remedy {
        Remedy::ConfirmAxes => "if they are in the right order, add --axes-are-right".into(),
        Remedy::NameRate => "`--rate HZ` names it".into(),
        Remedy::TrainWithRate => {
            "if the classifier's data were recorded at this rate, train again with `--rate`".into()
        }
        Remedy::KeepSteps { steps } => format!("`--steps {steps}` keeps the first of them"),
        Remedy::ArrangeTaxels { rows, columns } => format!(
            "`tactnet data import FILE --out NEW --shape {rows}x{columns}` arranges the same taxels"
        ),
        Remedy::NameData => "`--data FILE` names the data set".into(),
        Remedy::NameRun => "name a folder that `tactnet train` made".into(),
        Remedy::NameFolder => "name another folder with `--out`".into(),
        Remedy::Resume { run } => format!("continue it with `{}`", resume_command(run)),
        Remedy::ResumeOrNameFolder { run } => format!(
            "continue it with `{}`, or name another folder with `--out`",
            resume_command(run)
        ),
        Remedy::ChooseModel { models } => match &models[..] {
            [one] => format!("`--model {one}` learns from fewer"),
            several => format!(
                "`--model {}` learn from fewer",
                several.join("` and `--model ")
            ),
        },
        Remedy::TrainNetwork => "train one with `tactnet train --data FILE`".into(),
        Remedy::EnrollOrCalibrate => {
            "`tactnet enroll` adds one; a network of `train --calibrate` can detect unknown materials"
                .into()
        }
        Remedy::Calibrate => "a network of `train --calibrate` can detect unknown materials".into(),
        Remedy::EnrollFewerSweeps => {
            "`enroll --sweeps N` leaves the other sweeps of a file for tests".into()
        }
        Remedy::RelaxTargets {
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
        Remedy::RecordMore => "record more sweeps".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remedies_name_options() {
        let targets = Remedy::RelaxTargets {
            false_alarms: Some(0.2),
            coverage: Some(0.8),
        };
        let models = Remedy::ChooseModel {
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
                Remedy::Resume {
                    run: "runs/my run".into(),
                },
                "continue it with `tactnet train --resume 'runs/my run'`",
            ),
        ] {
            assert_eq!(worded(&remedy), expected);
        }
    }
}
