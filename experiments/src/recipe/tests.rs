use super::*;

#[test]
fn built_in_experiments_parse_and_say_what_to_expect() {
    for (recipe, (name, _)) in ExperimentRecipe::built_in().zip(BUILT_IN) {
        assert_eq!(recipe.name, name);
        assert!(
            recipe.expects.len() > 20 && !recipe.takes.is_empty(),
            "{name}"
        );
    }
}

#[test]
fn what_is_expected_of_other_models_or_data_is_not_said() {
    let expected = |settings: &[&str], beside_tactmat: bool| {
        let settings: Vec<String> = settings.iter().map(|text| text.to_string()).collect();
        let recipe = ExperimentRecipe::load("crossval_baselines", &settings).unwrap();
        recipe.expected_of_run(beside_tactmat).to_string()
    };
    assert!(expected(&[], true).contains("TactNet-II stands far above"));
    assert!(expected(&["folds=2", "repeats=2", "probes=[]"], true).contains("far above"));
    // The text refers to seven models on the twin.
    assert_eq!(expected(&["models=[\"knn-l\", \"fast\"]"], true), "");
    assert_eq!(expected(&["levels=removed"], true), "");
    assert_eq!(expected(&["split=leave-block-out"], true), "");
    assert_eq!(expected(&["data=own.h5"], false), "");
    assert!(expected(&["data=tactmat.h5"], true).contains("far above"));
    // The text of a user's own recipe is always returned.
    assert_eq!(expected(&["expects=more", "models=knn-l"], false), "more");
}

#[test]
fn any_field_can_be_set() {
    let settings = [
        "data=a b.h5",
        "runs=2",
        "models=[\"minirocket\"]",
        "levels=removed",
        "epochs = 1",
    ]
    .map(String::from);
    let recipe = ExperimentRecipe::load("crossval_baselines", &settings).unwrap();
    assert_eq!(recipe.data, ["a b.h5"]);
    let Question::Crossval(question) = &recipe.question else {
        panic!("a cross-validation");
    };
    assert_eq!((question.repeats, recipe.epochs), (2, Some(1)));
    assert_eq!(recipe.models, ["minirocket"]);
    assert_eq!(recipe.levels, [MeanRemoval::PerSweep]);
}

#[test]
fn fields_of_a_question_may_be_set_as_before_questions_had_fields() {
    let load = |name: &str, settings: &[&str]| {
        let settings: Vec<String> = settings.iter().map(|text| text.to_string()).collect();
        ExperimentRecipe::load(name, &settings).unwrap().question
    };
    let Question::Nshot(nshot) = load(
        "nshot",
        &[
            "splits=20",
            "shots=[1]",
            "methods=ol-mean",
            "study={kind=\"nshot\", new_materials=3}",
        ],
    ) else {
        panic!("nshot");
    };
    assert_eq!((nshot.splits, nshot.new_materials), (20, 3));
    assert_eq!((nshot.shots, nshot.methods.len()), (vec![1], 1));
    let Question::Differentiate(found) = load("differentiate", &["runs=1", "shots=[1, 2]"]) else {
        panic!("differentiate");
    };
    assert_eq!((found.repeats, found.sweeps), (1, vec![1, 2]));
    let Question::Nshot(nshot) = load("nshot", &["question.splits=7"]) else {
        panic!("nshot");
    };
    assert_eq!(nshot.splits, 7);
    // A recipe in the former layout.
    let text = "name='a'\ntitle='a'\nexpects='a'\ntakes='a'\ndata='twin'\nmodels='fast'\n\
                splits=2\nshots=[5]\nstudy={kind='enrolment', new_materials=4}\n";
    let recipe = ExperimentRecipe::parse("old.toml", text, &[]).unwrap();
    let Question::Enrolment(enrolment) = recipe.question else {
        panic!("enrolment");
    };
    assert_eq!((enrolment.splits, enrolment.new_materials), (2, 4));
    let text = "name='a'\ntitle='a'\nexpects='a'\ntakes='a'\ndata='twin'\nmodels='fast'\nfolds=2\nruns=2\n";
    let recipe = ExperimentRecipe::parse("old.toml", text, &[]).unwrap();
    let Question::Crossval(found) = recipe.question else {
        panic!("a cross-validation");
    };
    assert_eq!((found.folds, found.repeats), (2, 2));
}

#[test]
fn a_mistyped_field_or_value_is_answered_with_the_one_that_was_meant() {
    for (setting, meant) in [
        ("splts=3", "splits"),
        ("sed=3", "seed"),
        ("modls=fast", "models"),
        ("new_material=3", "new_materials"),
        ("methods=ol-men", "ol-mean"),
        ("question.shot=1", "shots"),
        ("models=thsis", "thesis"),
    ] {
        let refused = ExperimentRecipe::load("nshot", &[setting.into()])
            .and_then(|recipe| crate::Plan::new(&recipe.with_data()?, "").map(drop))
            .unwrap_err()
            .to_string();
        let proposed = format!("; did you mean `{meant}`?");
        assert!(refused.ends_with(&proposed), "{setting}: {refused}");
    }
    let refused = ExperimentRecipe::load("nshot", &["quux=1".into()]).unwrap_err();
    assert!(!refused.to_string().contains("did you mean"), "{refused}");
}

#[test]
fn the_fields_of_a_recipe_are_those_that_serde_knows() {
    let text = "nonsense = 1";
    let refused = toml::from_str::<ExperimentRecipe>(text).unwrap_err();
    let (_, expected) = refused.message().split_once("expected one of ").unwrap();
    let known: Vec<&str> = expected.split('`').skip(1).step_by(2).collect();
    assert_eq!(known, FIELDS);
}

#[test]
fn mistakes_are_named_in_one_line() {
    for (setting, named) in [
        ("fold=3", "fold"),
        ("folds=0", "folds"),
        ("folds=many", "folds"),
        ("data=[]", "data"),
        ("name.x=1", "name"),
        ("probes=luck", "luck"),
        ("seed", "FIELD=VALUE"),
        ("folds=6", "expected 1 to 5"),
        ("runs=3", "expected 1 to 2"),
        ("models=[\"fast\"", "setting `models"),
        ("search.trials=3", "this experiment has none"),
        (
            "splits=3",
            "unknown field `splits`, expected one of `split`, `folds`",
        ),
        (
            "methods=nn",
            "unknown field `methods`, expected one of `split`, `folds`",
        ),
        ("shots=0", "`shots`: expected numbers above 0"),
        ("device=gpu", "gpu"),
        (
            "search={base=\"fast\",trials=1,space={\"training.batch\"={kind=\"choice\",values=[]}}}",
            "training.batch",
        ),
    ] {
        let refused = ExperimentRecipe::load("crossval_tactnet2", &[setting.into()]).unwrap_err();
        let message = refused.to_string();
        assert!(message.contains(named), "{setting}: {message}");
        assert!(!message.contains('\n'), "{message}");
    }
}

#[test]
fn mistakes_in_the_settings_of_a_question_are_named() {
    for (study, setting, named) in [
        (
            "nshot",
            "folds=3",
            "unknown field `folds`, expected one of `splits`",
        ),
        ("nshot", "groups=3", "unknown field `groups`"),
        ("nshot", "shots=[]", "`shots`: expected one or more"),
        ("nshot", "search.trials=3", "`search`"),
        (
            "unknown",
            "runs=2",
            "unknown field `repeats`, expected one of `splits`",
        ),
        ("sequential", "splits=11", "expected 1 to 10"),
        ("differentiate", "shots=0", "above 0"),
        (
            "feature_maps",
            "shots=1",
            "unknown field `shots`, expected `splits` or `new_materials`",
        ),
    ] {
        let refused = ExperimentRecipe::load(study, &[setting.into()]).unwrap_err();
        assert!(refused.to_string().contains(named), "{refused}");
    }
    let unknown = ExperimentRecipe::load("crossvall", &[])
        .unwrap_err()
        .to_string();
    assert!(unknown.contains("crossval_tactnet2"), "{unknown}");
    assert!(unknown.contains("did you mean `crossval_"), "{unknown}");
}
