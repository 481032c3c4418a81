use super::axes::assumed_patch;
use super::*;
use crate::{LabelSet, Remedy, Samples, SweepRecord, SweepShape, group_findings};

const SHAPE: SweepShape = SweepShape {
    steps: 200,
    rows: 2,
    cols: 2,
};

/// Returns the values of six different sweeps of three materials; every taxel moves between 0 and 40.
fn values() -> Vec<f32> {
    (0..6 * SHAPE.values())
        .map(|i| ((i / 4 * (i / SHAPE.values() + 3) + i % 4 * 5) % 41) as f32)
        .collect()
}

fn dataset_of(values: Vec<f32>, labels: &[usize]) -> Dataset {
    let records = labels
        .iter()
        .enumerate()
        .map(|(i, &label)| SweepRecord::new(label, i % 2))
        .collect();
    let labels = LabelSet::new(["cork", "denim", "wood"]).unwrap();
    Dataset::new("t", 100.0, SHAPE, labels, records, Samples::F32(values)).unwrap()
}

/// Returns all findings except the one that all such data sets have: two sweeps per material are too few for five folds.
fn check_values(values: Vec<f32>) -> Vec<Finding> {
    beyond_few_sweeps(&dataset_of(values, &[0, 0, 1, 1, 2, 2]))
}

fn beyond_few_sweeps(dataset: &Dataset) -> Vec<Finding> {
    let mut findings = check(dataset);
    let kind = (Severity::Warning, FindingKind::FewSweeps);
    let few = findings
        .iter()
        .position(|found| (found.severity, found.kind) == kind);
    let few = findings.remove(few.unwrap());
    let expected = "3 of 3 materials have fewer than 5 sweeps: cross-validation uses 2 folds";
    assert!(few.message.starts_with(expected), "{}", few.message);
    findings
}

fn at(sweep: usize, step: usize, taxel: usize) -> usize {
    sweep * SHAPE.values() + step * 4 + taxel
}

fn only(findings: &[Finding]) -> &Finding {
    assert_eq!(findings.len(), 1, "{findings:#?}");
    &findings[0]
}

#[test]
fn lively_sweeps_give_no_finding() {
    assert_eq!(check_values(values()), []);
}

#[test]
fn a_nan_is_found_with_its_place() {
    let mut values = values();
    values[at(3, 7, 2)] = f32::NAN;
    values[at(3, 9, 1)] = f32::INFINITY;
    let findings = check_values(values);
    let found = only(&findings);
    assert_eq!(
        (found.severity, found.kind),
        (Severity::Error, FindingKind::NotFinite)
    );
    assert_eq!(
        found.at,
        Place {
            sweep: Some(3),
            taxel: Some(2),
            step: Some(7),
            ..Place::default()
        }
    );
    let message = "`denim` sweep 1 (`X[3]`): 2 not finite, the first at step 7, taxel (1, 0)";
    assert_eq!(found.message, message);
}

#[test]
fn a_dead_taxel_is_found_once_for_the_data_set() {
    let mut values = values();
    values.iter_mut().skip(3).step_by(4).for_each(|x| *x = 0.0);
    let findings = check_values(values);
    let found = only(&findings);
    assert_eq!(
        (found.severity, found.kind),
        (Severity::Warning, FindingKind::DeadTaxel)
    );
    assert_eq!(
        found.message,
        "taxel (1, 1) is 0 at every step of every sweep"
    );
}

#[test]
fn a_stuck_taxel_is_a_warning_and_one_without_contact_a_note() {
    let mut values = values();
    for step in 0..SHAPE.steps {
        values[at(0, step, 1)] = 12.0;
        values[at(2, step, 0)] = 0.0;
    }
    let findings = check_values(values);
    let severities: Vec<_> = findings
        .iter()
        .map(|f| (f.severity, f.kind, f.at.sweep))
        .collect();
    let kind = FindingKind::ConstantTaxel;
    assert_eq!(
        severities,
        [
            (Severity::Warning, kind, Some(0)),
            (Severity::Note, kind, Some(2))
        ]
    );
}

#[test]
fn a_column_of_the_class_is_an_error_and_a_setting_of_the_sweep_is_none() {
    type OfSweep = fn(usize) -> f32;
    let with_column = |value: OfSweep| {
        let mut values = values();
        for sweep in 0..6 {
            for step in 0..SHAPE.steps {
                values[at(sweep, step, 2)] = value(sweep);
            }
        }
        check_values(values)
    };
    let classes: [OfSweep; 2] = [|sweep| (sweep / 2) as f32, |sweep| (sweep / 4) as f32];
    for class in classes {
        let findings = with_column(class);
        let found = only(&findings);
        let kind = (Severity::Error, FindingKind::LeakingColumn);
        assert_eq!((found.severity, found.kind), kind);
        assert_eq!(found.at.taxel, Some(2));
    }
    let message = &with_column(classes[0])[0].message;
    let expected = "taxel (1, 0) is constant in every sweep and follows the material (0 for `cork`, 1 for `denim`) in 6 of 6 sweeps: ";
    assert!(message.starts_with(expected), "{message}");
    let is_leak = |finding: &Finding| finding.kind == FindingKind::LeakingColumn;
    // A speed that differs between the sweeps of a material, a number of the sweep, a dead taxel.
    let others: [OfSweep; 3] = [|sweep| (sweep % 2) as f32, |sweep| sweep as f32, |_| 7.0];
    for value in others {
        assert!(!with_column(value).iter().any(is_leak));
    }
}

#[test]
fn a_constant_sweep_is_an_error() {
    let mut values = values();
    values[at(4, 0, 0)..at(5, 0, 0)].fill(5.0);
    let findings = check_values(values);
    assert_eq!(only(&findings).kind, FindingKind::ConstantSweep);
    assert_eq!(only(&findings).at.sweep, Some(4));
}

#[test]
fn identical_sweeps_are_named_both() {
    let mut values = values();
    values.copy_within(at(1, 0, 0)..at(2, 0, 0), at(4, 0, 0));
    let findings = check_values(values);
    let found = only(&findings);
    assert_eq!(found.kind, FindingKind::IdenticalSweeps);
    assert_eq!(
        found.message,
        "`wood` sweep 0 (`X[4]`) has the same values as `cork` sweep 1 (`X[1]`)"
    );
}

#[test]
fn clipped_values_are_saturation_and_a_single_peak_is_not() {
    let mut values = values();
    values[at(1, 3, 0)] = 60.0;
    assert_eq!(check_values(values.clone()), []);
    for step in 50..90 {
        values[at(1, step, 0)] = 60.0;
    }
    let findings = check_values(values);
    let found = only(&findings);
    assert_eq!(
        (found.kind, found.at.sweep),
        (FindingKind::Saturation, Some(1))
    );
    assert!(found.message.contains("5.1 %"), "{}", found.message);
}

#[test]
fn the_top_of_the_element_type_is_a_ceiling() {
    let mut values: Vec<u8> = values().iter().map(|&x| x as u8).collect();
    for step in 50..60 {
        values[at(1, step, 0)] = 255;
    }
    let plain = dataset_of(vec![0.0; 6 * SHAPE.values()], &[0, 0, 1, 1, 2, 2]);
    let dataset = Dataset::new(
        "t",
        100.0,
        SHAPE,
        plain.labels().clone(),
        plain.records().to_vec(),
        Samples::U8(values),
    );
    let findings = beyond_few_sweeps(&dataset.unwrap());
    assert_eq!(only(&findings).kind, FindingKind::Saturation);
}

#[test]
fn outliers_and_odd_negatives_are_out_of_range() {
    let mut loud = values();
    loud[at(5, 0, 0)..].iter_mut().for_each(|x| *x *= 30.0);
    let findings = check_values(loud);
    assert_eq!(only(&findings).at.sweep, Some(5));
    assert_eq!(only(&findings).kind, FindingKind::OutOfRange);

    let mut single = values();
    single[at(5, 3, 0)] = 1e4;
    let findings = check_values(single);
    let place = Place {
        sweep: Some(5),
        taxel: Some(0),
        step: Some(3),
        ..Place::default()
    };
    assert_eq!(only(&findings).at, place);
    assert_eq!(only(&findings).kind, FindingKind::Spike);

    let signed = values().iter().map(|x| x - 20.0).collect();
    assert_eq!(check_values(signed), [], "a signed signal is no fault");
}

#[test]
fn few_and_unbalanced_sweeps_are_found() {
    let findings = check(&dataset_of(values(), &[0, 0, 0, 1, 1, 2]));
    let found: Vec<_> = findings.iter().map(|f| (f.severity, f.kind)).collect();
    let expected = [
        (Severity::Error, FindingKind::FewSweeps),
        (Severity::Warning, FindingKind::FewSweeps),
        (Severity::Warning, FindingKind::UnbalancedMaterials),
    ];
    assert_eq!(found, expected);
    assert!(
        findings[2]
            .message
            .contains("from 1 (`wood`) to 3 (`cork`) sweeps")
    );
    // Folds need two sweeps of each material.
    assert_eq!(findings[1].remedy, None);
    assert!(!findings[1].message.contains("cross-validation"));
}

#[test]
fn findings_of_one_kind_are_one_group() {
    let mut values = values();
    for sweep in 0..6 {
        values[at(sweep, 0, 0)] = f32::NAN;
    }
    let groups = group_findings(&check_values(values));
    assert_eq!(groups.len(), 1);
    assert_eq!(groups[0].findings.len(), 6);
    let first = &groups[0].findings[0].message;
    assert!(first.starts_with("`cork` sweep 0 (`X[0]`): 1 "), "{first}");
}

#[test]
fn names_that_tell_nothing_apart_are_found() {
    let named = |names: [&str; 3], labels: &[usize]| {
        let plain = dataset_of(values(), labels);
        let labels = LabelSet::new(names).unwrap();
        let records = plain.records().to_vec();
        let dataset = Dataset::new("t", 100.0, SHAPE, labels, records, plain.samples().clone());
        let found = check(&dataset.unwrap()).into_iter();
        let found = found.filter(|found| found.kind != FindingKind::FewSweeps);
        found
            .map(|found| (found.kind, found.message))
            .collect::<Vec<_>>()
    };
    let pairs = &[0, 0, 1, 1, 2, 2];
    assert_eq!(named(["cork", "denim", "wood"], pairs), []);
    let found = named(["oak wood", "denim", "Oakwood"], pairs);
    assert_eq!(found[0].0, FindingKind::AlikeNames);
    assert!(
        found[0].1.contains("`oak wood` and `Oakwood`"),
        "{}",
        found[0].1
    );
    let found = named(["cork", "C\u{41e}RK", "wo\u{200b}od"], pairs);
    assert_eq!(found.len(), 1, "{found:?}");
    let hidden = "look alike and are different materials: character 2 is U+006F and U+041E; ";
    assert!(found[0].1.contains(hidden), "{}", found[0].1);
    let found = named(["wood", "denim", "wo\u{200b}od"], pairs);
    let hidden = "character 3 of one of them is U+200B, which is invisible";
    assert!(found[0].1.contains(hidden), "{}", found[0].1);
    let cork = dataset_of(values(), pairs).of_materials(&[0]).unwrap();
    let kinds: Vec<_> = check(&cork).iter().map(|found| found.kind).collect();
    assert!(kinds.contains(&FindingKind::SingleMaterial), "{kinds:?}");
}

#[test]
fn a_clock_among_the_taxels_and_padded_sweeps_are_found() {
    let mut clocked = values();
    for sweep in 0..6 {
        for step in 0..SHAPE.steps {
            clocked[at(sweep, step, 3)] = step as f32 * 0.5;
        }
    }
    let found = check_values(clocked);
    assert_eq!(
        (only(&found).kind, only(&found).at.taxel),
        (FindingKind::ClockTaxel, Some(3))
    );

    let mut padded = values();
    padded[at(2, 150, 0)..at(3, 0, 0)].fill(f32::NAN);
    let found = check_values(padded);
    let message = &only(&found).message;
    assert!(
        message.contains("(`X[2]`)") && message.ends_with("padded?"),
        "{message}"
    );
    assert_eq!(only(&found).remedy, Some(Remedy::KeepSteps { steps: 150 }));
}

#[test]
fn a_row_of_assumed_arrangement_may_be_a_grid() {
    let hint = |taxels: usize| {
        let shape = SweepShape {
            steps: 100,
            rows: 1,
            cols: taxels,
        };
        let values = (0..6 * shape.values()).map(|at| (at * 7919 % 251) as f32);
        let plain = dataset_of(values_of_zero(), &[0, 0, 1, 1, 2, 2]);
        let (labels, records) = (plain.labels().clone(), plain.records().to_vec());
        let samples = Samples::F32(values.collect());
        let row = Dataset::new("t", 100.0, shape, labels, records, samples).unwrap();
        assert!(assumed_patch(&row).is_none(), "declared");
        let row = row.with_assumed_patch().first_steps(50).unwrap();
        let hint = assumed_patch(&row).and_then(|found| found.remedy);
        if hint.is_some() {
            let named = row.with_patch(1, taxels).unwrap();
            assert!(assumed_patch(&named).is_none(), "a row that was asked for");
        }
        hint
    };
    for (taxels, rows, cols) in [(36, 6, 6), (12, 3, 4), (4, 2, 2), (60, 6, 10)] {
        assert_eq!(hint(taxels), Some(Remedy::NameShape { rows, cols }));
    }
    for taxels in [1, 2, 3, 13] {
        assert_eq!(hint(taxels), None, "{taxels}");
    }
}

fn values_of_zero() -> Vec<f32> {
    vec![0.0; 6 * SHAPE.values()]
}
