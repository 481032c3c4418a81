//! A committee from the predictions of its members, where these have been trained on the same sweeps anyway.

use std::collections::BTreeMap;

use super::evaluate_run::{FUSED, MC_SAMPLES, write_evaluation};
use super::session::Opened;
use crate::{
    CommitteeRecipe, Evaluation, ModelRecipe, PipelineError, PredictionMethod, Predictions,
    RunConfig, RunDir, RunResult, Session, SweepScore, TrainingSummary,
};

/// Finished run of a member.
struct Member {
    name: String,
    run: RunDir,
    result: RunResult,
}

impl Session {
    /// Averages the probabilities that the members of a committee gave in runs of their own. The run gets the result of training the
    /// committee, with the training times of the members, but no weights.
    ///
    /// Returns `None`, and writes nothing, unless every member has a finished run on the same sweeps with the same seed among `runs`.
    ///
    /// # Errors
    /// A file that is damaged or cannot be written.
    pub fn average(&self, runs: Vec<RunDir>) -> Result<Option<RunResult>, PipelineError> {
        let begun = match self.open(&mut |_| ())? {
            Opened::Ended(result) => return Ok(Some(*result)),
            Opened::Begun(begun) => *begun,
        };
        let (config, fold) = (&begun.config, &begun.fold);
        // As the recipes of the members, it is read from a file: reading JSON may change the last digit of a number.
        let written = RunDir::open(self.run().path())?.config()?.recipe;
        let ModelRecipe::Committee(recipe) = &written else {
            return Ok(None);
        };
        let split = fold.manifest().sha256;
        let Some(members) = members_of(recipe, config, &split, runs)? else {
            return Ok(None);
        };
        let Some(predictions) = averaged(recipe, &members)? else {
            return Ok(None);
        };
        let evaluate = |predictions: Predictions| {
            let evaluation = Evaluation::of_view(&fold.test, &predictions, FUSED, config.spec.seed);
            (predictions, evaluation)
        };
        let ways = predictions.into_iter().map(evaluate).collect();
        let command = (self.program.command)(&config.named_spec(fold).without_folders());
        let trained = summed(&members);
        let run = self.run();
        let result = write_evaluation(run, config, ways, fold, begun.sessions, trained, command)?;
        run.write_json("result.json", &result)?;
        run.write_manifest()?;
        Ok(Some(result))
    }
}

/// Returns the finished runs of all members, in the order of the recipe; `None` if one is missing.
fn members_of(
    recipe: &CommitteeRecipe,
    config: &RunConfig,
    split_sha256: &str,
    runs: Vec<RunDir>,
) -> Result<Option<Vec<Member>>, PipelineError> {
    let mut finished = Vec::new();
    for run in runs {
        let Some(result) = run.result()? else {
            continue;
        };
        let is_alike = result.seed == config.spec.seed
            && result.data_sha256 == config.data_sha256
            && result.split_sha256 == split_sha256;
        if is_alike {
            finished.push((run.config()?.recipe, run, result));
        }
    }
    let mut members = Vec::new();
    for member in &recipe.members {
        let Some(found) = finished.iter().position(|(recipe, _, _)| recipe == member) else {
            return Ok(None);
        };
        let (recipe, run, result) = finished.swap_remove(found);
        members.push(Member {
            name: recipe.name().into(),
            run,
            result,
        });
    }
    Ok(Some(members))
}

/// Returns the mean predictions: plain, and by MC dropout if a member has dropout, where members without it predict plainly. Returns `None` if
/// a member has another number of Monte Carlo passes than the committee.
fn averaged(
    recipe: &CommitteeRecipe,
    members: &[Member],
) -> Result<Option<Vec<Predictions>>, PipelineError> {
    let plain = PredictionMethod::Plain;
    let mc_samples = recipe.method().mc_samples_or(MC_SAMPLES);
    let dropout = PredictionMethod::McDropout { mc_samples };
    let with_dropout = |member: &&Member| {
        let mut methods = member.result.evaluations.keys();
        methods.any(|method| *method != plain)
    };
    let mut methods = vec![plain];
    methods.extend(members.iter().find(with_dropout).map(|_| dropout));
    let mut means = Vec::new();
    for method in methods {
        let mut of_members = Vec::new();
        for member in members {
            let own = if with_dropout(&member) { method } else { plain };
            if !member.result.evaluations.contains_key(&own) {
                return Ok(None);
            }
            of_members.push(member.run.predictions(own)?.1);
        }
        means.push(mean(&of_members, method));
    }
    Ok(Some(means))
}

/// Returns the mean probabilities of predictions of the same sweeps.
fn mean(of: &[Predictions], method: PredictionMethod) -> Predictions {
    let share = 1.0 / of.len() as f64;
    let sweeps = of[0].sweeps.iter().enumerate().map(|(row, sweep)| {
        let probability = |label: usize| -> f64 {
            let members = of.iter();
            members
                .map(|member| share * member.sweeps[row].log_probability[label].exp())
                .sum()
        };
        SweepScore {
            log_probability: (0..sweep.log_probability.len())
                .map(|label| probability(label).ln())
                .collect(),
            ..sweep.clone()
        }
    });
    Predictions {
        labels: of[0].labels.clone(),
        method,
        sweeps: sweeps.collect(),
    }
}

/// Returns the training of all members together.
fn summed(members: &[Member]) -> TrainingSummary {
    let mut chosen = BTreeMap::new();
    for Member { name, result, .. } in members {
        let settings = result.chosen.iter();
        chosen.extend(settings.map(|(setting, value)| (format!("{name}.{setting}"), *value)));
    }
    TrainingSummary {
        seconds: members.iter().map(|of| of.result.train_seconds).sum(),
        sweeps: members[0].result.n_train,
        epochs: None,
        chosen,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use tactnet_data::format::Format;
    use tactnet_data::twin;

    use super::*;
    use crate::{Program, Provenance, TrainJob, TrainOutcome, TrainSpec};

    const NETWORK: &str = "name = \"net\"\nnetwork = { maps = [4], hidden = 8, keep_probability = 0.8 }\n\
        training = { epochs = 2, batch = 12, learning_rate = 0.01, method = { kind = \"base\" } }\n\
        prediction = { method = { kind = \"mc-dropout\", mc_samples = 5 } }\n";

    fn program() -> Program {
        Program {
            provenance: Provenance::of_this_process("0", "test"),
            command: |spec| format!("train {}", spec.recipe),
        }
    }

    fn session(folder: &Path, recipe: &str, out: &str, seed: u64) -> Session {
        let spec = TrainSpec {
            data: folder.join("twin.npz").display().to_string(),
            recipe: recipe.into(),
            seed: tactnet_data::Seed(seed),
            shots: Some(6),
            ..TrainSpec::default()
        };
        let job = TrainJob::try_from(spec).unwrap();
        Session::begin(&job, Some(&folder.join(out)), program(), |_| Ok(())).unwrap()
    }

    fn trained(session: &Session) -> RunResult {
        match session.train(|_| (), || false).unwrap() {
            TrainOutcome::Finished(result) => *result,
            TrainOutcome::Stopped => panic!("not stopped"),
        }
    }

    #[test]
    fn the_average_of_the_members_is_the_trained_committee() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        let twin = twin::small(3, 15, 100);
        Format::Npz
            .write(&path.join("twin.npz"), &twin.unwrap())
            .unwrap();
        let file = |name: &str, text: String| {
            let file = path.join(name);
            std::fs::write(&file, text).unwrap();
            file.display().to_string()
        };
        let network = file("net.toml", NETWORK.into());
        let inline = NETWORK.trim_end().replace('\n', ", ");
        let members = format!("[\"lda\", {{ {inline} }}, \"minirocket\"]");
        let committee = file(
            "three.toml",
            format!("name = \"three\"\nmembers = {members}\n"),
        );

        for recipe in ["minirocket", &network, "lda"] {
            let name = Path::new(recipe).file_stem().unwrap().display().to_string();
            trained(&session(path, recipe, &name, 1));
        }
        let open = |names: &[&str]| -> Vec<RunDir> {
            names
                .iter()
                .map(|name| RunDir::open(&path.join(name)).unwrap())
                .collect()
        };
        let average = session(path, &committee, "average", 1);
        assert_eq!(average.average(open(&["minirocket", "net"])).unwrap(), None);
        let found = average
            .average(open(&["minirocket", "net", "lda"]))
            .unwrap()
            .unwrap();
        let whole = session(path, &committee, "whole", 1);
        let expected = trained(&whole);
        assert_eq!(
            found.split,
            "fold 1 of 5, 6 training sweeps of each material"
        );
        assert_eq!(
            (found.n_train, found.split_sha256),
            (18, expected.split_sha256.clone())
        );
        assert_eq!(found.evaluations.len(), 2, "plain and MC dropout");
        for method in expected.evaluations.keys() {
            let [(_, own), (_, whole)] =
                [average.run(), whole.run()].map(|run| run.predictions(*method).unwrap());
            for (own, whole) in own.sweeps.iter().zip(&whole.sweeps) {
                for (own, whole) in own.log_probability.iter().zip(&whole.log_probability) {
                    // Files hold probabilities to the last bit; the sums are taken in another order.
                    assert!((own.exp() - whole.exp()).abs() < 1e-12, "{own} {whole}");
                }
            }
        }
        assert!(found.train_seconds > 0.0 && found.chosen == expected.chosen);
        average.run().verified_result().unwrap().unwrap();

        // Members with another seed belong to another committee.
        let other = session(path, &committee, "other", 2);
        assert_eq!(
            other.average(open(&["minirocket", "net", "lda"])).unwrap(),
            None
        );
    }
}
