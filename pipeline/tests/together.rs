//! Run directories whose networks are trained at once on a GPU.
#![cfg(feature = "vulkan")]
#![allow(clippy::unwrap_used)]

use std::cell::Cell;
use std::path::{Path, PathBuf};

use tactnet_data::format::Format;
use tactnet_data::twin;
use tactnet_models::Compute;

use tactnet_pipeline::{
    Ended, Program, Provenance, RunDir, Session, TrainEvent, TrainJob, TrainOutcome, TrainSpec,
    train_together,
};

const RECIPE: &str = r#"
    name = "small"
    network = { maps = [4, 6], hidden = 8 }
    [training]
    epochs = 3
    batch = 8
    learning_rate = 0.005
    method = { kind = "adversarial", alpha = 0.5, epsilon = 2.0 }
"#;

fn program() -> Program {
    Program {
        provenance: Provenance::of_this_process("0", "test"),
        command: |spec| format!("train {}", spec.data),
    }
}

/// Begins runs of three folds of different sizes in separate folders below `into`.
fn begin(folder: &Path, into: &str, device: Compute) -> Vec<Session> {
    let [data, recipe] = ["twin.h5", "small.toml"].map(|name| folder.join(name));
    if !data.exists() {
        let twin = twin::small(3, 7, 60).unwrap();
        Format::TactMat.write(&data, &twin).unwrap();
        std::fs::write(&recipe, RECIPE).unwrap();
    }
    let runs = runs(folder, into).into_iter().zip([0, 2, 4]);
    runs.map(|(run, fold)| {
        let spec = TrainSpec {
            data: data.display().to_string(),
            recipe: recipe.display().to_string(),
            fold: Some(fold),
            device,
            ..TrainSpec::default()
        };
        let job = TrainJob::try_from(spec).unwrap();
        std::fs::create_dir_all(run.parent().unwrap()).unwrap();
        Session::begin(&job, Some(&run), program(), |_| Ok(())).unwrap()
    })
    .collect()
}

fn runs(folder: &Path, into: &str) -> Vec<PathBuf> {
    let run = |fold: usize| folder.join(into).join(format!("fold{fold}"));
    (0..3).map(run).collect()
}

fn weights(folder: &Path, into: &str) -> Vec<tactnet_models::Weights> {
    let runs = runs(folder, into).into_iter();
    runs.map(|run| RunDir::open(&run).unwrap().weights().unwrap())
        .collect()
}

fn finished(ended: &[Ended]) -> usize {
    let finished = |ended: &&Ended| matches!(ended, Ok(TrainOutcome::Finished(_)));
    ended.iter().filter(finished).count()
}

#[test]
fn folds_train_together_and_an_interrupted_stack_ends_with_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let sessions = begin(folder, "whole", Compute::Vulkan);
    let batches = [(); 3].map(|()| Cell::new(0));
    let count = |index: usize, event: TrainEvent<'_>| {
        let is_batch = matches!(event, TrainEvent::Batch { .. });
        batches[index].set(batches[index].get() + usize::from(is_batch));
    };
    let ended = train_together(&sessions, None, count, || false);
    assert_eq!(finished(&ended), 3, "{ended:?}");
    let mut counted = batches.map(|count| count.get());
    counted.sort_unstable();
    assert_eq!(counted, [6, 9, 9], "three epochs of two or three batches");
    for (session, batches) in sessions.iter().zip(counted) {
        assert!(batches > 0);
        let course = session.run().metrics_before(usize::MAX).unwrap();
        assert_eq!(course.len(), 3);
        assert!(course.iter().all(|epoch| epoch.train_loss.is_finite()));
        assert!(
            course
                .iter()
                .all(|epoch| epoch.adversarial_accuracy.is_some())
        );
    }
    drop(sessions);

    drop(begin(folder, "parts", Compute::Vulkan));
    let mut rounds = 0;
    loop {
        let sessions: Vec<Session> = runs(folder, "parts")
            .iter()
            .map(|run| Session::resume(run, None, program()).unwrap())
            .collect();
        let steps = Cell::new(0);
        let count = |_: usize, event: TrainEvent<'_>| {
            let is_batch = matches!(event, TrainEvent::Batch { .. });
            steps.set(steps.get() + usize::from(is_batch));
        };
        rounds += 1;
        // After about two steps of all networks.
        let ended = train_together(&sessions, Some(3), count, || steps.get() >= 6);
        if finished(&ended) == 3 {
            break;
        }
        assert!(rounds < 12, "{ended:?}");
    }
    assert!(rounds > 2, "{rounds}");
    assert!(weights(folder, "whole") == weights(folder, "parts"));
}

#[test]
fn on_a_processor_they_follow_each_other_and_what_has_ended_stays() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let sessions = begin(folder, "alone", Compute::Cpu);
    let outcome = sessions[0].train(|_| {}, || false).unwrap();
    assert!(matches!(outcome, TrainOutcome::Finished(_)), "{outcome:?}");
    let first = sessions[0].run().weights().unwrap();
    let told = Cell::new(false);
    let note = |index: usize, event: TrainEvent<'_>| {
        if matches!(event, TrainEvent::AlreadyEnded) {
            assert_eq!(index, 0);
            told.set(true);
        }
    };
    let ended = train_together(&sessions, None, note, || false);
    assert_eq!(finished(&ended), 3, "{ended:?}");
    assert!(told.get());
    assert!(weights(folder, "alone")[0] == first);
}
