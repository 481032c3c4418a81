use super::*;

const TAUGHT: &str = r#"
        name = "taught"
        network = { maps = [3, 4], hidden = 8, keep_probability = 0.8 }
        [training]
        epochs = 3
        batch = 8
        learning_rate = 0.005
        method = { kind = "base" }
        teacher = "lda"
    "#;

fn begin(spec: &TrainSpec, run: &Path) -> Session {
    let job = TrainJob::try_from(spec.clone()).unwrap();
    Session::begin(&job, Some(run), program(), |_| Ok(())).unwrap()
}

#[test]
fn a_stopped_distillation_keeps_what_the_teacher_said_and_ends_with_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let untaught = spec(folder.path());
    let recipe = folder.path().join("taught.toml");
    std::fs::write(&recipe, TAUGHT).unwrap();
    let taught = TrainSpec {
        recipe: recipe.display().to_string(),
        ..untaught.clone()
    };
    let [whole, parts, alone] = ["whole", "parts", "alone"].map(|name| folder.path().join(name));
    let session = begin(&taught, &whole);
    session.train(|_| {}, || false).unwrap();
    let expected = session.run().weights().unwrap();

    drop(begin(&taught, &parts));
    let mut lessons = 0;
    for attempt in 0.. {
        assert!(attempt < 100, "it never ends");
        let session = Session::resume(&parts, None, program()).unwrap();
        let count = |event: TrainEvent<'_>| {
            lessons += usize::from(matches!(event, TrainEvent::Teacher { .. }));
        };
        if let TrainOutcome::Finished(_) = session.train(count, || true).unwrap() {
            break;
        }
        // The result itself is written only by a session that is not stopped.
        if session.run().has_final_weights() {
            session.train(|_| {}, || false).unwrap();
            break;
        }
    }
    assert_eq!(lessons, 5, "each part is taught once");
    let parts = RunDir::open(&parts).unwrap();
    assert_eq!(parts.weights().unwrap(), expected);

    let alone = begin(&untaught, &alone);
    alone.train(|_| {}, || false).unwrap();
    assert_ne!(alone.run().weights().unwrap(), expected);
}

#[test]
fn a_teacher_has_no_teacher() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = folder.path().join("taught.toml");
    let text = TAUGHT.replace("\"lda\"", "\"distilled\"");
    std::fs::write(&recipe, text).unwrap();
    let spec = TrainSpec {
        recipe: recipe.display().to_string(),
        ..spec(folder.path())
    };
    let refused = TrainJob::try_from(spec).unwrap_err().to_string();
    assert!(
        refused.contains("expected recipes without a teacher, found `distilled`"),
        "{refused}"
    );
}
