//! Search for what makes sweeps unlike the training sweeps: changes that are undone in turn, until the sweeps are like them.

use tactnet_data::SweepView;
use tactnet_models::Features;

use super::descriptor::DescriptionPart;
use super::distances::Distance;
use super::{Difference, Likeness, Property, TaxelOrder};

/// Maximum number of sweeps that changes are undone in.
const MAX_SWEEPS: usize = 60;
/// Share of sweeps in which a taxel does not change that makes it a constant taxel.
const CONSTANT_SHARE: f64 = 0.8;
/// Maximum share of training sweeps in which such a taxel may be constant.
const USUALLY_CONSTANT: f64 = 0.2;
/// Number of taxels with the largest deviations that are exchanged, or whose signs are changed, one by one.
const SUSPECTS: usize = 8;
/// Maximum number of exchanged pairs of taxels.
const MAX_EXCHANGES: usize = 4;
/// Maximum number of taxels of which all orders and signs are tried.
const MAX_AXES: usize = 4;
/// Share of the excess distance that may remain after a change has been undone that explains it.
const REMAINDER: f64 = 0.35;
/// Factors between units: g and m/s², thousands, hundreds, degrees and radians, bits.
const UNITS: [f64; 7] = [9.806_65, 1000.0, 100.0, 57.295_78, 4.0, 16.0, 256.0];
/// Speeds relative to the training sweeps.
const SPEEDS: [f64; 8] = [0.25, 0.5, 0.667, 0.8, 1.25, 1.5, 2.0, 4.0];

/// Returns what differs, most important first.
///
/// - `constant`: true for taxels that do not change, `[sweeps][taxels]`
pub(super) fn find_differences(
    likeness: &Likeness,
    view: &SweepView<'_>,
    constant: &[Vec<bool>],
) -> Vec<Difference> {
    let search = Search::new(likeness, view);
    let found = search.best_change().filter(|of| search.explains(of.excess));
    let found = found.map(|of| of.difference);
    let taxels = search.constant_taxels(constant);
    // In another order, taxels that are hardly touched are at other places.
    if !matches!(found, Some(Difference::Order { .. })) && !taxels.is_empty() {
        return vec![Difference::ConstantTaxels { taxels }];
    }
    vec![found.unwrap_or_else(|| search.property())]
}

/// Search for the change that explains the distance of some sweeps.
struct Search<'a> {
    likeness: &'a Likeness,
    /// `[sweeps][steps * taxels]`
    sweeps: Vec<Vec<f32>>,
    descriptions: Features,
    distances: Vec<Distance>,
    /// Mean excess of the logarithmic distance.
    excess: f64,
}

/// A change, and the mean excess distance after it has been undone.
struct Undone {
    difference: Difference,
    excess: f64,
}

impl<'a> Search<'a> {
    fn new(likeness: &'a Likeness, view: &SweepView<'_>) -> Self {
        let number = view.len().min(MAX_SWEEPS);
        let sweeps: Vec<Vec<f32>> = (0..number)
            .map(|at| view.sweep(at * view.len() / number))
            .collect();
        let descriptions = likeness.descriptor.of_sweeps(&sweeps);
        let distances = likeness.distances.of(&descriptions);
        Self {
            excess: mean_excess(likeness, &distances),
            likeness,
            sweeps,
            descriptions,
            distances,
        }
    }

    fn taxels(&self) -> usize {
        self.likeness.descriptor.taxels()
    }

    /// Returns true if the remaining excess is small.
    fn explains(&self, excess: f64) -> bool {
        excess < REMAINDER * self.excess
    }

    /// Returns the taxels that do not change, but usually do in training sweeps.
    fn constant_taxels(&self, constant: &[Vec<bool>]) -> Vec<usize> {
        let least = CONSTANT_SHARE * constant.len() as f64;
        (0..self.taxels())
            .filter(|taxel| {
                let sweeps = constant.iter().filter(|of| of[*taxel]).count();
                sweeps as f64 >= least && self.likeness.constant.share(*taxel) < USUALLY_CONSTANT
            })
            .collect()
    }

    /// Returns the change that leaves the smallest excess after it has been undone.
    fn best_change(&self) -> Option<Undone> {
        let changes = self.signs().into_iter().chain(self.speeds());
        let changes = changes.chain(self.orders()).chain(self.scale());
        changes.min_by(|a, b| a.excess.total_cmp(&b.excess))
    }

    /// Undoes a change of the sweeps.
    fn undo(&self, difference: Difference, change: impl Fn(&[f32]) -> Vec<f32>) -> Undone {
        let sweeps: Vec<Vec<f32>> = self.sweeps.iter().map(|sweep| change(sweep)).collect();
        let descriptions = self.likeness.descriptor.of_sweeps(&sweeps);
        Undone {
            excess: self.excess_of(&descriptions),
            difference,
        }
    }

    fn excess_of(&self, descriptions: &Features) -> f64 {
        mean_excess(self.likeness, &self.likeness.distances.of(descriptions))
    }

    fn scale(&self) -> Option<Undone> {
        let undo = |factor: f64| {
            self.undo(Difference::Scale { factor }, |sweep| {
                sweep
                    .iter()
                    .map(|value| (f64::from(*value) / factor) as f32)
                    .collect()
            })
        };
        let spread = self.spread_ratio(&self.descriptions, &self.distances);
        let units = UNITS.into_iter().flat_map(|unit| [unit, 1.0 / unit]);
        let mut best = units
            .chain([spread])
            .map(undo)
            .min_by(|a, b| a.excess.total_cmp(&b.excess))?;
        // The nearest materials, and so the factor, are better known after a first correction.
        for _ in 0..3 {
            let Difference::Scale { factor } = best.difference else {
                break;
            };
            let sweeps: Vec<Vec<f32>> = self
                .sweeps
                .iter()
                .map(|sweep| {
                    sweep
                        .iter()
                        .map(|v| (f64::from(*v) / factor) as f32)
                        .collect()
                })
                .collect();
            let descriptions = self.likeness.descriptor.of_sweeps(&sweeps);
            let ratio =
                self.spread_ratio(&descriptions, &self.likeness.distances.of(&descriptions));
            let next = undo(factor * ratio);
            if next.excess >= best.excess {
                break;
            }
            best = next;
        }
        Some(best)
    }

    /// Returns the median ratio of the spread of a taxel to that of the nearest material.
    fn spread_ratio(&self, descriptions: &Features, distances: &[Distance]) -> f64 {
        let Likeness {
            descriptor,
            distances: fitted,
            ..
        } = self.likeness;
        let mut ratios: Vec<f64> = Vec::new();
        for (row, distance) in descriptions.rows().zip(distances) {
            let deviation = fitted.deviation(row, distance.nearest);
            let spreads = (0..row.len())
                .filter(|value| descriptor.part(*value) == DescriptionPart::Spread)
                .map(|value| deviation[value] * f64::from(fitted.scale()[value]));
            ratios.extend(spreads);
        }
        ratios.sort_unstable_by(f64::total_cmp);
        ratios.get(ratios.len() / 2).copied().unwrap_or(0.0).exp()
    }

    fn signs(&self) -> Vec<Undone> {
        let taxels = self.taxels();
        let mut sets: Vec<Vec<usize>> = vec![Vec::new()];
        if taxels <= MAX_AXES {
            let all = 1..(1usize << taxels) - 1;
            sets.extend(all.map(|set| (0..taxels).filter(|t| set >> t & 1 == 1).collect()));
        } else {
            sets.extend(self.suspects().into_iter().map(|taxel| vec![taxel]));
        }
        sets.into_iter()
            .map(|set| {
                let is_changed = |at: usize| set.is_empty() || set.contains(&(at % taxels));
                let difference = Difference::Sign {
                    taxels: set.clone(),
                };
                self.undo(difference, |sweep| {
                    let values = sweep.iter().enumerate();
                    values
                        .map(|(at, value)| if is_changed(at) { -value } else { *value })
                        .collect()
                })
            })
            .collect()
    }

    fn speeds(&self) -> Vec<Undone> {
        let taxels = self.taxels();
        SPEEDS
            .into_iter()
            .map(|factor| {
                self.undo(Difference::Speed { factor }, |sweep| {
                    at_speed(sweep, taxels, 1.0 / factor)
                })
            })
            .collect()
    }

    fn orders(&self) -> Vec<Undone> {
        let shape = self.likeness.descriptor.shape();
        let (rows, cols, taxels) = (shape.rows, shape.cols, shape.taxels());
        let mut named = Vec::new();
        if rows > 1 && cols > 1 {
            named.extend([
                TaxelOrder::Rotated { degrees: 180 },
                TaxelOrder::MirroredColumns,
                TaxelOrder::MirroredRows,
                TaxelOrder::Transposed,
            ]);
        } else if taxels > 1 {
            named.push(TaxelOrder::Reversed);
        }
        if rows == cols && rows > 1 {
            let quarters = [90, 270].map(|degrees| TaxelOrder::Rotated { degrees });
            named.extend(quarters);
        }
        let named = named.into_iter().map(|order| {
            let places = order.places(shape);
            self.reorder(order, &places)
        });
        let mut found: Vec<Undone> = named.collect();
        if taxels > 1 && taxels <= MAX_AXES {
            for places in permutations(taxels) {
                let order = TaxelOrder::Permuted {
                    places: places.clone(),
                };
                found.push(self.reorder(order, &places));
            }
        } else if taxels > 1 {
            found.extend(self.exchanges());
        }
        found
    }

    /// Undoes another order of the taxels.
    ///
    /// - `places`: place of every taxel of the training sweeps
    fn reorder(&self, order: TaxelOrder, places: &[usize]) -> Undone {
        self.undo(Difference::Order { order }, |sweep| {
            let frames = sweep.chunks_exact(places.len());
            let frames = frames.flat_map(|frame| places.iter().map(|place| frame[*place]));
            frames.collect()
        })
    }

    /// Exchanges pairs of suspicious taxels as long as each exchange lowers the distance.
    fn exchanges(&self) -> Option<Undone> {
        let suspects = self.suspects();
        let mut places: Vec<usize> = (0..self.taxels()).collect();
        let mut pairs: Vec<[usize; 2]> = Vec::new();
        let mut best: Option<Undone> = None;
        for _ in 0..MAX_EXCHANGES {
            let least = best.as_ref().map_or(self.excess, |best| best.excess);
            let mut next: Option<(Undone, [usize; 2])> = None;
            for (at, &first) in suspects.iter().enumerate() {
                for &second in &suspects[at + 1..] {
                    let mut tried = places.clone();
                    tried.swap(first, second);
                    let pair = [first.min(second), first.max(second)];
                    let order = TaxelOrder::Exchanged {
                        pairs: pairs.iter().copied().chain([pair]).collect(),
                    };
                    let undone = self.reorder(order, &tried);
                    let bound = next.as_ref().map_or(least, |(next, _)| next.excess);
                    if undone.excess < bound {
                        next = Some((undone, [first, second]));
                    }
                }
            }
            let Some((undone, [first, second])) = next else {
                break;
            };
            // An exchange that explains little more is one of noise.
            if best.is_some() && undone.excess > least - 0.1 * self.excess.abs() {
                break;
            }
            places.swap(first, second);
            pairs.push([first, second]);
            best = Some(undone);
        }
        best
    }

    /// Returns the taxels that deviate most from the nearest materials, the largest deviation first.
    fn suspects(&self) -> Vec<usize> {
        let descriptor = &self.likeness.descriptor;
        let squares = self.mean_squares();
        let of_taxel = |taxel: usize| {
            let group = taxel * descriptor.groups() / descriptor.taxels();
            squares[group] + squares[descriptor.groups() + group]
        };
        let mut taxels: Vec<usize> = (0..self.taxels()).collect();
        taxels.sort_by(|a, b| of_taxel(*b).total_cmp(&of_taxel(*a)));
        taxels.truncate(SUSPECTS);
        taxels
    }

    /// Returns the mean square deviation of every value of the descriptions.
    fn mean_squares(&self) -> Vec<f64> {
        let mut sums = vec![0.0; self.descriptions.width()];
        for (row, distance) in self.descriptions.rows().zip(&self.distances) {
            let deviation = self.likeness.distances.deviation(row, distance.nearest);
            for (sum, deviation) in sums.iter_mut().zip(deviation) {
                *sum += deviation * deviation;
            }
        }
        let sweeps = self.descriptions.len() as f64;
        sums.into_iter().map(|sum| sum / sweeps).collect()
    }

    /// Returns the property with the largest deviation.
    fn property(&self) -> Difference {
        let descriptor = &self.likeness.descriptor;
        let squares = self.mean_squares();
        let mean_of = |part: DescriptionPart| {
            let own = (0..squares.len()).filter(|value| descriptor.part(*value) == part);
            let own: Vec<f64> = own.map(|value| squares[value]).collect();
            own.iter().sum::<f64>() / own.len().max(1) as f64
        };
        let parts = [
            (DescriptionPart::Level, Property::Level),
            (DescriptionPart::Spread, Property::Spread),
            (DescriptionPart::Change, Property::Change),
            (DescriptionPart::Spectrum, Property::Spectrum),
        ];
        let means = parts.map(|(part, property)| (mean_of(part), part, property));
        let largest = means.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
        let (mean, part, property) =
            largest.unwrap_or((0.0, DescriptionPart::Level, Property::Level));
        let first = (0..squares.len()).find(|value| descriptor.part(*value) == part);
        let mut taxels: Vec<usize> = Vec::new();
        if let (Some(first), false) = (first, part == DescriptionPart::Spectrum) {
            let is_own_group = descriptor.groups() == descriptor.taxels();
            let far = (0..descriptor.groups()).filter(|group| squares[first + group] > 2.0 * mean);
            taxels.extend(far.filter(|_| is_own_group).take(SUSPECTS));
        }
        Difference::Property {
            property,
            deviation: mean.sqrt(),
            taxels,
        }
    }
}

/// Returns the mean excess of the logarithmic distance over the typical one.
fn mean_excess(likeness: &Likeness, distances: &[Distance]) -> f64 {
    let sum: f64 = distances
        .iter()
        .map(|of| likeness.within.excess_of(of))
        .sum();
    sum / distances.len() as f64
}

/// Returns a sweep as it would be at another speed, by linear interpolation: shorter at a higher speed, and cut to its
/// length at a lower one.
///
/// - `speed`: speed relative to that of `sweep`
fn at_speed(sweep: &[f32], taxels: usize, speed: f64) -> Vec<f32> {
    let steps = sweep.len() / taxels;
    let kept = ((steps as f64 / speed) as usize).clamp(4.min(steps), steps);
    let mut changed = Vec::with_capacity(kept * taxels);
    for step in 0..kept {
        let time = (step as f64 * speed).min((steps - 1) as f64);
        let before = time as usize;
        let after = (before + 1).min(steps - 1);
        let share = (time - before as f64) as f32;
        changed.extend((0..taxels).map(|taxel| {
            let [a, b] = [before, after].map(|step| sweep[step * taxels + taxel]);
            a + share * (b - a)
        }));
    }
    changed
}

/// Returns all orders of `number` items except the given one.
fn permutations(number: usize) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new()];
    for item in 0..number {
        all = all
            .into_iter()
            .flat_map(|order: Vec<usize>| {
                (0..=order.len()).map(move |at| {
                    let mut longer = order.clone();
                    longer.insert(at, item);
                    longer
                })
            })
            .collect();
    }
    all.retain(|order| !order.iter().enumerate().all(|(at, item)| at == *item));
    all
}
