//! Tests of the segmenter: complete sweeps, each kind of rejection, and contact.

use super::*;
use crate::{FrameSpan, WindowError};

const PERIOD: u64 = 1_000_000;

fn config() -> SegmenterConfig {
    SegmenterConfig {
        skip: 2.into(),
        longest_gap: 1.into(),
        stalled_frames: 4.into(),
        saturated_frames: 3.into(),
        values: Some([0.0, 255.0]),
        ..SegmenterConfig::default()
    }
}

fn segmenter(config: SegmenterConfig) -> SweepSegmenter {
    SweepSegmenter::new(config, 6, 2, 1e9 / PERIOD as f64)
}

/// Pushes a frame on time whose digits change.
fn good(segmenter: &mut SweepSegmenter, sequence: u64) -> SweepChange {
    let digits = [20.0 + (sequence % 3) as f32, 30.0 + (sequence % 2) as f32];
    push(segmenter, sequence, sequence * PERIOD, digits)
}

fn push(segmenter: &mut SweepSegmenter, sequence: u64, time: u64, digits: [f32; 2]) -> SweepChange {
    segmenter.push(&Frame {
        sequence,
        sensor_time_nanos: time,
        taxels: &digits,
    })
}

#[test]
fn a_commanded_sweep_completes_once() {
    let mut segmenter = segmenter(config());
    assert_eq!(good(&mut segmenter, 4), SweepChange::Unchanged);
    assert_eq!(segmenter.start(), SweepChange::Begun);
    for sequence in 5..12 {
        assert_eq!(good(&mut segmenter, sequence), SweepChange::Extended);
    }
    assert_eq!(good(&mut segmenter, 12), SweepChange::Complete);
    assert_eq!(segmenter.window().kept(), 6);
    assert_eq!(good(&mut segmenter, 13), SweepChange::Unchanged);
    assert_eq!(segmenter.stop(), SweepChange::Unchanged);
    assert_eq!(good(&mut segmenter, 14), SweepChange::Unchanged);
    assert_eq!(segmenter.start(), SweepChange::Begun);
}

#[test]
fn a_sweep_may_end_early_where_shorter_ones_are_accepted() {
    let mut segmenter = segmenter(config());
    segmenter.accept_from(4);
    // Two frames are skipped, so six give four in the window.
    for (frames, expected) in [
        (6, SweepChange::Complete),
        (5, short(3, 4)),
        (8, SweepChange::Unchanged),
    ] {
        segmenter.start();
        (0..frames).for_each(|_| {
            let next = segmenter.newest.map_or(0, |frame| frame.sequence + 1);
            good(&mut segmenter, next);
        });
        assert_eq!(segmenter.stop(), expected, "{frames} frames");
    }
    assert_eq!(segmenter.window().kept(), 6);
}

#[test]
fn a_sweep_may_be_longer_than_the_training_sweeps_up_to_the_longest_window() {
    let mut segmenter = segmenter(SegmenterConfig {
        longest: Some(FrameSpan::Frames(9)),
        ..config()
    });
    // Two frames are skipped.
    for (frames, kept, stopped) in [
        (7, 5, short(5, 6)),
        (8, 6, SweepChange::Complete),
        (10, 8, SweepChange::Complete),
        (14, 9, SweepChange::Unchanged),
    ] {
        segmenter.start();
        let changes: Vec<SweepChange> = (0..frames)
            .map(|_| {
                let next = segmenter.newest.map_or(0, |frame| frame.sequence + 1);
                good(&mut segmenter, next)
            })
            .collect();
        let complete = changes.contains(&SweepChange::Complete);
        assert_eq!(complete, frames == 14, "{frames} frames");
        assert_eq!(segmenter.window().kept(), kept);
        assert_eq!(segmenter.stop(), stopped, "{frames} frames");
    }
}

/// Returns the rejection of a sweep that ended early.
fn short(found: usize, expected: usize) -> SweepChange {
    SweepChange::Rejected(Reject::Short { found, expected })
}

#[test]
fn every_fault_has_its_outcome() {
    let begun = || {
        let mut segmenter = segmenter(config());
        segmenter.start();
        (0..4).for_each(|sequence| {
            good(&mut segmenter, sequence);
        });
        segmenter
    };
    // One lost frame is interpolated, two are too many.
    let mut lost = begun();
    assert_eq!(good(&mut lost, 5), SweepChange::Extended);
    assert_eq!(lost.window().filled_in(), 1);
    let rejected = good(&mut begun(), 6);
    assert!(matches!(
        rejected,
        SweepChange::Rejected(Reject::Window(WindowError::Gap { lost: 2, .. }))
    ));
    let repeated = good(&mut begun(), 3);
    assert!(matches!(
        repeated,
        SweepChange::Rejected(Reject::Window(WindowError::Order { .. }))
    ));
    for time in [4 * PERIOD + 600_000, 3 * PERIOD, 0] {
        let jumped = push(&mut begun(), 4, time, [1.0, 2.0]);
        assert!(matches!(
            jumped,
            SweepChange::Rejected(Reject::Clock { .. })
        ));
    }
    let mut late = begun();
    assert_eq!(
        push(&mut late, 4, 4 * PERIOD + 400_000, [1.0, 2.0]),
        SweepChange::Extended
    );
    let mut short = begun();
    let expected = Reject::Short {
        found: 2,
        expected: 6,
    };
    assert_eq!(short.stop(), SweepChange::Rejected(expected));
    let second = Reject::SecondStart {
        found: 2,
        expected: 6,
    };
    let mut twice = begun();
    assert_eq!(twice.start(), SweepChange::RejectedAndBegun(second));
    assert_eq!(twice.window().kept(), 0);
    assert_eq!(good(&mut twice, 4), SweepChange::Extended);
}

#[test]
fn losses_just_before_the_first_frame_count_and_clocks_may_not_drift() {
    let mut late = segmenter(config());
    good(&mut late, 3);
    late.start();
    let gap = good(&mut late, 9);
    assert!(matches!(
        gap,
        SweepChange::Rejected(Reject::Window(WindowError::Gap { lost: 5, .. }))
    ));
    // A restarted sensor begins a new count of frames.
    late.stop();
    good(&mut late, 0);
    late.start();
    assert_eq!(good(&mut late, 1), SweepChange::Extended);

    // Each interval is within tolerance, their sum is not.
    let mut slow = segmenter(SegmenterConfig {
        clock_drift: 2.0,
        ..config()
    });
    slow.start();
    let mut outcomes = (0..8).map(|sequence| {
        let digits = [20.0 + (sequence % 3) as f32, 30.0 + (sequence % 2) as f32];
        push(&mut slow, sequence, sequence * PERIOD * 14 / 10, digits)
    });
    assert!(outcomes.any(|o| matches!(o, SweepChange::Rejected(Reject::Clock { .. }))));

    let mut holes = segmenter(SegmenterConfig {
        most_filled_in: 1.into(),
        skip: 0.into(),
        ..config()
    });
    holes.start();
    good(&mut holes, 0);
    assert_eq!(good(&mut holes, 2), SweepChange::Extended);
    let losses = Reject::Losses {
        found: 2,
        allowed: 1,
    };
    assert_eq!(good(&mut holes, 4), SweepChange::Rejected(losses));

    let mut wild = segmenter(config());
    wild.start();
    let range = push(&mut wild, 0, 0, [1.0, 1e30]);
    assert!(matches!(
        range,
        SweepChange::Rejected(Reject::Range { taxel: 1, .. })
    ));
}

#[test]
fn stalled_and_saturated_taxels_are_found_and_silent_ones_are_not() {
    let sweep = |digits: &dyn Fn(u64) -> [f32; 2]| {
        let mut segmenter = segmenter(config());
        segmenter.start();
        (0..8)
            .map(|sequence| {
                push(
                    &mut segmenter,
                    sequence,
                    sequence * PERIOD,
                    digits(sequence),
                )
            })
            .find(|change| *change != SweepChange::Extended)
            .unwrap()
    };
    let stalled = Reject::Stalled {
        taxel: 1,
        digit: 7.0,
        frames: 4,
    };
    assert_eq!(sweep(&|n| [n as f32, 7.0]), SweepChange::Rejected(stalled));
    assert_eq!(sweep(&|n| [n as f32, 0.0]), SweepChange::Complete);
    let saturated = Reject::Saturated {
        taxel: 0,
        frames: 3,
    };
    assert_eq!(
        sweep(&|n| [255.0, n as f32]),
        SweepChange::Rejected(saturated)
    );
}

#[test]
fn dead_taxels_reject_no_sweep_and_hold_no_contact() {
    let mut segmenter = segmenter(config());
    segmenter.set_dead([1]);
    let mut sequence = 0;
    let mut sweep = |values: [f32; 2]| {
        segmenter.start();
        for n in 0..8 {
            let digits = [n as f32, values[n % 2]];
            push(&mut segmenter, sequence, sequence * PERIOD, digits);
            sequence += 1;
        }
        segmenter.window().is_complete()
    };
    // Stalled, saturated, out of range.
    assert!(sweep([7.0, 7.0]));
    assert!(sweep([255.0, 255.0]));
    assert!(sweep([-1.0, 300.0]));
    let contact = Contact {
        begins: 10.0,
        ends: 5.0,
        frames: 1.into(),
    };
    let mut segmenter = SweepSegmenter::new(
        SegmenterConfig {
            segmentation: Segmentation::Contact(contact),
            ..config()
        },
        6,
        2,
        1e9 / PERIOD as f64,
    );
    segmenter.set_dead([1]);
    assert_eq!(
        push(&mut segmenter, 0, 0, [9.0, 90.0]),
        SweepChange::Unchanged
    );
    assert_eq!(
        push(&mut segmenter, 1, PERIOD, [10.0, 0.0]),
        SweepChange::Begun
    );
    segmenter.set_dead([]);
    assert!(matches!(
        push(&mut segmenter, 2, 2 * PERIOD, [9.0, 0.0]),
        SweepChange::Rejected(Reject::Short { .. })
    ));
}

#[test]
fn values_below_zero_are_as_good_as_others_where_the_skin_gives_them() {
    let sweep = |values: Option<[f32; 2]>, digit: f32| {
        let mut segmenter = segmenter(SegmenterConfig { values, ..config() });
        segmenter.start();
        (0..8)
            .map(|sequence| {
                let digits = [digit, -(sequence as f32)];
                push(&mut segmenter, sequence, sequence * PERIOD, digits)
            })
            .find(|change| *change != SweepChange::Extended)
            .unwrap()
    };
    // A taxel at zero is not touched, so it does not count as stalled.
    assert_eq!(sweep(Some([-24.5, 31.0]), 0.0), SweepChange::Complete);
    assert_eq!(sweep(None, 0.0), SweepChange::Complete);
    let low = sweep(Some([-24.5, 31.0]), -24.6);
    let SweepChange::Rejected(reject) = low else {
        panic!("{low:?}")
    };
    assert_eq!(
        reject.to_string(),
        "frame 0: taxel 0 has the value -24.6, expected -24.5 to 31; the setting `values` widens the range"
    );
    let mut later = segmenter(config());
    later.set_values([-1.0, 1.0]);
    later.start();
    assert_eq!(
        push(&mut later, 0, 0, [-0.5, 0.5]),
        SweepChange::Extended,
        "another network's values"
    );
}

#[test]
fn contact_begins_and_ends_with_hysteresis() {
    let contact = Contact {
        begins: 10.0,
        ends: 5.0,
        frames: 2.into(),
    };
    let mut segmenter = segmenter(SegmenterConfig {
        segmentation: Segmentation::Contact(contact),
        skip: 0.into(),
        ..config()
    });
    let mut sequence = 0;
    let mut touch = |mean: f32| {
        sequence += 1;
        let digits = [mean + (sequence % 2) as f32 * 0.1, mean];
        push(&mut segmenter, sequence, sequence * PERIOD, digits)
    };
    assert_eq!(touch(12.0), SweepChange::Unchanged);
    assert_eq!(
        touch(8.0),
        SweepChange::Unchanged,
        "one frame is no contact"
    );
    assert_eq!(touch(12.0), SweepChange::Unchanged);
    assert_eq!(touch(12.0), SweepChange::Begun);
    for mean in [11.0, 4.0, 8.0, 7.0, 4.0] {
        assert_eq!(touch(mean), SweepChange::Extended, "{mean}");
    }
    let short = Reject::Short {
        found: 5,
        expected: 6,
    };
    assert_eq!(touch(4.0), SweepChange::Rejected(short));
    assert_eq!(touch(0.0), SweepChange::Unchanged);
}
