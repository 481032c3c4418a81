//! Values that programs write in the place of missing ones.

use std::collections::{BTreeMap, BTreeSet};

use super::finding;
use super::sweep_statistics::SweepStatistics;
use super::taxel_limits::TaxelLimits;
use super::taxel_names::taxel_name;
use crate::{Dataset, Finding, FindingKind, Place, Severity};

/// Values that programs write for missing ones, with their origin.
const KNOWN: &[(f32, Origin)] = &[
    (1e20, Origin::Program("masked arrays of NumPy")),
    (-1e20, Origin::Program("masked arrays of NumPy")),
    (9.969_21e36, Origin::Program("NetCDF")),
    (1e30, Origin::Program("many programs")),
    (-1e30, Origin::Program("many programs")),
    (1e35, Origin::Program("many programs")),
    (1e36, Origin::Program("many programs")),
    (1e37, Origin::Program("many programs")),
    (f32::MAX, Origin::Limit("32-bit floats, at the upper end")),
    (f32::MIN, Origin::Limit("32-bit floats, at the lower end")),
    (-999.0, Origin::Program("many data loggers")),
    (-999.9, Origin::Program("many data loggers")),
    (-999.99, Origin::Program("many data loggers")),
    (-9999.0, Origin::Program("many data loggers")),
    (-9999.9, Origin::Program("many data loggers")),
    (-9999.99, Origin::Program("many data loggers")),
    (-99999.0, Origin::Program("many data loggers")),
    (999.0, Origin::Program("many data loggers")),
    (999.9, Origin::Program("many data loggers")),
    (999.99, Origin::Program("many data loggers")),
    (9999.0, Origin::Program("many data loggers")),
    (9999.9, Origin::Program("many data loggers")),
    (9999.99, Origin::Program("many data loggers")),
    (99999.0, Origin::Program("many data loggers")),
    (999_999.0, Origin::Program("many data loggers")),
    (-32767.0, Origin::Limit("16-bit integers, in NetCDF")),
    (-32768.0, Origin::Limit("16-bit integers, at the lower end")),
    (32767.0, Origin::Limit("16-bit integers, at the upper end")),
    (65535.0, Origin::Limit("unsigned 16-bit integers")),
    (
        8_388_607.0,
        Origin::Limit("24-bit integers, at the upper end"),
    ),
    (
        -8_388_608.0,
        Origin::Limit("24-bit integers, at the lower end"),
    ),
    (16_777_215.0, Origin::Limit("unsigned 24-bit integers")),
    (
        2_147_483_648.0,
        Origin::Limit("32-bit integers, at the upper end"),
    ),
    (
        -2_147_483_648.0,
        Origin::Limit("32-bit integers, at the lower end"),
    ),
    (4_294_967_296.0, Origin::Limit("unsigned 32-bit integers")),
    (
        9_223_372_036_854_775_808.0,
        Origin::Limit("64-bit integers, at the upper end"),
    ),
    (
        -9_223_372_036_854_775_808.0,
        Origin::Limit("64-bit integers, at the lower end"),
    ),
];
/// Distance of a fill value from the usual values of its taxel, in their largest usual deviations. A sensor that may show
/// such a number as an honest value reaches it from values nearby.
const FAR: f32 = 3.0;
/// Maximum share of sweeps whose values reach half of the way to a fill value: they may have other foreign values.
const NEAR_SHARE: f64 = 0.01;
/// Maximum number of such values in a sweep with the fill value; a sensor that saturates shows more.
const NEAR_VALUES: usize = 2;

/// Origin of a fill value.
#[derive(Clone, Copy)]
enum Origin {
    /// Programs that write it.
    Program(&'static str),
    /// Number type whose limit it is; a saturated sensor shows it, too.
    Limit(&'static str),
}

/// Fill values of a data set, by taxel.
pub(super) struct FillValues {
    /// Taxel and bits of the value, with the origin.
    of_taxel: BTreeMap<(usize, u32), Origin>,
}

/// Values of one sweep that are one fill value.
struct Occurrences {
    count: usize,
    first: usize,
    origin: Origin,
}

impl FillValues {
    /// Returns the known fill values that are far from all other values of their taxel.
    pub(super) fn of(
        dataset: &Dataset,
        sweeps: &[SweepStatistics],
        limits: &[TaxelLimits],
    ) -> Self {
        let mut of_taxel = BTreeMap::new();
        let mut refused = BTreeSet::new();
        let all: Vec<usize> = (0..limits.len()).collect();
        for (taxel, limits) in limits.iter().enumerate() {
            for (index, sweep) in sweeps.iter().enumerate() {
                let (low, high) = sweep.taxels[taxel];
                for value in [low, high] {
                    let Some(origin) = known(value) else {
                        continue;
                    };
                    let key = (taxel, value.to_bits());
                    if limits.distance(value) < FAR
                        || of_taxel.contains_key(&key)
                        || refused.contains(&key)
                    {
                        continue;
                    }
                    let way = HalfWay {
                        value,
                        middle: limits.median + 0.5 * (value - limits.median),
                        taxels: match origin {
                            Origin::Program(_) => &[taxel],
                            // The values of a saturated sensor lead to the limit in one taxel or another.
                            Origin::Limit(_) => &all,
                        },
                    };
                    if way.is_empty(sweeps) && way.is_empty_in(&dataset.sweep(index), all.len()) {
                        of_taxel.insert(key, origin);
                    } else {
                        refused.insert(key);
                    }
                }
            }
        }
        Self { of_taxel }
    }

    /// Returns true if there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.of_taxel.is_empty()
    }

    /// Returns true if `value` is a fill value of this taxel.
    pub(super) fn contains(&self, taxel: usize, value: f32) -> bool {
        self.of_taxel.contains_key(&(taxel, value.to_bits()))
    }

    /// Returns true if `value` is a fill value of any taxel.
    pub(super) fn contains_value(&self, value: f32) -> bool {
        let mut keys = self.of_taxel.keys();
        keys.any(|(_, bits)| *bits == value.to_bits())
    }

    /// Returns true if the sweep contains a fill value.
    pub(super) fn are_in(&self, sweep: &SweepStatistics) -> bool {
        let mut taxels = sweep.taxels.iter().enumerate();
        !self.is_empty()
            && taxels.any(|(taxel, (low, high))| {
                self.contains(taxel, *low) || self.contains(taxel, *high)
            })
    }

    /// Returns an error for each fill value of each sweep.
    pub(super) fn findings(&self, dataset: &Dataset, sweeps: &[SweepStatistics]) -> Vec<Finding> {
        let filled = sweeps.iter().enumerate();
        let filled = filled.filter(|(_, sweep)| self.are_in(sweep));
        filled
            .flat_map(|(index, _)| self.findings_in(dataset, index))
            .collect()
    }

    fn findings_in(&self, dataset: &Dataset, index: usize) -> Vec<Finding> {
        let shape = dataset.shape();
        let mut found: BTreeMap<u32, Occurrences> = BTreeMap::new();
        for (place, value) in dataset.sweep(index).into_iter().enumerate() {
            let key = (place % shape.taxels(), value.to_bits());
            if let Some(&origin) = self.of_taxel.get(&key) {
                let new = || Occurrences {
                    count: 0,
                    first: place,
                    origin,
                };
                found.entry(key.1).or_insert_with(new).count += 1;
            }
        }
        let finding = |(bits, found): (u32, Occurrences)| {
            let (step, taxel) = (found.first / shape.taxels(), found.first % shape.taxels());
            let meaning = match found.origin {
                Origin::Program(writer) => {
                    format!("which {writer} write for missing values")
                }
                Origin::Limit(of) => format!("the limit of {of}, far from all other values"),
            };
            let message = format!(
                "{}: {} value{} {}, {meaning}; the first at step {step}, taxel {}",
                dataset.describe(index),
                found.count,
                if found.count == 1 { " is" } else { "s are" },
                f32::from_bits(bits),
                taxel_name(shape, taxel),
            );
            let at = Place {
                sweep: Some(index),
                taxel: Some(taxel),
                step: Some(step),
                ..Place::default()
            };
            finding(Severity::Error, FindingKind::FillValue, at, message)
        };
        found.into_iter().map(finding).collect()
    }
}

fn known(value: f32) -> Option<Origin> {
    let known = KNOWN.iter().find(|(known, _)| *known == value);
    known.map(|(_, origin)| *origin)
}

/// Returns true if programs write `value` for missing values; a sensor may measure it, too.
pub(super) fn is_known_fill(value: f32) -> bool {
    known(value).is_some()
}

/// Values between the usual ones and a fill value.
struct HalfWay<'a> {
    value: f32,
    middle: f32,
    taxels: &'a [usize],
}

impl HalfWay<'_> {
    /// Returns true if hardly any sweep has other values that reach half of the way.
    fn is_empty(&self, sweeps: &[SweepStatistics]) -> bool {
        let near = |sweep: &&SweepStatistics| {
            self.taxels.iter().any(|&taxel| {
                let (low, high) = sweep.taxels[taxel];
                self.is_near(low) || self.is_near(high)
            })
        };
        let near = sweeps.iter().filter(near).count();
        near as f64 <= NEAR_SHARE * sweeps.len() as f64
    }

    /// Returns true if hardly any other value of a sweep reaches half of the way.
    fn is_empty_in(&self, sweep: &[f32], taxels: usize) -> bool {
        let frames = sweep.chunks_exact(taxels);
        let values = frames.flat_map(|frame| self.taxels.iter().map(|&taxel| frame[taxel]));
        values.filter(|value| self.is_near(*value)).count() <= NEAR_VALUES
    }

    fn is_near(&self, other: f32) -> bool {
        let is_beyond = if self.value > self.middle {
            other > self.middle
        } else {
            other < self.middle
        };
        is_beyond && other.is_finite() && !is_known_fill(other)
    }
}
