//! Enrolment into a committee: its networks get one more row, and its baselines are fitted again with the new sweeps.

use tactnet_data::{Dataset, LabelSet, Samples, SweepRecord, SweepView, TrainSplit};
use tactnet_models::Weights;

use super::fitted::{Committee, joined_weights};
use crate::predict::enroll::refuse_known;
use crate::predict::judged_sweeps::JudgedSweeps;
use crate::{
    Calibration, CalibrationTarget, Classifier, ClassifierConfig, Enrolled, LeftOutMember,
    MemberConfig, ModelConfig, NoveltyScore, PipelineError, TrainEmbeddings, enroll, fit_baseline,
};

/// Sweeps with which a committee was made.
pub struct FormerSweeps<'a> {
    /// Sweeps that the members were fitted to.
    pub train: &'a TrainSplit<'a>,
    /// Sweeps set aside for calibration, with the target rates.
    pub aside: Option<(CalibrationTarget, &'a SweepView<'a>)>,
}

/// Members that have learnt a material, and those that cannot.
#[derive(Default)]
struct Grown {
    members: Vec<MemberConfig>,
    weights: Vec<Weights>,
    left_out: Vec<LeftOutMember>,
}

/// Adds `material` to the committee `classifier`, whose posterior stays the plain mean of its members' posteriors.
///
/// Each network learns the material by [`enroll`]; baselines are fitted again to the training sweeps and the new ones. Members for which
/// the new sweeps are too few are left out. Thresholds are fitted again to the sweeps set aside, all of which are of the other materials.
///
/// # Errors
/// A classifier that is not a committee; a name that is already known; training sweeps of other materials; sweeps of another shape or rate, or
/// of unequal length; a fit that fails.
pub fn enroll_into_committee(
    classifier: &Classifier,
    former: &FormerSweeps<'_>,
    sweeps: &SweepView<'_>,
    material: &str,
) -> Result<Enrolled, PipelineError> {
    let Some(committee) = classifier.committee() else {
        return Err(PipelineError::enroll(
            material,
            "the model is not a committee",
        ));
    };
    refuse_known(classifier, sweeps, material)?;
    if !former
        .train
        .dataset()
        .labels()
        .names()
        .eq(classifier.config().labels.names())
    {
        let reason = "the training sweeps are not of the materials that the committee knows";
        return Err(PipelineError::enroll(material, reason));
    }
    let joined = joined_sweeps(classifier.config(), former.train, sweeps, material)?;
    let all = TrainSplit::all(&joined, classifier.config().seed);
    let grown = grown(committee, former.train, &all, sweeps, material)?;
    if grown.members.is_empty() {
        let reasons: Vec<&str> = grown.left_out.iter().map(|of| of.reason.as_str()).collect();
        let reason = format!("no member can learn it: {}", reasons.join("; "));
        return Err(PipelineError::enroll(material, reason));
    }
    let names = grown.members.iter().map(|member| member.name.as_str());
    let weights = joined_weights(names.zip(&grown.weights));
    let config = ClassifierConfig {
        labels: joined.labels().clone(),
        model: ModelConfig::Committee(grown.members),
        ..classifier.config().clone()
    };
    let mut enrolled = Enrolled {
        config,
        weights,
        known: None,
        calibration: None,
        cost: None,
        prior: None,
        left_out: grown.left_out,
    };
    if let Some((target, aside)) = former.aside {
        let (config, weights) = (enrolled.config.clone(), &enrolled.weights);
        let after = Classifier::new(config, weights, &classifier.device())?;
        let score = NoveltyScore::best_for(&enrolled.config.model);
        let judged = JudgedSweeps::of(&after, score, None, aside)?;
        enrolled.calibration = Some(Calibration::fit(target, score, &judged)?);
        enrolled.cost = Some(enrolled.cost_on(classifier, aside)?);
    }
    Ok(enrolled)
}

/// Teaches every member the material.
///
/// - `all`: training sweeps and new sweeps
fn grown(
    committee: &Committee,
    train: &TrainSplit<'_>,
    all: &TrainSplit<'_>,
    sweeps: &SweepView<'_>,
    material: &str,
) -> Result<Grown, PipelineError> {
    let counts = all.sweeps_per_label();
    let mut grown = Grown::default();
    for (name, member) in committee.named_members() {
        let (model, weights) = match &member.config().model {
            ModelConfig::Network(_) => {
                let known = TrainEmbeddings::of(&member.embed(train)?);
                let own = enroll(member, &known, None, sweeps, material)?;
                (own.config.model, own.weights)
            }
            ModelConfig::Baseline(recipe) => {
                if let Some((_, needed)) = recipe.starved(&counts) {
                    grown.left_out.push(LeftOutMember {
                        name: name.into(),
                        reason: format!("it needs {needed} sweeps of the new material"),
                    });
                    continue;
                }
                let fit = fit_baseline(recipe, all, member.config().seed, |_| {})?;
                (ModelConfig::Baseline(recipe.clone()), fit.weights)
            }
            ModelConfig::Committee(_) => panic!("members are no committees"),
        };
        grown.weights.push(weights);
        grown.members.push(MemberConfig {
            name: name.into(),
            model,
        });
    }
    Ok(grown)
}

/// Returns the training sweeps followed by the new ones, whose material is the last label.
fn joined_sweeps(
    config: &ClassifierConfig,
    train: &TrainSplit<'_>,
    sweeps: &SweepView<'_>,
    material: &str,
) -> Result<Dataset, PipelineError> {
    let own = config.with_own_conditions(sweeps.dataset())?;
    let sweeps = &sweeps.of_same_sweeps(&own);
    config.check_view(sweeps)?;
    let unequal = [train.dataset(), sweeps.dataset()]
        .iter()
        .any(|dataset| dataset.lengths().is_some());
    if unequal || sweeps.shape() != config.shape {
        let reason = "a committee learns materials from sweeps of one length only; train it again with this material";
        return Err(PipelineError::enroll(material, reason));
    }
    let labels = LabelSet::new(config.labels.names().chain([material]))?;
    let new = labels.len() - 1;
    let views: [(&SweepView<'_>, bool); 2] = [(train, false), (sweeps, true)];
    let (mut values, mut records) = (Vec::new(), Vec::new());
    for (view, is_new) in views {
        for position in 0..view.len() {
            values.extend(view.sweep(position));
            let label = match is_new {
                true => new,
                false => view.label(position),
            };
            records.push(SweepRecord::new(label, records.len()));
        }
    }
    let (name, rate) = (train.dataset().name(), config.sample_rate_hz);
    let samples = Samples::F32(values);
    Ok(Dataset::new(
        name,
        rate,
        config.shape,
        labels,
        records,
        samples,
    )?)
}

#[cfg(test)]
mod tests {
    use tactnet_data::twin::{TwinConfig, generate};
    use tactnet_data::{Fold, Scheme, Seed};
    use tactnet_models::Compute;

    use super::*;
    use crate::{ModelRecipe, PredictionMethod, fit_model};

    const NETWORK: &str = "name = \"net\"\nnetwork = { maps = [4], hidden = 8 }\n\
        training = { epochs = 3, batch = 12, learning_rate = 0.01, method = { kind = \"base\" } }";

    fn fitted(text: &str, train: &TrainSplit<'_>) -> Classifier {
        let recipe = ModelRecipe::parse("own", text).unwrap();
        let device = Compute::Cpu.open().unwrap();
        let fitted = fit_model(&recipe, train, Seed(1), &device, |_| true);
        fitted.unwrap().unwrap().classifier
    }

    fn built(enrolled: &Enrolled) -> Classifier {
        let device = Compute::Cpu.open().unwrap();
        Classifier::new(enrolled.config.clone(), &enrolled.weights, &device).unwrap()
    }

    /// The twin's first three materials are known; the fourth is learnt from its first sweeps.
    #[test]
    fn networks_learn_on_their_embeddings_and_baselines_are_fitted_again() {
        let config = TwinConfig {
            materials: 4,
            sweeps: 20,
            steps: 100,
            ..TwinConfig::default()
        };
        let four = generate(&config).unwrap();
        let three = four.of_materials(&[0, 1, 2]).unwrap();
        let fold = Fold::new(&three, Scheme::default(), Seed(1), 0, 0).unwrap();
        let indices = 0..four.len();
        let of_fourth = |index: &usize| four.records()[*index].label == 3;
        let sweeps: Vec<usize> = indices.filter(of_fourth).collect();
        let material = four.labels().name(3).to_string();
        let network = NETWORK.replace('\n', ", ");
        let text = format!("name = \"two\"\nmembers = [{{ {network} }}, \"lda\", \"svm-spectra\"]");
        let committee = fitted(&text, &fold.train);
        let former = FormerSweeps {
            train: &fold.train,
            aside: None,
        };
        let learn = |sweeps: &SweepView<'_>, name: &str| {
            enroll_into_committee(&committee, &former, sweeps, name)
        };
        let new = SweepView::new(&four, sweeps[..5].to_vec());
        let found = learn(&new, &material).unwrap();
        assert!(found.left_out.is_empty(), "{:?}", found.left_out);

        let alone = fitted(NETWORK, &fold.train);
        let known = TrainEmbeddings::of(&alone.embed(&fold.train).unwrap());
        let joined = joined_sweeps(committee.config(), &fold.train, &new, &material).unwrap();
        assert_eq!(joined.sweeps_per_label(), [16, 16, 16, 5]);
        let all = TrainSplit::all(&joined, Seed(1));
        let baseline = |name: &str| {
            let recipe = ModelRecipe::load(name).unwrap();
            let device = Compute::Cpu.open().unwrap();
            let fitted = fit_model(&recipe, &all, Seed(1), &device, |_| true);
            fitted.unwrap().unwrap().classifier
        };
        let members = [
            built(&enroll(&alone, &known, None, &new, &material).unwrap()),
            baseline("lda"),
            baseline("svm-spectra"),
        ];
        let tested = SweepView::new(&four, sweeps[5..].to_vec());
        let rows = |of: &Classifier| {
            let rows = of.log_probabilities(&tested, PredictionMethod::Plain);
            rows.unwrap().concat()
        };
        let expected = members.each_ref().map(rows);
        for (at, log_p) in rows(&built(&found)).iter().enumerate() {
            let mean = expected.iter().map(|of| of[at].exp()).sum::<f64>() / 3.0;
            assert!((log_p.exp() - mean).abs() < 1e-9, "{log_p} {mean}");
        }

        let one = SweepView::new(&four, sweeps[..1].to_vec());
        let found = learn(&one, &material).unwrap();
        let lacking: Vec<&str> = found.left_out.iter().map(|of| of.name.as_str()).collect();
        assert_eq!(lacking, ["svm-spectra"], "it needs two sweeps");
        let known = learn(&one, three.labels().name(0)).unwrap_err();
        assert!(known.to_string().contains("knows a material of this name"));
        let alone = enroll_into_committee(&alone, &former, &new, &material).unwrap_err();
        assert!(alone.to_string().contains("not a committee"), "{alone}");
        let others = four.of_materials(&[1, 2, 3]).unwrap();
        let former = FormerSweeps {
            train: &TrainSplit::all(&others, Seed(1)),
            aside: None,
        };
        let other = enroll_into_committee(&committee, &former, &new, "felt").unwrap_err();
        assert!(
            other.to_string().contains("not of the materials"),
            "{other}"
        );
    }
}
