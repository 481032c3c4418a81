//! Resampling of frames to another rate.
//!
//! Frames at uneven times are first interpolated to even ones, by cubic polynomials (Catmull & Rom, 1974). Even frames are
//! filtered by a windowed sinc (Kaiser window; Oppenheim & Schafer, Discrete-Time Signal Processing, section 7.5) that is
//! evaluated at the times of the new frames, so that the ratio of the rates may be any number. The filter passes
//! frequencies below 0.8 of the lower Nyquist frequency, within 0.1 %, and attenuates those above it by at least 70 dB.

use std::f64::consts::PI;

/// Start of the filter's transition, relative to the lower Nyquist frequency; it ends at 1.
const PASSED: f64 = 0.8;
/// Attenuation that the filter is designed for, in dB.
const ATTENUATION: f64 = 80.0;
/// Deviation from even times, in periods, up to which frames count as even.
const EVEN: f64 = 0.01;

/// Returns frames at the rate `to_hz`, the first at the time of the first of `values`.
///
/// - `values`: even frames, `[frames][taxels]`
pub(super) fn to_rate(values: &[f64], taxels: usize, from_hz: f64, to_hz: f64) -> Vec<f64> {
    let frames = values.len() / taxels.max(1);
    if frames == 0 || from_hz == to_hz {
        return values.to_vec();
    }
    let filter = Filter::of(from_hz, to_hz);
    let count = count((frames - 1) as f64 / from_hz, to_hz);
    let mut resampled = Vec::with_capacity(count * taxels);
    let mut sum = vec![0.0; taxels];
    for new in 0..count {
        let at = new as f64 * from_hz / to_hz;
        let (first, last) = (
            (at - filter.reach).ceil() as i64,
            (at + filter.reach).floor() as i64,
        );
        sum.fill(0.0);
        let mut total = 0.0;
        for frame in first..=last {
            let weight = filter.weight(frame as f64 - at);
            total += weight;
            add(&mut sum, weight, values, frames, frame);
        }
        // The sum of the weights differs from 1 by the ripple of the filter; a constant stays what it is.
        resampled.extend(sum.iter().map(|sum| sum / total));
    }
    resampled
}

/// Adds a weighted frame. Before the start and after the end, the signal continues point-symmetrically, which keeps its
/// slope.
fn add(sum: &mut [f64], weight: f64, values: &[f64], frames: usize, frame: i64) {
    let taxels = sum.len();
    let last = frames as i64 - 1;
    let of = |frame: i64| {
        let start = frame.clamp(0, last) as usize * taxels;
        &values[start..start + taxels]
    };
    if (0..=last).contains(&frame) {
        sum.iter_mut()
            .zip(of(frame))
            .for_each(|(sum, value)| *sum += weight * value);
    } else {
        let end = if frame < 0 { 0 } else { last };
        let both = of(end).iter().zip(of(2 * end - frame));
        sum.iter_mut()
            .zip(both)
            .for_each(|(sum, (end, mirrored))| *sum += weight * (2.0 * end - mirrored));
    }
}

/// Returns the number of frames within a time, both ends included.
fn count(seconds: f64, rate: f64) -> usize {
    // Rounding errors must not cost the last frame.
    (seconds * rate + 1e-6).floor() as usize + 1
}

/// Windowed sinc; lengths are in frames of the original rate.
struct Filter {
    /// Frequency of half amplitude, in cycles per frame, times two.
    cutoff: f64,
    /// Half of the length.
    reach: f64,
    beta: f64,
    scale: f64,
}

impl Filter {
    fn of(from_hz: f64, to_hz: f64) -> Self {
        let nyquist = (to_hz / from_hz).min(1.0);
        let beta = 0.1102 * (ATTENUATION - 8.7);
        let transition = (1.0 - PASSED) * nyquist * PI;
        Self {
            cutoff: 0.5 * (1.0 + PASSED) * nyquist,
            reach: 0.5 * (ATTENUATION - 7.95) / (2.285 * transition),
            beta,
            scale: 1.0 / bessel(beta),
        }
    }

    fn weight(&self, distance: f64) -> f64 {
        let relative = distance / self.reach;
        let inside = 1.0 - relative * relative;
        if inside < 0.0 {
            return 0.0;
        }
        let x = PI * self.cutoff * distance;
        let sinc = if x.abs() < 1e-9 { 1.0 } else { x.sin() / x };
        self.cutoff * sinc * bessel(self.beta * inside.sqrt()) * self.scale
    }
}

/// Returns the modified Bessel function of the first kind and order zero.
fn bessel(x: f64) -> f64 {
    let (mut sum, mut term, mut k) = (1.0, 1.0, 1.0);
    while term > 1e-17 * sum {
        term *= (0.5 * x / k) * (0.5 * x / k);
        sum += term;
        k += 1.0;
    }
    sum
}

/// Returns true if frames at these times are even, as far as resampling is concerned.
///
/// - `period`: time between frames, in seconds
pub(super) fn are_even(seconds: &[f64], period: f64) -> bool {
    let Some(first) = seconds.first() else {
        return true;
    };
    let mut frames = seconds.iter().enumerate();
    frames.all(|(frame, time)| (time - first - frame as f64 * period).abs() <= EVEN * period)
}

/// Returns frames at even times, the first at the time of the first of `values`.
///
/// - `values`: frames, `[frames][taxels]`
/// - `seconds`: their times, which do not decrease
/// - `period`: time between the returned frames
pub(super) fn to_even(values: &[f64], taxels: usize, seconds: &[f64], period: f64) -> Vec<f64> {
    // Of frames with equal times the first one counts.
    let mut frames: Vec<usize> = Vec::with_capacity(seconds.len());
    for frame in 0..seconds.len() {
        if frames
            .last()
            .is_none_or(|&last| seconds[frame] > seconds[last])
        {
            frames.push(frame);
        }
    }
    let (Some(&first), Some(&last)) = (frames.first(), frames.last()) else {
        return Vec::new();
    };
    let count = count(seconds[last] - seconds[first], 1.0 / period);
    let mut even = Vec::with_capacity(count * taxels);
    let mut at = 0;
    for new in 0..count {
        let time = seconds[first] + new as f64 * period;
        while at + 2 < frames.len() && seconds[frames[at + 1]] <= time {
            at += 1;
        }
        let knots = [at.saturating_sub(1), at, at + 1, at + 2]
            .map(|knot| frames[knot.min(frames.len() - 1)]);
        for taxel in 0..taxels {
            let [p, q, r, s] = knots.map(|frame| (seconds[frame], values[frame * taxels + taxel]));
            even.push(cubic([p, q, r, s], time));
        }
    }
    even
}

/// Returns the value at a time between the second and the third of four points, by the cubic polynomial through them
/// whose slopes are those between their neighbours.
fn cubic([p, q, r, s]: [(f64, f64); 4], time: f64) -> f64 {
    let width = r.0 - q.0;
    if width <= 0.0 {
        return q.1;
    }
    let slope = |a: (f64, f64), b: (f64, f64)| (b.1 - a.1) / (b.0 - a.0);
    let middle = slope(q, r);
    // Slope of the parabola through three points; at an end, that of the line.
    let left = match q.0 > p.0 {
        true => (slope(p, q) * width + middle * (q.0 - p.0)) / (r.0 - p.0),
        false => middle,
    };
    let right = match s.0 > r.0 {
        true => (middle * (s.0 - r.0) + slope(r, s) * width) / (s.0 - q.0),
        false => middle,
    };
    let x = ((time - q.0) / width).clamp(0.0, 1.0);
    let (x2, x3) = (x * x, x * x * x);
    q.1 * (2.0 * x3 - 3.0 * x2 + 1.0)
        + r.1 * (3.0 * x2 - 2.0 * x3)
        + width * left * (x3 - 2.0 * x2 + x)
        + width * right * (x3 - x2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sine(frames: usize, rate: f64, hz: f64) -> Vec<f64> {
        (0..frames)
            .map(|frame| (2.0 * PI * hz * frame as f64 / rate + 0.3).sin())
            .collect()
    }

    /// Returns the largest difference of two signals, without a tenth at both ends.
    fn difference(found: &[f64], expected: &[f64]) -> f64 {
        let cut = found.len() / 10;
        let inner = found
            .iter()
            .zip(expected)
            .skip(cut)
            .take(found.len() - 2 * cut);
        inner.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
    }

    /// A difference of 1e-3 bounds the errors of amplitude and phase, in radians, by 1e-3.
    #[test]
    fn passed_frequencies_keep_amplitude_and_phase() {
        for (from, to, hz) in [
            (100.0, 50.0, 10.0),
            (1000.0, 750.0, 250.0),
            (750.0, 100.0, 33.0),
            (20.0, 100.0, 7.0),
            (138.8, 100.0, 39.0),
            (44.1, 100.0, 0.5),
        ] {
            let found = to_rate(&sine(3000, from, hz), 1, from, to);
            let expected = sine(found.len(), to, hz);
            let difference = difference(&found, &expected);
            assert!(
                difference < 1e-3,
                "{from} to {to} Hz, {hz} Hz: {difference}"
            );
        }
    }

    #[test]
    fn aliases_are_suppressed_by_60_db() {
        for (from, to, hz) in [
            (1000.0, 100.0, 51.0),
            (1000.0, 100.0, 130.0),
            (750.0, 333.3, 200.0),
            (138.8, 100.0, 50.5),
        ] {
            let found = to_rate(&sine(6000, from, hz), 1, from, to);
            let left = difference(&found, &vec![0.0; found.len()]);
            assert!(left < 1e-3, "{from} to {to} Hz, {hz} Hz: {left}");
        }
    }

    /// `scipy.signal.resample_poly` has the same sine in the middle of its output; ends are extended differently. The
    /// analytic values are exact to more digits than its filter.
    #[test]
    fn a_ramp_stays_a_ramp_up_to_the_ends() {
        let ramp: Vec<f64> = (0..50).map(|frame| 5e7 + 3.0 * f64::from(frame)).collect();
        let found = to_rate(&ramp, 1, 10.0, 7.0);
        assert_eq!(found.len(), 35);
        for (new, value) in found.iter().enumerate() {
            let expected = 5e7 + 30.0 * new as f64 / 7.0;
            assert!(
                (value - expected).abs() < 1e-2,
                "{new}: {value}, {expected}"
            );
        }
    }

    #[test]
    fn taxels_are_independent() {
        let both: Vec<f64> = sine(400, 100.0, 5.0)
            .iter()
            .zip(sine(400, 100.0, 9.0))
            .flat_map(|(a, b)| [*a, b])
            .collect();
        let found = to_rate(&both, 2, 100.0, 60.0);
        let second: Vec<f64> = found.iter().skip(1).step_by(2).copied().collect();
        assert_eq!(second, to_rate(&sine(400, 100.0, 9.0), 1, 100.0, 60.0));
    }

    /// Lost frames at ten times the signal's frequency: cubic polynomials miss by less than a hundredth.
    #[test]
    fn lost_frames_are_interpolated_at_their_times() {
        let seconds: Vec<f64> = (0..800)
            .filter(|frame| frame % 7 != 3)
            .map(|frame| f64::from(frame) / 100.0)
            .collect();
        let values: Vec<f64> = seconds
            .iter()
            .map(|time| (2.0 * PI * 3.0 * time + 0.3).sin())
            .collect();
        assert!(!are_even(&seconds, 0.01));
        let found = to_even(&values, 1, &seconds, 0.01);
        assert_eq!(found.len(), 800);
        assert!(difference(&found, &sine(800, 100.0, 3.0)) < 0.01);
    }

    #[test]
    fn equal_times_are_no_division_by_zero() {
        let found = to_even(&[1.0, 9.0, 2.0, 3.0], 1, &[0.0, 0.0, 1.0, 2.0], 0.5);
        assert_eq!(found.len(), 5);
        assert!(found.iter().all(|value| value.is_finite()));
        assert_eq!((found[0], found[2], found[4]), (1.0, 2.0, 3.0));
        assert_eq!(to_even(&[7.0], 1, &[4.0], 0.5), [7.0]);
    }

    proptest! {
        #[test]
        fn constants_stay_and_the_length_is_the_duration(frames in 1usize..200, from in 1.0..200.0, to in 1.0..200.0) {
            let found = to_rate(&vec![3.25; frames], 1, from, to);
            prop_assert!(found.iter().all(|value| (value - 3.25).abs() < 1e-9));
            let expected = (frames - 1) as f64 / from * to;
            prop_assert!((found.len() as f64 - 1.0 - expected).abs() <= 1.0);
        }
    }
}
