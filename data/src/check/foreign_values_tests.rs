//! Tests of the checks for values that no sensor measured: fill values, spikes, dropouts, dead taxels, padding.

use super::*;
use crate::{LabelSet, Remedy, Samples, SweepRecord, SweepShape};

const SHAPE: SweepShape = SweepShape {
    steps: 200,
    rows: 2,
    cols: 3,
};
const SWEEPS: usize = 18;

/// Values of 18 sweeps of three materials, `[sweeps][steps][taxels]`.
struct Sweeps(Vec<f32>);

impl Sweeps {
    /// Returns noise of standard deviation `noise` around `level` with a slow wave, a taxel louder than the one before.
    fn noisy(level: f32, noise: f32) -> Self {
        let mut state = 12345_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f32 / (1_u64 << 24) as f32 - 0.5
        };
        let value = |i: usize| {
            let gain = 1.0 + 0.2 * (i % SHAPE.taxels()) as f32;
            let wave = (i as f32 * 0.002).sin();
            level + gain * noise * (3.5 * uniform() + wave)
        };
        Self((0..SWEEPS * SHAPE.values()).map(value).collect())
    }

    /// Returns the sweeps of a skin that is zero except during a contact of varying times.
    fn of_contacts() -> Self {
        let mut sweeps = Self::noisy(60.0, 4.0);
        for sweep in 0..SWEEPS {
            for step in 0..SHAPE.steps {
                let (begin, end) = (20 + 3 * sweep, 150 + 2 * sweep);
                let rise = (step as f32 - begin as f32).min(end as f32 - step as f32);
                let force = (rise / 8.0).clamp(0.0, 1.0);
                for taxel in 0..SHAPE.taxels() {
                    let value = &mut sweeps.0[at(sweep, step, taxel)];
                    *value = (*value * force).round();
                }
            }
        }
        sweeps
    }

    fn frame(&mut self, sweep: usize, step: usize) -> &mut [f32] {
        let start = at(sweep, step, 0);
        &mut self.0[start..start + SHAPE.taxels()]
    }

    fn fill(&mut self, sweep: usize, steps: std::ops::Range<usize>, value: f32) {
        steps.for_each(|step| self.frame(sweep, step).fill(value));
    }

    /// Repeats the frame before `steps`.
    fn freeze(&mut self, sweep: usize, steps: std::ops::Range<usize>) {
        let frame = self.frame(sweep, steps.start - 1).to_vec();
        steps.for_each(|step| self.frame(sweep, step).copy_from_slice(&frame));
    }

    fn rounded(mut self) -> Self {
        self.0.iter_mut().for_each(|value| *value = value.round());
        self
    }

    fn check(self) -> Vec<Finding> {
        self.check_as(Samples::F32)
    }

    fn check_u16(self) -> Vec<Finding> {
        self.check_as(|values| Samples::U16(values.into_iter().map(|value| value as u16).collect()))
    }

    fn check_as(self, samples: impl Fn(Vec<f32>) -> Samples) -> Vec<Finding> {
        let record = |sweep: usize| SweepRecord::new(sweep % 3, sweep / 3);
        let records = (0..SWEEPS).map(record).collect();
        let labels = LabelSet::new(["cork", "denim", "wood"]).unwrap();
        let samples = samples(self.0);
        let dataset = Dataset::new("t", 100.0, SHAPE, labels, records, samples).unwrap();
        let mut findings = check(&dataset);
        findings.retain(|finding| finding.severity != Severity::Note);
        findings
    }
}

fn at(sweep: usize, step: usize, taxel: usize) -> usize {
    sweep * SHAPE.values() + step * SHAPE.taxels() + taxel
}

fn place(sweep: usize, step: usize, taxel: Option<usize>) -> Place {
    Place {
        sweep: Some(sweep),
        step: Some(step),
        taxel,
        ..Place::default()
    }
}

fn only(findings: &[Finding]) -> (Severity, FindingKind, &Place, &str) {
    assert_eq!(findings.len(), 1, "{findings:#?}");
    let Finding {
        severity,
        kind,
        at,
        message,
        ..
    } = &findings[0];
    (*severity, *kind, at, message)
}

#[test]
fn sound_sweeps_give_no_finding() {
    for (level, noise) in [(0.0, 1.0), (500.0, 40.0), (1e-6, 1e-7), (101_325.0, 3.0)] {
        assert_eq!(Sweeps::noisy(level, noise).check(), [], "{level} {noise}");
    }
    assert_eq!(Sweeps::noisy(500.0, 40.0).check_u16(), []);
    assert_eq!(Sweeps::noisy(20.0, 0.4).check_u16(), [], "a coarse sensor");
    assert_eq!(Sweeps::of_contacts().check(), []);
    assert_eq!(Sweeps::of_contacts().check_u16(), []);
}

#[test]
fn rare_events_and_lifts_of_the_finger_give_no_finding() {
    let mut events = Sweeps::noisy(0.0, 1.0);
    events
        .0
        .iter_mut()
        .for_each(|value| *value = f32::from(*value > 2.2));
    assert_eq!(events.check_u16(), []);

    let mut lifted = Sweeps::of_contacts();
    for sweep in 0..SWEEPS {
        for step in 90..110 {
            let away = (step as f32 - 100.0).abs() - 5.0;
            let force = (away / 5.0).clamp(0.0, 1.0);
            let frame = lifted.frame(sweep, step).iter_mut();
            frame.for_each(|value| *value = (*value * force).round());
        }
    }
    assert_eq!(lifted.check(), []);
}

#[test]
fn fill_values_are_errors_with_their_meaning() {
    for (fill, meaning) in [
        (1e20, "masked arrays of NumPy"),
        (9.969_21e36, "NetCDF"),
        (-9999.0, "many data loggers"),
        (999.99, "many data loggers"),
        (32767.0, "16-bit integers"),
        (f32::MAX, "32-bit floats"),
    ] {
        let mut sweeps = Sweeps::noisy(20.0, 5.0);
        sweeps.0[at(7, 30, 4)] = fill;
        sweeps.0[at(7, 31, 5)] = fill;
        let findings = sweeps.check();
        let (severity, kind, found, message) = only(&findings);
        assert_eq!((severity, kind), (Severity::Error, FindingKind::FillValue));
        assert_eq!(found, &place(7, 30, Some(4)));
        let begin = format!("`denim` sweep 2: 2 values are {fill}");
        assert!(
            message.starts_with(&begin) && message.contains(meaning),
            "{message}"
        );
    }
}

#[test]
fn the_top_of_16_bits_in_a_12_bit_stream_is_a_fill_value_and_of_a_saturated_sensor_none() {
    let mut sweeps = Sweeps::noisy(2000.0, 300.0);
    sweeps.fill(3, 50..90, 65535.0);
    let findings = sweeps.check_u16();
    let (severity, kind, found, _) = only(&findings);
    assert_eq!((severity, kind), (Severity::Error, FindingKind::FillValue));
    assert_eq!(found, &place(3, 50, Some(0)));

    let mut pressed = Sweeps::noisy(2000.0, 300.0);
    for step in 50..90 {
        let force = 30.0 * (1.0 - (step as f32 - 70.0).abs() / 20.0);
        let frame = pressed.frame(3, step).iter_mut();
        frame.for_each(|value| *value = (*value * (1.0 + force)).min(65535.0));
    }
    let findings = pressed.check_u16();
    let is_fill = |finding: &Finding| finding.kind == FindingKind::FillValue;
    assert!(!findings.iter().any(is_fill), "{findings:#?}");
}

#[test]
fn many_fill_values_are_found_in_every_sweep() {
    let mut sweeps = Sweeps::noisy(0.0, 100.0);
    for sweep in 0..SWEEPS {
        sweeps.fill(sweep, 10 * sweep..10 * sweep + 8, -9999.0);
    }
    let findings = sweeps.check();
    assert_eq!(findings.len(), SWEEPS, "{findings:#?}");
    for (sweep, finding) in findings.iter().enumerate() {
        assert_eq!(finding.kind, FindingKind::FillValue);
        assert_eq!(finding.at, place(sweep, 10 * sweep, Some(0)));
        assert!(finding.message.contains(": 48 values are -9999"));
    }
}

#[test]
fn a_spike_is_a_warning_and_many_are_an_error() {
    for (value, noise) in [(400.0, 5.0), (-77.7, 0.5)] {
        let mut sweeps = Sweeps::noisy(20.0, noise);
        sweeps.0[at(11, 140, 2)] = value;
        let findings = sweeps.check();
        let (severity, kind, found, _) = only(&findings);
        assert_eq!((severity, kind), (Severity::Warning, FindingKind::Spike));
        assert_eq!(found, &place(11, 140, Some(2)));
    }
    let mut sweeps = Sweeps::noisy(20.0, 5.0);
    for sweep in 0..SWEEPS {
        (0..4).for_each(|i| sweeps.0[at(sweep, 20 + 40 * i, i)] = 1234.5 + i as f32);
    }
    let findings = sweeps.check();
    let severities = findings.iter().map(|found| (found.severity, found.kind));
    let expected = (Severity::Error, FindingKind::Spike);
    assert!(severities.eq([expected; SWEEPS]), "{findings:#?}");
}

#[test]
fn zero_and_frozen_frames_in_a_motion_are_dropouts() {
    for (start, frames, severity) in [(80, 5, Severity::Warning), (33, 40, Severity::Error)] {
        for is_zero in [true, false] {
            let mut sweeps = Sweeps::noisy(500.0, 40.0);
            match is_zero {
                true => sweeps.fill(4, start..start + frames, 0.0),
                // The frozen frame is the first of the run.
                false => sweeps.freeze(4, start + 1..start + frames),
            }
            let words = if is_zero { "zero" } else { "frozen" };
            for findings in [
                Sweeps(sweeps.0.clone()).check(),
                sweeps.rounded().check_u16(),
            ] {
                let (found, kind, at, message) = only(&findings);
                assert_eq!((found, kind), (severity, FindingKind::Dropout));
                assert_eq!(at, &place(4, start, None));
                assert!(message.contains(words), "{message}");
            }
        }
    }
}

#[test]
fn a_dropout_of_a_skin_that_rests_at_zero_is_told_from_a_lift() {
    let mut sweeps = Sweeps::of_contacts();
    sweeps.fill(6, 100..105, 0.0);
    let findings = sweeps.check();
    let (_, kind, found, _) = only(&findings);
    assert_eq!((kind, found), (FindingKind::Dropout, &place(6, 100, None)));
}

#[test]
fn dead_taxels_may_have_a_few_odd_frames() {
    for (odd, value) in [(1, 3.0), (4, 900.0)] {
        let mut sweeps = Sweeps::noisy(20.0, 5.0);
        for taxel in [1, 4] {
            sweeps
                .0
                .iter_mut()
                .skip(taxel)
                .step_by(SHAPE.taxels())
                .for_each(|x| *x = 0.0);
            (0..odd).for_each(|i| sweeps.0[at(3 * i, 70 + i, taxel)] = value);
        }
        let findings = sweeps.check();
        let found = findings.iter().map(|found| (found.kind, found.at.taxel));
        let kind = FindingKind::DeadTaxel;
        assert!(
            found.eq([(kind, Some(1)), (kind, Some(4))]),
            "{findings:#?}"
        );
        let end = format!("except {odd}, the first in `cork` sweep 0, step 70");
        assert!(
            findings[0].message.ends_with(&end),
            "{}",
            findings[0].message
        );
    }
}

#[test]
fn padding_is_found_and_its_length_if_it_follows_the_material() {
    for content in ["zeros", "last frame", "noise"] {
        for follows in [false, true] {
            let mut sweeps = Sweeps::noisy(50.0, 8.0);
            let noise = Sweeps::noisy(0.0, 0.01);
            for sweep in 0..SWEEPS {
                let frames = if follows {
                    20 + 15 * (sweep % 3) + sweep / 3
                } else {
                    20 + (7 * sweep + sweep / 3) % 37
                };
                let tail = SHAPE.steps - frames..SHAPE.steps;
                match content {
                    "zeros" => sweeps.fill(sweep, tail, 0.0),
                    "last frame" => sweeps.freeze(sweep, tail),
                    _ => tail.for_each(|step| {
                        let noise = &noise.0[at(sweep, step, 0)..][..SHAPE.taxels()];
                        sweeps.frame(sweep, step).copy_from_slice(noise);
                    }),
                }
            }
            let mut findings = sweeps.check();
            if follows {
                let error = findings.remove(0);
                assert_eq!(
                    (error.severity, error.kind),
                    (Severity::Error, FindingKind::Padding)
                );
                assert!(error.message.contains("separates the materials: 100 %"));
                assert!(matches!(error.remedy, Some(Remedy::KeepSteps { .. })));
            }
            let kinds = findings.iter().map(|found| (found.severity, found.kind));
            let expected = (Severity::Warning, FindingKind::Padding);
            assert!(
                kinds.eq([expected; SWEEPS]),
                "{content} {follows}: {findings:#?}"
            );
            let frames = SHAPE.steps - findings[0].at.step.unwrap();
            assert!((20..=21).contains(&frames), "{content}: {frames}");
        }
    }
}

#[test]
fn a_skin_that_is_lifted_to_zero_and_a_slow_sensor_are_not_padded() {
    let mut sweeps = Sweeps::noisy(60.0, 4.0);
    for sweep in 0..SWEEPS {
        let end = 130 + 3 * sweep;
        for step in 0..SHAPE.steps {
            let force = ((end as f32 - step as f32) / 20.0).clamp(0.0, 1.0);
            sweeps
                .frame(sweep, step)
                .iter_mut()
                .for_each(|x| *x *= force);
        }
    }
    assert_eq!(sweeps.check(), []);

    let mut held = Sweeps::noisy(500.0, 40.0);
    for sweep in 0..SWEEPS {
        (0..SHAPE.steps)
            .step_by(4)
            .for_each(|step| held.freeze(sweep, step + 1..step + 4));
    }
    assert_eq!(held.check(), []);
}

#[test]
fn zeros_before_the_sweeps_are_padding() {
    let mut sweeps = Sweeps::noisy(0.0, 8.0);
    (0..6).for_each(|sweep| sweeps.fill(sweep, 0..12 + sweep, 0.0));
    let findings = sweeps.check();
    assert_eq!(findings.len(), 6, "{findings:#?}");
    for (sweep, finding) in findings.iter().enumerate() {
        assert_eq!(
            (finding.kind, &finding.at),
            (FindingKind::Padding, &place(sweep, 0, None))
        );
    }
}
