//! Computation of `nshot`: trains a network on the known materials and evaluates all methods on all folds of the new
//! ones.

use rayon::prelude::*;
use tactnet_data::{Fold, MaterialSplit, Scheme, Seed, SweepView};
use tactnet_models::argmax;
use tactnet_pipeline::{Embedding, ModelRecipe, NetworkRecipe};

use super::few_shots::FewShots;
use super::knowledge::{Knowledge, learn};
use super::{FOLDS, Nshot, TransferMethod};
use crate::answer::Answer;
use crate::context::{Cancelled, StudyContext, embedded};
use crate::{Measure, Measurement};

/// Evaluates all methods and numbers of shots on one draw of new materials.
pub(super) fn transfer(task: &Nshot, context: &StudyContext<'_>) -> Result<Answer, Cancelled> {
    let stream = context.part.stream();
    let split = MaterialSplit::draw(context.dataset, task.new_materials, context.seed, stream)?;
    let knowledge = learn(task, context, &split)?;
    let everything = SweepView::all(&split.new);
    let whole = embedded(&knowledge.classifier, &everything)?;
    let by_pairs = match &knowledge.siamese_full {
        Some(classifier) => Some(embedded(classifier, &everything)?),
        None => None,
    };
    // Each draw has its own folds and shots, which all methods share.
    let own = context.seed_for("folds of new materials", stream);
    let folds: Vec<Fold<'_>> = (0..FOLDS)
        .map(|fold| Fold::new(&split.new, Scheme::default(), own, 0, fold))
        .collect::<Result<_, _>>()?;
    let mut measurements = Vec::new();
    let draw = NewMaterials {
        knowledge: &knowledge,
        everything: &everything,
        whole: &whole,
        by_pairs: by_pairs.as_ref(),
        materials: split.new.labels().len(),
    };
    for &shots in &task.shots {
        // Skip numbers of shots that the data set does not have.
        let Some(few) = with_shots(&folds, shots) else {
            continue;
        };
        for &method in task.methods() {
            context.say(&format!("{} with {shots} shots", method.name()))?;
            let (right, decisions) = match method {
                TransferMethod::Nk => {
                    // Use another fold in each draw.
                    let own = rotated(&few, stream);
                    let own = &own[..task.scratch_folds.clamp(1, FOLDS)];
                    let answers = own.iter().map(|fold| from_scratch(task, context, fold));
                    count_right(own, answers.collect())?
                }
                _ => count_right(&few, draw.answers(context, method, shots, &few))?,
            };
            let value = right as f64 / decisions as f64;
            measurements.push(
                Measurement::new(Measure::Accuracy, method.name(), value, decisions).shots(shots),
            );
        }
    }
    let names: Vec<&str> = split.new.labels().names().collect();
    Ok(Answer {
        measurements,
        split: format!("new materials: {}", names.join(", ")),
        split_content: format!("{:?} {}", split.new_labels, folds[0].manifest().sha256),
        chosen: knowledge.tuned.chosen(),
        ..Answer::default()
    })
}

/// All sweeps of the new materials of a draw, embedded.
struct NewMaterials<'a> {
    knowledge: &'a Knowledge,
    everything: &'a SweepView<'a>,
    whole: &'a Embedding,
    /// Embedding by the network trained on pairs.
    by_pairs: Option<&'a Embedding>,
    materials: usize,
}

impl NewMaterials<'_> {
    /// Returns the answers of `method` to the test sweeps of each fold.
    fn answers(
        &self,
        context: &StudyContext<'_>,
        method: TransferMethod,
        shots: usize,
        folds: &[Fold<'_>],
    ) -> Vec<Result<Vec<usize>, Cancelled>> {
        let (recipe, device) = (context.recipe(), context.device);
        let seed = |fold| context.seed_for("fine-tuning", context.part.stream() * FOLDS + fold);
        let seeds: Vec<Seed> = (0..FOLDS).map(seed).collect();
        let &Self {
            knowledge,
            everything,
            whole,
            by_pairs,
            materials,
        } = self;
        // Use the embedding of the method's network.
        let whole = match (method, by_pairs) {
            (TransferMethod::SiameseFull, Some(by_pairs)) => by_pairs,
            _ => whole,
        };
        folds
            .par_iter()
            .map(|fold| {
                let support = whole.part(everything, &fold.train);
                let queries = whole.part(everything, &fold.test);
                let few = FewShots {
                    knowledge,
                    recipe,
                    device,
                    support: &support,
                    materials,
                    shots,
                };
                few.answers(method, &queries, seeds[fold.fold()])
            })
            .collect()
    }
}

/// Returns the numbers of correct answers and of all answers in all folds.
fn count_right(
    folds: &[Fold<'_>],
    answers: Vec<Result<Vec<usize>, Cancelled>>,
) -> Result<(usize, usize), Cancelled> {
    let (mut right, mut decisions) = (0, 0);
    for (fold, answers) in folds.iter().zip(answers) {
        let answers = answers?;
        let pairs = fold.test.labels().zip(&answers);
        right += pairs.filter(|(label, answer)| label == *answer).count();
        decisions += answers.len();
    }
    Ok((right, decisions))
}

/// Returns the folds with `shots` training sweeps of each material; `None` if a material has fewer.
fn with_shots<'a>(folds: &[Fold<'a>], shots: usize) -> Option<Vec<Fold<'a>>> {
    folds.iter().map(|fold| fold.shots(shots).ok()).collect()
}

/// Rotates the folds to the left.
fn rotated<'a>(folds: &[Fold<'a>], by: usize) -> Vec<Fold<'a>> {
    let mut folds = folds.to_vec();
    let by = by % folds.len();
    folds.rotate_left(by);
    folds
}

/// Trains a network on the few sweeps alone and returns its answers to the test sweeps.
fn from_scratch(
    task: &Nshot,
    context: &StudyContext<'_>,
    fold: &Fold<'_>,
) -> Result<Vec<usize>, Cancelled> {
    let batches = fold.train.len().div_ceil(context.recipe().training.batch);
    let mut recipe: NetworkRecipe = context.recipe().clone();
    // The task sets the number of steps itself.
    recipe.training.least_steps = None;
    recipe.training.epochs = (task.scratch_steps / batches).max(recipe.training.epochs);
    if let Some(rate) = task.scratch_learning_rate {
        recipe.training.learning_rate = rate;
    }
    let model = ModelRecipe::Network(recipe);
    let scratch = StudyContext {
        model: &model,
        ..*context
    };
    let seed = context.seed_for(
        "network from scratch",
        context.part.stream() * FOLDS + fold.fold(),
    );
    let classifier = scratch.trained("network from scratch", &fold.train, seed)?;
    let embedding = embedded(&classifier, &fold.test)?;
    Ok(embedding
        .log_probabilities()
        .iter()
        .map(|row| argmax(row))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactnet_data::twin;

    #[test]
    fn new_materials_are_learnt_from_so_many_sweeps_and_no_more() {
        let twin = twin::small(3, 10, 20).unwrap();
        let folds: Vec<Fold<'_>> = (0..FOLDS)
            .map(|fold| Fold::new(&twin, Scheme::default(), Seed(1), 0, fold).unwrap())
            .collect();
        for shots in [1, 3, 8] {
            for (few, whole) in with_shots(&folds, shots).unwrap().iter().zip(&folds) {
                assert_eq!(few.train.sweeps_per_label(), [shots; 3]);
                assert_eq!(few.test.indices(), whole.test.indices());
            }
        }
        assert!(with_shots(&folds, 9).is_none());
    }

    const RECIPE: &str = "name = \"small\"\nnetwork = { maps = [3, 4], hidden = 8 }\n[training]\nepochs = 1\nbatch = 8\n\
                          learning_rate = 0.01\nl2 = 1e-3\nmethod = { kind = \"base\" }\n";

    /// The first coordinate separates the two materials, and their means differ in the second. OL separates them with
    /// the widest margin; the prior of OL-mean, made very strong here, lets weights follow the means only.
    #[test]
    fn ol_has_the_networks_own_penalty_and_ol_mean_the_prior_of_knowledge() {
        let twin = twin::small(6, 10, 60).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let recipe = ModelRecipe::parse("small", RECIPE).unwrap();
        let device = tactnet_models::Compute::Cpu.open().unwrap();
        let context = StudyContext {
            dataset: &twin,
            data: "twin",
            model: &recipe,
            device: &device,
            seed: Seed(1),
            part: crate::Part::Draw(0),
            networks: &crate::networks::FinishedNetworks::of_task(folder.path()),
            on_progress: &|_, _| true,
        };
        let task: Nshot = serde_json::from_str(
            r#"{"shots": 1, "new_materials": 2, "methods": ["ol", "ol-mean"]}"#,
        )
        .unwrap();
        let split = MaterialSplit::draw(&twin, 2, Seed(1), 0).unwrap();
        let mut knowledge = learn(&task, &context, &split).unwrap_or_else(|_| panic!("learns"));
        knowledge.prior.strength = 1e6;
        let embedding = |points: &[[f32; 2]], labels: Vec<usize>| {
            let rows = points
                .iter()
                .flat_map(|[x, y]| [*x, *y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
            let nothing = || tactnet_models::Features::new(1, vec![0.0; points.len()]);
            Embedding {
                labels,
                convolution: nothing(),
                hidden: tactnet_models::Features::new(8, rows.collect()),
                logits: nothing(),
            }
        };
        let support = [[1.0, 0.0], [1.0, 10.0], [-1.0, 0.0], [-1.0, -10.0]];
        let support = embedding(&support, vec![0, 0, 1, 1]);
        let queries = embedding(&[[1.0, -3.0], [-1.0, 3.0]], vec![0, 1]);
        let few = FewShots {
            knowledge: &knowledge,
            recipe: context.recipe(),
            device: &device,
            support: &support,
            materials: 2,
            shots: 2,
        };
        let answers = |method| {
            few.answers(method, &queries, Seed(1))
                .unwrap_or_else(|_| panic!("answers"))
        };
        assert_eq!(answers(TransferMethod::Ol), [0, 1]);
        assert_eq!(answers(TransferMethod::OlMean), [1, 0]);
    }
}
