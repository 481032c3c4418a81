use super::*;
use crate::ExperimentRecipe;

#[test]
fn what_is_said_about_stopping_is_no_progress() {
    let epoch = "epoch 2/3: loss 0.5, training 90.0 %, 3 s to go";
    let log = format!("{epoch}\n\n{STOPPING}\nstopped; continue later\n");
    assert_eq!(last_progress_in(&log), epoch);
    assert_eq!(last_progress_in(&format!("\n{STOPPING}\n")), "");
}

fn planned(name: &str, settings: &[&str]) -> (tempfile::TempDir, ExperimentDir) {
    let folder = tempfile::tempdir().unwrap();
    let settings: Vec<String> = settings.iter().map(|s| s.to_string()).collect();
    let recipe = ExperimentRecipe::load(name, &settings).unwrap();
    let dir = ExperimentDir::create(
        &folder.path().join("out"),
        &recipe.with_data().unwrap(),
        "call",
    )
    .unwrap();
    (folder, dir)
}

#[test]
fn every_built_in_experiment_can_be_planned() {
    for (name, tasks) in [
        ("crossval_tactnet2", 30),
        ("thesis_against_fast", 12),
        ("crossval_baselines", 65),
        ("leave_block_out", 30),
        ("sequence_length", 60),
        ("adversarial", 21),
        ("hyperparameters", 23),
        ("nshot", 100),
        ("sample_efficiency", 100),
        ("differentiate", 10),
        ("unknown", 20),
        ("sequential", 10),
        ("enrolment", 20),
        ("feature_maps", 2),
    ] {
        let (_folder, dir) = planned(name, &[]);
        assert_eq!(dir.plan.tasks.len(), tasks, "{name}");
        assert!(
            dir.plan
                .tasks
                .iter()
                .all(|task| dir.state(task) == TaskState::Open)
        );
    }
}

#[test]
fn a_search_draws_the_same_recipes_again_and_judges_them_inside() {
    let settings = ["search.trials=3", "seed=5"];
    let (_first, first) = planned("hyperparameters", &settings);
    let (_second, second) = planned("hyperparameters", &settings);
    let text = |dir: &ExperimentDir, trial: usize| {
        fs::read_to_string(dir.path().join(format!("recipes/trial{trial:02}.toml"))).unwrap()
    };
    assert_eq!(text(&first, 2), text(&second, 2));
    assert_ne!(text(&first, 1), text(&first, 2));
    for task in &first.plan.tasks {
        let Job::Train(spec) = &task.job else {
            panic!("a training");
        };
        assert_eq!(spec.inner, Some(0), "{spec:?}");
    }
}

#[test]
fn what_was_interrupted_early_starts_over_and_later_is_resumed() {
    let (_folder, dir) = planned("crossval_baselines", &["folds=1"]);
    let task = &dir.plan.tasks[2];
    fs::create_dir(dir.task_dir(task)).unwrap();
    assert_eq!(dir.state(task), TaskState::Interrupted);
    assert_eq!(
        dir.begin(task).unwrap(),
        Start::Begin(Box::new(task.job.clone()))
    );
    assert_eq!(dir.state(task), TaskState::Open, "the remains are gone");
    fs::create_dir(dir.task_dir(task)).unwrap();
    fs::write(dir.task_dir(task).join("config.json"), "{}").unwrap();
    assert_eq!(dir.begin(task).unwrap(), Start::Resume);
}

#[test]
fn many_may_plan_the_same_at_once_and_strangers_are_refused() {
    let recipe = ExperimentRecipe::load("crossval_baselines", &["folds=1".into()]).unwrap();
    let plan = |out: &Path| ExperimentDir::create(out, &recipe.with_data().unwrap(), "call");
    for _ in 0..50 {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        std::thread::scope(|scope| {
            let planners: Vec<_> = (0..4).map(|_| scope.spawn(|| plan(&out))).collect();
            for planner in planners {
                planner.join().unwrap().unwrap();
            }
        });
    }
    let folder = tempfile::tempdir().unwrap();
    // Files that a killed planner left behind.
    for name in [LOCK, ".writing-killed"] {
        fs::write(folder.path().join(name), "").unwrap();
    }
    plan(folder.path()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("thesis.tex"), "").unwrap();
    assert!(plan(folder.path()).is_err());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "untouched");
}

#[test]
fn every_task_computes_on_the_device_of_the_recipe() {
    for name in ["crossval_baselines", "nshot"] {
        let (_folder, mut dir) = planned(name, &["device=vulkan"]);
        for task in &mut dir.plan.tasks {
            assert_eq!(
                task.job.spec_mut().device,
                tactnet_models::Compute::Vulkan,
                "{}",
                task.id
            );
        }
    }
}

#[test]
fn a_plan_of_another_version_is_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let plan = r#"{"schema_version": 3, "recipe": {"study": null}, "tasks": []}"#;
    fs::write(folder.path().join("experiment.json"), plan).unwrap();
    let refused = ExperimentDir::open(folder.path()).unwrap_err().to_string();
    assert!(
        refused.contains("schema version 3, this one has 4"),
        "{refused}"
    );
    assert!(!refused.contains('\n'), "{refused}");
}

#[test]
fn finished_networks_of_an_interrupted_question_stay() {
    let (_folder, dir) = planned("unknown", &["splits=1"]);
    let task = &dir.plan.tasks[0];
    let networks = dir.task_dir(task).join("networks");
    fs::create_dir_all(&networks).unwrap();
    assert_eq!(
        dir.begin(task).unwrap(),
        Start::Begin(Box::new(task.job.clone()))
    );
    assert!(networks.exists());
}

#[test]
fn names_that_collide_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let settings = ["models=[\"fast\", \"fast\"]".to_string()];
    let recipe = ExperimentRecipe::load("crossval_baselines", &settings).unwrap();
    let refused = ExperimentDir::create(folder.path(), &recipe.with_data().unwrap(), "call")
        .unwrap_err()
        .to_string();
    assert!(refused.contains("two tasks would be called"), "{refused}");
}
