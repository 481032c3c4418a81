//! Tests of time stamps with faults: gaps, lost frames, mixed rates, clocks that go back.

use tactnet_data::{FindingKind, Severity};

use crate::time::{Stamps, kinds, of_kind, random, read, rounded};

#[test]
fn all_sweeps_of_another_rate_are_named() {
    for (rate, other) in [(500.0, 250.0), (100.0, 103.0), (100.0, 1000.0)] {
        let sweeps: Vec<Stamps> = (0..12)
            .map(|sweep| {
                let rate = if sweep % 3 == 1 { other } else { rate };
                (0..150)
                    .map(|frame| format!("{:.6}", f64::from(frame) / rate))
                    .collect()
            })
            .collect();
        let dataset = read("time", &sweeps);
        assert_eq!(dataset.sample_rate_hz(), rate);
        let odd = of_kind(&dataset, FindingKind::MixedRates);
        let places: Vec<_> = odd
            .iter()
            .map(|finding| finding.at.sweep.unwrap())
            .collect();
        assert_eq!(places, [1, 4, 7, 10]);
        assert!(
            odd.iter()
                .all(|finding| finding.severity == Severity::Error)
        );
        let expected = format!(
            "sweep `s1`: {other} Hz, other than the {rate} Hz of most recordings, by the time stamps"
        );
        assert_eq!(odd[0].message, expected);
    }
    // A difference of a per cent is the clocks'.
    let near: Vec<Stamps> = [100.0, 101.0, 100.0].map(|rate| rounded(200, rate)).into();
    assert_eq!(of_kind(&read("time", &near), FindingKind::MixedRates), []);
}

#[test]
fn gaps_have_a_place_and_a_length() {
    // Rate, frame after the gap, length of the gap in seconds, severity.
    for (rate, at, gap, severity) in [
        (100.0, 50, 3600.0, Severity::Error),
        (100.0, 120, 0.5, Severity::Error),
        (100.0, 30, 0.1, Severity::Warning),
        (750.0, 7, 60.0, Severity::Error),
        (20.0, 100, 1.7e9, Severity::Error),
    ] {
        let plain = || -> Stamps {
            (0..300)
                .map(|frame| format!("{:.5}", f64::from(frame) / rate))
                .collect()
        };
        let with_gap = (0..300).map(|frame| {
            format!(
                "{:.5}",
                f64::from(frame) / rate + if frame >= at { gap } else { 0.0 }
            )
        });
        let dataset = read("time", &[plain(), with_gap.collect(), plain()]);
        assert_eq!(dataset.sample_rate_hz(), rate, "{gap}");
        let found = of_kind(&dataset, FindingKind::TimeGap);
        assert_eq!(found.len(), 1, "{rate} {gap}");
        assert_eq!(found[0].severity, severity, "{gap}");
        assert_eq!(
            (found[0].at.sweep, found[0].at.step),
            (Some(1), Some(at as usize))
        );
        // The line of names and the first sweep come before it.
        assert_eq!(found[0].at.line, Some(302 + at as usize));
        assert_eq!(
            found[0].message.contains("the clock was set"),
            gap > 1e9,
            "{}",
            found[0].message
        );
        assert_eq!(kinds(&dataset).len(), 1, "{:?}", kinds(&dataset));
    }
}

#[test]
fn lost_frames_are_counted() {
    for (rate, share, severity) in [
        (100.0, 0.25, Severity::Error),
        (100.0, 0.01, Severity::Warning),
        (750.0, 0.25, Severity::Error),
        (138.8, 0.1, Severity::Error),
    ] {
        let mut random = random(11);
        let mut lost = Vec::new();
        let mut sweeps = Vec::new();
        for _ in 0..4 {
            let kept: Vec<usize> = (0..900)
                .filter(|frame| *frame == 0 || random() >= share)
                .take(600)
                .collect();
            lost.push(kept[kept.len() - 1] + 1 - kept.len());
            sweeps.push(
                kept.iter()
                    .map(|frame| format!("{:.6}", *frame as f64 / rate))
                    .collect(),
            );
        }
        let dataset = read("time", &sweeps);
        assert!(
            (dataset.sample_rate_hz() / rate - 1.0).abs() < 1e-3,
            "{}",
            dataset.sample_rate_hz()
        );
        let found = of_kind(&dataset, FindingKind::LostFrames);
        assert_eq!(found.len(), 4, "{rate} {share}");
        for (finding, lost) in found.iter().zip(lost) {
            assert_eq!(finding.severity, severity);
            let of = format!("{lost} of {} frames are missing", 600 + lost);
            assert!(finding.message.contains(&of), "{}", finding.message);
        }
    }
}

/// Frames that are lost regularly look like rounded stamps, except for the digits of the stamps.
#[test]
fn frames_that_are_lost_regularly_are_counted() {
    let stamps = |rate: f64, every: usize, digits: Option<usize>| -> Stamps {
        let kept = (0..800).filter(|frame| frame % every != every - 1);
        kept.map(|frame| match digits {
            Some(digits) => format!("{:.digits$}", frame as f64 / rate),
            None => (frame as f64 / rate).to_string(),
        })
        .collect()
    };
    for (rate, every, digits) in [
        (100.0, 4, None),
        (100.0, 4, Some(3)),
        (200.0, 4, None),
        (200.0, 3, Some(4)),
        (50.0, 3, None),
        (750.0, 4, Some(6)),
    ] {
        let sweeps = [stamps(rate, every, digits), stamps(rate, every, digits)];
        let dataset = read("time", &sweeps);
        assert!(
            (dataset.sample_rate_hz() / rate - 1.0).abs() < 1e-3,
            "{rate} {every}: {}",
            dataset.sample_rate_hz()
        );
        let found = of_kind(&dataset, FindingKind::LostFrames);
        assert_eq!(found.len(), 2, "{rate} {every}");
        assert_eq!(found[0].severity, Severity::Error);
    }
    // The same intervals as of 100 Hz without every fourth frame, but hundredths of a second are the last digit.
    for rate in [75.0, 80.0, 90.0] {
        let sweep: Stamps = (0..800)
            .map(|frame| format!("{:.2}", f64::from(frame) / rate))
            .collect();
        assert_eq!(read("time", &[sweep.clone(), sweep]).sample_rate_hz(), rate);
    }
}

#[test]
fn late_frames_are_neither_lost_nor_a_gap() {
    // Once a second, seven frames wait for 70 ms and come at once.
    let stamps = |frame: usize| match frame % 100 {
        phase @ 40..47 => (frame - phase + 46) as f64 / 100.0 + 1e-3 * (phase - 40) as f64,
        _ => frame as f64 / 100.0,
    };
    let sweep: Stamps = (0..600)
        .map(|frame| format!("{:.5}", stamps(frame)))
        .collect();
    let dataset = read("time", &[sweep.clone(), sweep]);
    assert!(
        (dataset.sample_rate_hz() - 100.0).abs() < 0.2,
        "{}",
        dataset.sample_rate_hz()
    );
    assert_eq!(kinds(&dataset), []);
}

#[test]
fn a_clock_that_goes_backwards_is_an_error_that_can_be_read() {
    for (at, back) in [(5, 0.03), (60, 3600.0)] {
        let sweep = |back: f64| -> Stamps {
            (0..100)
                .map(|frame| {
                    format!(
                        "{:.3}",
                        5000.0 + f64::from(frame) / 100.0 - if frame >= at { back } else { 0.0 }
                    )
                })
                .collect()
        };
        let sweeps = [sweep(0.0), sweep(back)];
        let dataset = read("time", &sweeps);
        assert_eq!(dataset.sample_rate_hz(), 100.0);
        let found = of_kind(&dataset, FindingKind::ClockBackwards);
        assert_eq!(found.len(), 1);
        assert_eq!(
            (found[0].severity, found[0].at.line),
            (Severity::Error, Some(102 + at as usize))
        );
        assert!(
            found[0]
                .message
                .contains("sweep `s1`: the time goes back from"),
            "{}",
            found[0].message
        );
        let named = dataset.with_named_rate(Some(100.0)).unwrap();
        assert_eq!(named.sample_rate_hz(), 100.0);
    }
}
