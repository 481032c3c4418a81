use super::*;
use crate::{Condition, ConditionValues, LabelSet, Samples, Seed, SweepRecord, SweepShape};
use rand::RngExt;

/// Returns 40 sweeps of four materials with these speeds.
fn with_speed(speed: impl Fn(usize, usize) -> f32) -> Dataset {
    let shape = SweepShape {
        steps: 60,
        rows: 1,
        cols: 3,
    };
    let mut rng = Seed(5).rng("values");
    let values = (0..40 * shape.values()).map(|_| rng.random_range(0..40) as f32);
    let samples = Samples::F32(values.collect());
    let records: Vec<SweepRecord> = (0..40).map(|i| SweepRecord::new(i / 10, i % 10)).collect();
    let speeds = (0..40).map(|index| speed(index / 10, index));
    let speeds = ConditionValues {
        condition: Condition::of_name("speed").unwrap(),
        values: speeds.collect(),
    };
    let labels = LabelSet::new(["cork", "denim", "felt", "wood"]).unwrap();
    let dataset = Dataset::new("t", 100.0, shape, labels, records, samples).unwrap();
    dataset.with_conditions(&[speeds]).unwrap()
}

/// Returns a speed that does not depend on the material.
fn random(index: usize) -> f32 {
    Seed(6).rng(("speed", index)).random_range(20.0..40.0)
}

#[test]
fn speeds_that_do_not_follow_the_material_give_no_finding() {
    let bare = check(&with_speed(|_, index| random(index)).without_conditions());
    for dataset in [
        with_speed(|_, index| random(index)),
        // A few speeds, and a single one.
        with_speed(|_, index| (random(index) / 10.0).round()),
        with_speed(|_, _| 30.0),
    ] {
        assert_eq!(check(&dataset), bare);
    }
}

#[test]
fn a_speed_that_tells_the_material_is_an_error_and_one_that_hints_at_it_a_warning() {
    for (severity, dataset) in [
        (Severity::Error, with_speed(|material, _| material as f32)),
        // Ranges that do not overlap.
        (
            Severity::Error,
            with_speed(|material, index| 100.0 * material as f32 + random(index)),
        ),
        // Ranges that overlap in part.
        (
            Severity::Warning,
            with_speed(|material, index| 14.0 * material as f32 + random(index)),
        ),
    ] {
        let found = check(&dataset);
        let leaks: Vec<&Finding> = found
            .iter()
            .filter(|of| of.kind == FindingKind::LeakingColumn)
            .collect();
        assert_eq!(leaks.len(), 1, "{found:?}");
        assert_eq!(leaks[0].severity, severity, "{}", leaks[0].message);
        assert!(leaks[0].message.starts_with("`speed` alone tells"));
    }
}
