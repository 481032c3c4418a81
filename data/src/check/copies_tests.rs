//! Tests of the checks for sweeps that share frames or are copies of another.

use super::*;
use crate::{LabelSet, Remedy, Samples, Scheme, SweepRecord, SweepShape};

const TAXELS: usize = 6;
const STEPS: usize = 200;
const SWEEPS: usize = 20;

/// Frames of noise of standard deviation `noise` around 500 with a slow wave: `[frames][TAXELS]`.
fn recording(seed: u64, frames: usize, noise: f32) -> Vec<f32> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1_u64 << 24) as f32 - 0.5
    };
    (0..frames * TAXELS)
        .map(|i| 500.0 + noise * (3.5 * uniform() + 3.0 * (i as f32 * 0.01).sin()))
        .collect()
}

/// Blocks of the sweeps.
#[derive(Clone, Copy)]
enum Blocks {
    Unknown,
    /// All sweeps of a material are one block.
    OfMaterial,
    /// As `OfMaterial`; the sweeps from `from` on are test sweeps.
    Tested {
        from: usize,
    },
}

/// Returns the findings about shared frames and copies.
fn check_sweeps(values: Vec<f32>, taxels: usize, blocks: Blocks) -> Vec<Finding> {
    check_samples(Samples::F32(values), taxels, blocks)
}

fn check_samples(samples: Samples, taxels: usize, blocks: Blocks) -> Vec<Finding> {
    let mut findings = check(&dataset_of(samples, taxels, blocks));
    let kinds = [FindingKind::Overlap, FindingKind::NearDuplicate];
    findings.retain(|finding| kinds.contains(&finding.kind));
    findings
}

fn dataset_of(samples: Samples, taxels: usize, blocks: Blocks) -> Dataset {
    let shape = SweepShape {
        steps: samples.len() / SWEEPS / taxels,
        rows: 1,
        cols: taxels,
    };
    let record = |sweep: usize| SweepRecord {
        label: 2 * sweep / SWEEPS,
        sweep: sweep % (SWEEPS / 2),
        block: match blocks {
            Blocks::Unknown => None,
            Blocks::OfMaterial | Blocks::Tested { .. } => Some((2 * sweep / SWEEPS) as u32),
        },
        test: match blocks {
            Blocks::Tested { from } => Some(sweep >= from),
            _ => None,
        },
    };
    let records = (0..SWEEPS).map(record).collect();
    let labels = LabelSet::new(["cork", "denim"]).unwrap();
    Dataset::new("t", 100.0, shape, labels, records, samples).unwrap()
}

/// Returns windows that begin `hop` frames after the one before; each material has a recording.
fn windows(hop: usize, noise: f32) -> Vec<f32> {
    let window = |sweep: usize| {
        let seed = 1 + 2 * sweep / SWEEPS;
        let long = recording(seed as u64, STEPS + SWEEPS / 2 * hop, noise);
        let start = sweep % (SWEEPS / 2) * hop * TAXELS;
        long[start..start + STEPS * TAXELS].to_vec()
    };
    (0..SWEEPS).flat_map(window).collect()
}

#[test]
fn windows_that_share_nine_tenths_of_their_frames_are_errors() {
    let findings = check_sweeps(windows(20, 10.0), TAXELS, Blocks::Unknown);
    let sweeps: Vec<Option<usize>> = findings.iter().map(|found| found.at.sweep).collect();
    let expected: Vec<Option<usize>> = (1..10).chain(11..20).map(Some).collect();
    assert_eq!(sweeps, expected, "all but the first of each recording");
    for found in &findings {
        let kind = (Severity::Error, FindingKind::Overlap);
        assert_eq!((found.severity, found.kind), kind);
        assert_eq!(found.remedy, None);
    }
    let message = "`cork` sweep 0 (`X[0]`) and `cork` sweep 1 (`X[1]`) share 180 of 200 frames, from steps 20 and 0 on";
    assert_eq!(findings[0].message, message);
    assert_eq!(findings[0].at.material.as_deref(), Some("cork"));
    let end = "from steps 20 and 0 on; the latter shares frames with 8 more sweeps";
    assert!(
        findings[8].message.ends_with(end),
        "{}",
        findings[8].message
    );
}

#[test]
fn windows_of_one_block_are_warnings_with_a_cure() {
    let findings = check_sweeps(windows(100, 10.0), TAXELS, Blocks::OfMaterial);
    assert_eq!(findings.len(), 18);
    for found in &findings {
        let kind = (Severity::Warning, FindingKind::Overlap);
        assert_eq!((found.severity, found.kind), kind);
        assert_eq!(found.remedy, Some(Remedy::LeaveBlocksOut));
        assert!(found.message.contains("share 100 of 200 frames"));
        assert!(
            found
                .message
                .ends_with("a split has to leave whole blocks out")
        );
    }
}

#[test]
fn windows_of_two_materials_of_one_block_are_errors() {
    // The first window of denim begins in the last one of cork.
    let mut values = windows(STEPS, 10.0);
    let (cork, denim) = values.split_at_mut(SWEEPS / 2 * STEPS * TAXELS);
    let half = STEPS / 2 * TAXELS;
    denim[..half].copy_from_slice(&cork[cork.len() - half..]);
    let findings = check_sweeps(values, TAXELS, Blocks::OfMaterial);
    assert_eq!(findings.len(), 1, "{findings:#?}");
    assert_eq!(findings[0].severity, Severity::Error);
    assert_eq!(findings[0].at.sweep, Some(10));
}

#[test]
fn separate_windows_share_nothing() {
    for noise in [0.3, 10.0] {
        let values = windows(STEPS, noise);
        let rounded: Vec<f32> = values.iter().map(|value| value.round()).collect();
        assert_eq!(check_sweeps(values, TAXELS, Blocks::Unknown), []);
        assert_eq!(check_sweeps(rounded, TAXELS, Blocks::Unknown), []);
    }
}

#[test]
fn coarse_sensors_of_few_taxels_share_frames_by_chance_alone() {
    for levels in [2.0, 3.0, 6.0] {
        for taxels in [1, 2] {
            let coarse = |value: &f32| ((value - 482.0) / 36.0 * levels).floor();
            let values = recording(7, SWEEPS * STEPS * taxels, 10.0);
            let values: Vec<f32> = values.iter().map(coarse).collect();
            let values = values[..SWEEPS * STEPS * taxels].to_vec();
            let found = check_sweeps(values, taxels, Blocks::Unknown);
            assert_eq!(found, [], "{levels} levels of {taxels} taxels");
        }
    }
}

#[test]
fn frames_at_rest_are_no_overlap() {
    // A contact of 30 frames between frames of one value.
    let mut values = windows(STEPS, 10.0);
    for (place, frame) in values.chunks_exact_mut(TAXELS).enumerate() {
        if !(80..110).contains(&(place % STEPS)) {
            frame.fill(500.0);
        }
    }
    assert_eq!(check_sweeps(values, TAXELS, Blocks::Unknown), []);
}

#[test]
fn periodic_sweeps_and_ramps_are_no_overlap() {
    let periodic = |period: usize| -> Vec<f32> {
        let once = recording(3, period, 10.0);
        let frame = |at: usize| {
            let (sweep, step) = (at / STEPS, at % STEPS);
            let place = (step + 7 * sweep) % period;
            once[place * TAXELS..][..TAXELS].to_vec()
        };
        (0..SWEEPS * STEPS).flat_map(frame).collect()
    };
    for period in [5, 41, 90] {
        let found = check_sweeps(periodic(period), TAXELS, Blocks::Unknown);
        assert_eq!(found, [], "{period}");
    }
    let ramp = |at: usize| (at / TAXELS % STEPS + 3 * (at / TAXELS / STEPS)) as f32;
    let ramps = (0..SWEEPS * STEPS * TAXELS).map(ramp).collect();
    assert_eq!(check_sweeps(ramps, TAXELS, Blocks::Unknown), []);
}

#[test]
fn copies_with_another_rounding_offset_or_gain_are_errors() {
    let changes: [fn(f32) -> f32; 4] = [
        |value| value.round(),
        |value| value + 12.5,
        |value| 1.7 * value,
        |value| (3.0 * value - 100.0).round() * 0.01,
    ];
    for (place, change) in changes.into_iter().enumerate() {
        let mut values = windows(STEPS, 10.0);
        let size = STEPS * TAXELS;
        let copy: Vec<f32> = values[3 * size..4 * size]
            .iter()
            .map(|&x| change(x))
            .collect();
        values[12 * size..13 * size].copy_from_slice(&copy);
        let findings = check_sweeps(values, TAXELS, Blocks::OfMaterial);
        assert_eq!(findings.len(), 1, "{place}: {findings:#?}");
        let found = &findings[0];
        let kind = (Severity::Error, FindingKind::NearDuplicate);
        assert_eq!((found.severity, found.kind), kind);
        assert_eq!(found.at.sweep, Some(12));
        let message = "`denim` sweep 2 (`X[12]`) is a copy of `cork` sweep 3 (`X[3]`) except for rounding, an offset or a gain";
        assert_eq!(found.message, message);
    }
}

#[test]
fn copies_in_one_block_are_warnings_and_equal_sweeps_are_no_near_duplicates() {
    let mut values = windows(STEPS, 10.0);
    let size = STEPS * TAXELS;
    values.copy_within(3 * size..4 * size, 5 * size);
    assert_eq!(check_sweeps(values.clone(), TAXELS, Blocks::OfMaterial), []);
    values[5 * size..6 * size]
        .iter_mut()
        .for_each(|x| *x *= 2.0);
    let findings = check_sweeps(values, TAXELS, Blocks::OfMaterial);
    assert_eq!(findings.len(), 1, "{findings:#?}");
    assert_eq!(findings[0].severity, Severity::Warning);
    assert_eq!(findings[0].remedy, Some(Remedy::LeaveBlocksOut));
}

#[test]
fn repeated_motions_with_noise_of_their_own_are_no_copies() {
    // The same strong wave and the same step in all sweeps, with little noise.
    for (wave, noise) in [(1000.0, 1.0), (30.0, 1.0), (1000.0, 0.05)] {
        let mut values = windows(STEPS, noise);
        for (place, frame) in values.chunks_exact_mut(TAXELS).enumerate() {
            let step = place % STEPS;
            let level = wave * (step as f32 * 0.05).sin() + if step > 60 { wave } else { 0.0 };
            frame.iter_mut().for_each(|value| *value += level);
        }
        let found = check_sweeps(values, TAXELS, Blocks::Unknown);
        assert_eq!(found, [], "{wave} {noise}");
    }
}

#[test]
fn integers_that_share_frames_are_found() {
    let values = windows(20, 10.0);
    let values = values.iter().map(|&value| value as u16).collect();
    let findings = check_samples(Samples::U16(values), TAXELS, Blocks::Unknown);
    assert_eq!(findings.len(), 18);
    let mut few: Vec<f32> = windows(20, 10.0);
    few.iter_mut().for_each(|value| *value = value.round());
    let few: Vec<f32> = few.into_iter().step_by(TAXELS).collect();
    assert_eq!(check_sweeps(few, 1, Blocks::Unknown).len(), 18, "one taxel");
}

#[test]
fn splits_that_divide_blocks_of_shared_frames_are_refused() {
    let dataset =
        |hop: usize, blocks: Blocks| dataset_of(Samples::F32(windows(hop, 10.0)), TAXELS, blocks);
    let refused = |dataset: &Dataset, scheme: Scheme| {
        let shared = shared_within_blocks(dataset);
        let findings = check(dataset);
        let both = [&shared, &findings].map(|of| refuse_leaks(dataset, of, scheme, "own.npz"));
        let both = both.map(|result| result.map_err(|error| error.to_string()));
        assert_eq!(both[0], both[1]);
        both[0].clone().err()
    };
    let random = [Scheme::default(), Scheme::hold_out()];
    let overlapping = dataset(20, Blocks::OfMaterial);
    for scheme in random {
        let message = refused(&overlapping, scheme).unwrap();
        let begin = "own.npz: the split could train on frames that it tests on, since 18 sweeps share frames with an earlier one, the first: `cork` sweep 0";
        assert!(message.starts_with(begin), "{message}");
    }
    let error = refuse_leaks(&overlapping, &check(&overlapping), random[0], "own.npz").unwrap_err();
    assert_eq!(error.remedy(), Some(Remedy::LeaveBlocksOut));
    assert_eq!(refused(&overlapping, Scheme::LeaveBlockOut), None);
    assert_eq!(refused(&overlapping, Scheme::TrainOnAll), None);
    // The author's split divides a block, or keeps both whole.
    for (from, is_refused) in [(7, true), (10, false)] {
        let tested = dataset(20, Blocks::Tested { from });
        let found = refused(&tested, Scheme::TestFlag);
        assert_eq!(found.is_some(), is_refused, "{from}: {found:?}");
    }
    let separate = dataset(STEPS, Blocks::OfMaterial);
    assert_eq!(refused(&separate, random[0]), None);
}
