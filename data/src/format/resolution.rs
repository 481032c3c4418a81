//! Resolution that values lose when 64-bit floats are narrowed to 32 bits.
//!
//! A 32-bit float keeps 24 bits of a value. A signal on a large offset, such as a digit on a time stamp or a pressure in
//! Pa on that of the atmosphere, keeps what the offset leaves of them.

use std::path::Path;

use super::narrow::{HELD, TooWide, narrow};
use crate::{DataError, Finding, FindingKind, Place, Remedy, Samples, Severity, SweepShape};

/// Minimum number of steps of a 32-bit float across the usual range of a taxel within a sweep, from the 10 % to the 90 %
/// quantile. The rounding error is then at most 1.2 % of the standard deviation of noise, far below what a model can
/// learn; a sensor of 17 bits, whose noise is one digit, has at least 64.
const LEAST_LEVELS: f64 = 64.0;
/// The same for whole numbers, which are digits: their smallest step, 1, is a change that the sensor resolved, and eight
/// times as many steps are needed before its loss is as small.
const LEAST_WHOLE_LEVELS: f64 = 512.0;
/// Maximum number of frames of a sweep that are looked at.
const FRAMES: usize = 64;
/// Quantile of the sweeps that decides: in a quarter of them a finger moves the taxel.
const DECIDING_SWEEPS: f64 = 0.75;
/// Maximum number of sweeps that are looked at, and of their values: an offset is the same in all sweeps.
const SWEEPS: usize = 64;
const VALUES: usize = 1 << 22;

/// Some of the sweeps of a data set, as 64-bit floats; collected while the values are read.
#[derive(Debug)]
pub(super) struct SomeSweeps {
    /// Number of values of a sweep.
    of_sweep: usize,
    /// Every sweep of a number divisible by this one is kept.
    stride: usize,
    /// Number of values that were pushed.
    pushed: usize,
    values: Vec<f64>,
}

impl SomeSweeps {
    /// Returns an empty collection.
    ///
    /// - `extents`: dimensions of the array, the first of which counts sweeps; the first two if there are five
    pub(super) fn of_array(extents: &[usize]) -> Self {
        let leading = match extents.len() {
            0..=2 => 0,
            5.. => 2,
            _ => 1,
        };
        let sweeps: usize = extents[..leading].iter().product();
        Self::new(sweeps.max(1), extents[leading..].iter().product())
    }

    fn new(sweeps: usize, of_sweep: usize) -> Self {
        let most = SWEEPS.min(VALUES / of_sweep.max(1)).max(1);
        Self {
            of_sweep: of_sweep.max(1),
            stride: sweeps.div_ceil(most),
            pushed: 0,
            values: Vec::new(),
        }
    }

    /// Appends the next values of the array.
    pub(super) fn push(&mut self, mut piece: &[f64]) {
        while !piece.is_empty() {
            let (sweep, within) = (self.pushed / self.of_sweep, self.pushed % self.of_sweep);
            let (now, rest) = piece.split_at(piece.len().min(self.of_sweep - within));
            if sweep.is_multiple_of(self.stride) {
                self.values.extend_from_slice(now);
            }
            self.pushed += now.len();
            piece = rest;
        }
    }

    /// Appends the next `count` values of the array, which are decoded only if some of them are kept.
    pub(super) fn push_if_kept(&mut self, count: usize, decode: impl FnOnce() -> Vec<f64>) {
        let (first, last) = (self.pushed, self.pushed + count.saturating_sub(1));
        let mut sweeps = first / self.of_sweep..=last / self.of_sweep;
        if sweeps.any(|sweep| sweep.is_multiple_of(self.stride)) {
            self.push(&decode());
        } else {
            self.pushed += count;
        }
    }

    /// Succeeds if 32-bit floats keep the resolution of all taxels.
    ///
    /// # Errors
    /// A finding for each taxel that loses it.
    pub(super) fn check(&self, path: &Path, shape: SweepShape) -> Result<(), DataError> {
        refuse(path, shape, &lost_resolution(&self.values, shape))
    }
}

/// Converts sweeps to their smallest element type.
///
/// - `values`: `[sweeps][steps][rows][cols]`
///
/// # Errors
/// A value beyond the range of 32-bit floats; a finding for each taxel that loses its resolution.
pub(super) fn narrow_sweeps(
    path: &Path,
    shape: SweepShape,
    values: &[f64],
) -> Result<Samples, DataError> {
    let samples =
        narrow(values).map_err(|TooWide(value)| DataError::format(path, "taxels", HELD, value))?;
    if matches!(samples, Samples::F32(_)) {
        check_resolution(path, shape, values)?;
    }
    Ok(samples)
}

/// Succeeds if 32-bit floats keep the resolution of all taxels.
///
/// - `values`: `[sweeps][steps][rows][cols]`
///
/// # Errors
/// A finding for each taxel that loses it.
pub(super) fn check_resolution(
    path: &Path,
    shape: SweepShape,
    values: &[f64],
) -> Result<(), DataError> {
    let mut some = SomeSweeps::new(values.len() / shape.values().max(1), shape.values());
    some.push(values);
    some.check(path, shape)
}

impl Samples {
    /// Converts sweeps to their smallest element type.
    ///
    /// - `values`: `[sweeps][steps][rows][cols]`
    ///
    /// # Errors
    /// A value beyond the range of 32-bit floats; a taxel that loses its resolution as one.
    ///
    /// ```
    /// use tactnet_data::{Remedy, Samples, SweepShape};
    ///
    /// let shape = SweepShape { steps: 4, rows: 1, cols: 1 };
    /// let samples = Samples::from_f64(&[0.0, 0.5, 0.25, 1.0], shape)?;
    /// assert_eq!(samples, Samples::F32(vec![0.0, 0.5, 0.25, 1.0]));
    ///
    /// let clock = [0.0, 1.0, 2.0, 3.0].map(|second| 1.6e9 + second);
    /// let error = Samples::from_f64(&clock, shape).unwrap_err();
    /// let reason = "moves by 1; a 32-bit float keeps steps of 128 there";
    /// assert!(error.to_string().ends_with(reason));
    /// assert_eq!(error.remedy(), Some(Remedy::SubtractOffset));
    /// # Ok::<(), tactnet_data::DataError>(())
    /// ```
    pub fn from_f64(values: &[f64], shape: SweepShape) -> Result<Self, DataError> {
        narrow_sweeps(Path::new("values"), shape, values)
    }
}

/// Taxel whose values lose their resolution.
#[derive(Debug, Clone, PartialEq)]
struct LostResolution {
    taxel: usize,
    /// Offset of the values.
    level: f64,
    /// Usual change between frames; of whole numbers the smallest.
    change: f64,
    /// Distance of neighbouring 32-bit floats at the level.
    kept: f64,
}

fn refuse(path: &Path, shape: SweepShape, lost: &[LostResolution]) -> Result<(), DataError> {
    if lost.is_empty() {
        return Ok(());
    }
    let finding = |lost: &LostResolution| {
        let message = format!(
            "taxel ({}, {}) lies near {:e} and moves by {}; a 32-bit float keeps steps of {} there",
            lost.taxel / shape.cols,
            lost.taxel % shape.cols,
            three_digits(lost.level),
            three_digits(lost.change),
            lost.kept,
        );
        let at = Place {
            file: Some(path.into()),
            taxel: Some(lost.taxel),
            ..Place::default()
        };
        Finding::new(Severity::Error, FindingKind::Unreadable, message)
            .at(at)
            .with_remedy(Remedy::SubtractOffset)
    };
    Err(DataError::Unreadable {
        path: path.into(),
        findings: lost.iter().map(finding).collect(),
    })
}

/// Returns the number rounded to three digits.
fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// Returns the taxels whose values lose their resolution as 32-bit floats.
///
/// - `sweeps`: `[sweeps][steps][rows][cols]`; an incomplete sweep at the end is not looked at, if there are others
fn lost_resolution(sweeps: &[f64], shape: SweepShape) -> Vec<LostResolution> {
    let taxels = 0..shape.taxels();
    taxels
        .filter_map(|taxel| lost_in_taxel(sweeps, shape, taxel))
        .collect()
}

fn lost_in_taxel(sweeps: &[f64], shape: SweepShape, taxel: usize) -> Option<LostResolution> {
    // Range within a sweep, in steps of a 32-bit float, with the level.
    let mut ranges: Vec<(f64, f64)> = Vec::new();
    let mut changes: Vec<f64> = Vec::new();
    let (mut is_whole, mut is_exact) = (true, true);
    for sweep in sweeps.chunks_exact(shape.values()) {
        let of_taxel = sweep.get(taxel..).unwrap_or_default();
        let of_taxel = of_taxel.iter().step_by(shape.taxels());
        let of_taxel: Vec<f64> = of_taxel
            .copied()
            .filter(|value| value.is_finite())
            .collect();
        is_whole &= of_taxel.iter().all(|value| value.fract() == 0.0);
        is_exact &= of_taxel
            .iter()
            .all(|&value| f64::from(value as f32) == value);
        let between = of_taxel.array_windows().map(|[a, b]| (b - a).abs());
        changes.extend(between.filter(|change| *change > 0.0).take(FRAMES));
        let stride = of_taxel.len().div_ceil(FRAMES).max(1);
        let mut sorted: Vec<f64> = of_taxel.into_iter().step_by(stride).collect();
        sorted.sort_by(f64::total_cmp);
        let Some(last) = sorted.len().checked_sub(1) else {
            continue;
        };
        let (level, tenth) = (sorted[last / 2], last / 10);
        let range = match sorted[last - tenth] - sorted[tenth] {
            0.0 => sorted[last] - sorted[0],
            range => range,
        };
        if range > 0.0 {
            ranges.push((range / step_of_f32(level), level));
        }
    }
    ranges.sort_by(|a, b| a.0.total_cmp(&b.0));
    let deciding = (DECIDING_SWEEPS * ranges.len() as f64) as usize;
    let &(levels, level) = ranges.get(deciding)?;
    changes.sort_by(f64::total_cmp);
    let (&smallest, &usual) = (changes.first()?, changes.get(changes.len() / 2)?);
    let kept = step_of_f32(level);
    let (least, change) = match is_whole {
        true => (LEAST_WHOLE_LEVELS, smallest),
        false => (LEAST_LEVELS, usual),
    };
    (levels < least && !is_exact).then_some(LostResolution {
        taxel,
        level,
        change,
        kept,
    })
}

/// Returns the distance of neighbouring 32-bit floats at this value.
fn step_of_f32(value: f64) -> f64 {
    let value = value.abs() as f32;
    f64::from(value.next_up()) - f64::from(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPE: SweepShape = SweepShape {
        steps: 100,
        rows: 1,
        cols: 3,
    };

    /// Returns eight sweeps of uniform noise of width `width` around `offset` in the second taxel, and around 0 in others.
    fn noise(offset: f64, width: f64, is_whole: bool) -> Vec<f64> {
        let mut state = 7_u64;
        let mut value = |place: usize| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let noise = width * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5);
            let noise = if is_whole { noise.round() } else { noise };
            if place % 3 == 1 {
                offset + noise
            } else {
                noise
            }
        };
        (0..8 * SHAPE.values()).map(&mut value).collect()
    }

    #[test]
    fn signals_on_large_offsets_lose_their_resolution() {
        for (offset, width, is_whole, change, kept) in [
            (1.6e9, 40.0, true, 1.0, 128.0),
            (1.6e9, 1.0, false, 0.3, 128.0),
            (5e7, 100.0, false, 30.0, 4.0),
            (5e7, 1000.0, true, 1.0, 4.0),
            (-5e7, 3.0, false, 0.9, 4.0),
            (1e5, 0.1, false, 0.03, 1.0 / 128.0),
        ] {
            let lost = lost_resolution(&noise(offset, width, is_whole), SHAPE);
            assert_eq!(lost.len(), 1, "{offset} {width}");
            assert_eq!((lost[0].taxel, lost[0].kept), (1, kept));
            assert!((lost[0].level - offset).abs() <= width);
            assert!(
                (0.8 * change..1.2 * change).contains(&lost[0].change),
                "{:?}",
                lost[0]
            );
        }
    }

    #[test]
    fn noise_far_above_its_rounding_error_keeps_its_resolution() {
        for (offset, width, is_whole) in [
            (0.0, 1e-9, false),
            (1.0, 0.1, false),
            (101_325.0, 2.0, false),
            // Digits of 24 bits are exact, and those of 32 bits may have a noise of thousands.
            (16_000_000.0, 3.0, true),
            (1e9, 1e6, true),
            (5e7, 2000.0, false),
        ] {
            let lost = lost_resolution(&noise(offset, width, is_whole), SHAPE);
            assert_eq!(lost, [], "{offset} {width}");
        }
    }

    #[test]
    fn fill_values_gaps_and_32_bit_values_lose_nothing() {
        let mut values = noise(20.0, 1.0, false);
        values
            .iter_mut()
            .step_by(97)
            .for_each(|value| *value = 1e20);
        values
            .iter_mut()
            .step_by(89)
            .for_each(|value| *value = f64::NAN);
        assert_eq!(lost_resolution(&values, SHAPE), []);
        let rounded = noise(1.6e9, 1000.0, false).into_iter();
        let rounded: Vec<f64> = rounded.map(|value| f64::from(value as f32)).collect();
        assert_eq!(lost_resolution(&rounded, SHAPE), []);
    }

    #[test]
    fn some_sweeps_are_kept_of_pieces_of_any_length() {
        let values: Vec<f64> = (0..1000 * 6).map(f64::from).collect();
        for piece in [1, 7, 64, 6000] {
            let mut some = SomeSweeps::of_array(&[1000, 3, 2]);
            values.chunks(piece).for_each(|piece| some.push(piece));
            let first: Vec<f64> = some.values.iter().step_by(6).copied().collect();
            let expected: Vec<f64> = (0..63).map(|kept| f64::from(kept * 16 * 6)).collect();
            assert_eq!(first, expected);
            assert_eq!(some.values.len(), 63 * 6);
        }
    }
}
