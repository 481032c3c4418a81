//! Complex Fourier transforms over time, one map per lane.
//!
//! Stockham's self-sorting form: every pass divides the length by one radix and leaves the next pass's input in order. So there is no
//! bit reversal and, since lanes are maps, no shuffling. The first pass reads and the last pass writes through a table of rows, which handles
//! zero padding, the kernel's wrap around zero and cropping at no cost. These rows are far apart in memory, so their cache lines are
//! prefetched one pass or one transform ahead. The unscaled inverse transform is the forward one with real and imaginary parts exchanged.

use super::butterfly::butterfly;
use super::simd::{
    Kernel, Lanes, NOTHING, Octet, Reader, Rows, Sequence, Table, WRITTEN, Writer, unrolled,
};

/// Transform of one length.
#[derive(Debug, Clone)]
pub(super) struct TimePlan {
    length: usize,
    passes: Vec<Pass>,
    /// Rows of the buffers between passes, in order.
    order: Table,
}

#[derive(Debug, Clone)]
struct Pass {
    radix: usize,
    /// Number of groups of butterflies; groups differ in their twiddle factors.
    groups: usize,
    /// Number of butterflies in a group, which share twiddle factors.
    stride: usize,
    /// `[groups, radix, 2]`: cosine and sine
    twiddles: Vec<[f32; 2]>,
}

impl TimePlan {
    /// Plans the shortest length of at least `least` that is a product of the radices, in the fewest passes.
    pub(super) fn at_least(least: usize) -> Self {
        let (length, radices) = smooth(least);
        Self::new(length, &radices)
    }

    /// Returns the length that [`TimePlan::at_least`] plans.
    pub(super) fn length_for(least: usize) -> usize {
        smooth(least).0
    }

    fn new(length: usize, radices: &[usize]) -> Self {
        let mut passes = Vec::new();
        let (mut left, mut stride) = (length, 1);
        for &radix in radices {
            let groups = left / radix;
            let mut twiddles = Vec::with_capacity(left);
            for group in 0..groups {
                for output in 0..radix {
                    let angle = -std::f64::consts::TAU * (group * output) as f64 / left as f64;
                    twiddles.push([angle.cos() as f32, angle.sin() as f32]);
                }
            }
            passes.push(Pass {
                radix,
                groups,
                stride,
                twiddles,
            });
            left = groups;
            stride *= radix;
        }
        Self {
            length,
            passes,
            order: Table::new(0..length as u32),
        }
    }

    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// Returns the octets of scratch that a [`Transform`] needs for vectors of up to `octets` octets.
    pub(super) fn scratch(&self, octets: usize) -> usize {
        4 * self.length * octets
    }
}

/// Transform of one vector of maps.
///
/// It is a separate kernel, compiled once per instruction set, because it is too large to inline into other kernels.
pub(super) struct Transform<'a> {
    pub(super) plan: &'a TimePlan,
    pub(super) source: &'a [Octet],
    /// Layout of the input in `source`.
    pub(super) from: Rows<'a>,
    pub(super) target: &'a mut [Octet],
    /// Layout of the output in `target`.
    pub(super) to: Rows<'a>,
    /// Working memory of [`TimePlan::scratch`] octets.
    pub(super) scratch: &'a mut [Octet],
}

impl Kernel for Transform<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Transform {
            plan,
            source,
            from,
            target,
            to,
            scratch,
        } = self;
        let half = 2 * plan.length * L::OCTETS;
        let (mut front, mut back) = scratch[..2 * half].split_at_mut(half);
        let between = Rows {
            table: &plan.order,
            stride: 2 * L::OCTETS,
            parts: [0, L::OCTETS],
            ahead: NOTHING,
        };
        let mut target = Writer::new(target, to);
        if plan.passes.is_empty() {
            let source = Reader::<L>::new(source, from);
            target.write_every::<1>(0, 0, source.read_every(0, 0));
            return;
        }
        let (inner, last) = match plan.passes.as_slice() {
            [inner @ .., last] if !inner.is_empty() => (inner, Some(last)),
            only => (only, None),
        };
        for (index, pass) in inner.iter().enumerate() {
            let from = if index == 0 {
                Reader::<L>::new(source, from)
            } else {
                Reader::new(back, between)
            };
            pass.run(
                from,
                Sequence::new(&mut *front),
                (to.ahead == WRITTEN && index + 2 == plan.passes.len()).then_some(&target),
            );
            std::mem::swap(&mut front, &mut back);
        }
        let between = Sequence::<_, L>::new(&*back);
        match last {
            Some(pass) => pass.run_last(between, target),
            None => {
                for element in 0..plan.length {
                    target.write_every::<1>(element, 0, between.read_every(element, 0));
                }
            }
        }
    }
}

/// Returns the shortest length of at least `least` that is a product of the radices, with those radices.
fn smooth(least: usize) -> (usize, Vec<usize>) {
    let lengths = least.max(1)..;
    let mut found = lengths.filter_map(|length| Some((length, factor(length)?)));
    found
        .next()
        .unwrap_or_else(|| unreachable!("powers of two are products of the radices"))
}

/// Returns the fewest radices with product `length`, large ones first; `None` if a prime factor exceeds 5.
fn factor(length: usize) -> Option<Vec<usize>> {
    fn search(left: usize, most: usize) -> Option<Vec<usize>> {
        if left == 1 {
            return Some(Vec::new());
        }
        let tries = [12, 10, 9, 8, 6, 5, 4, 3, 2]
            .into_iter()
            .filter(|&r| r <= most && left.is_multiple_of(r));
        let found = tries.filter_map(|r| {
            let mut rest = search(left / r, r)?;
            rest.insert(0, r);
            Some(rest)
        });
        found.min_by_key(Vec::len)
    }
    search(length, 12)
}

/// Calls a method for the pass's radix.
macro_rules! with_radix {
    ($pass:ident . $method:ident ( $($argument:expr),* )) => {
        match $pass.radix {
            2 => $pass.$method::<L, 2>($($argument),*),
            3 => $pass.$method::<L, 3>($($argument),*),
            4 => $pass.$method::<L, 4>($($argument),*),
            5 => $pass.$method::<L, 5>($($argument),*),
            6 => $pass.$method::<L, 6>($($argument),*),
            8 => $pass.$method::<L, 8>($($argument),*),
            9 => $pass.$method::<L, 9>($($argument),*),
            10 => $pass.$method::<L, 10>($($argument),*),
            _ => $pass.$method::<L, 12>($($argument),*),
        }
    };
}

impl Pass {
    /// Runs any pass except the last.
    #[inline(always)]
    fn run<L: Lanes>(
        &self,
        source: Reader<'_, L>,
        target: Sequence<&mut [Octet], L>,
        last: Option<&Writer<'_, L>>,
    ) {
        with_radix!(self.turned(source, target, last));
    }

    /// Runs the last pass, which has no twiddle factors.
    #[inline(always)]
    fn run_last<L: Lanes>(&self, source: Sequence<&[Octet], L>, target: Writer<'_, L>) {
        with_radix!(self.straight(source, target));
    }

    /// Runs butterflies and twiddle factors; prefetches the cache lines of `last` if the next pass writes there.
    #[inline(always)]
    fn turned<L: Lanes, const RADIX: usize>(
        &self,
        source: Reader<'_, L>,
        mut target: Sequence<&mut [Octet], L>,
        last: Option<&Writer<'_, L>>,
    ) {
        let apart = self.stride * self.groups;
        for (group, twiddles) in self.twiddles.chunks_exact(RADIX).enumerate() {
            for shared in 0..self.stride {
                let mut values: [_; RADIX] = source.read_every(shared + self.stride * group, apart);
                if let Some(last) = last {
                    last.expect::<RADIX>(shared * self.groups * RADIX + RADIX * group);
                }
                butterfly(&mut values);
                unrolled!(k < RADIX => {
                    if k > 0 {
                        values[k] = values[k].rotated(twiddles[k]);
                    }
                });
                let first = shared + self.stride * RADIX * group;
                target.write_every(first, self.stride, values);
            }
        }
    }

    /// Runs butterflies without twiddle factors.
    #[inline(always)]
    fn straight<L: Lanes, const RADIX: usize>(
        &self,
        source: Sequence<&[Octet], L>,
        mut target: Writer<'_, L>,
    ) {
        for shared in 0..self.stride {
            let mut values: [_; RADIX] = source.read_every(shared, self.stride);
            butterfly(&mut values);
            target.write_every(shared, self.stride, values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise;
    use crate::simd::{Isa, NOTHING, floats, floats_mut};

    #[test]
    fn transforms_agree_with_their_definition() {
        for length in [
            1, 2, 3, 4, 5, 6, 8, 9, 10, 12, 18, 30, 50, 108, 120, 144, 600,
        ] {
            let plan = TimePlan::at_least(length);
            assert_eq!(plan.length(), length);
            let rows = Table::new(0..length as u32);
            let mut x = vec![Octet::ZERO; 4 * length];
            floats_mut(&mut x).copy_from_slice(&noise(32 * length, 9));
            for isa in Isa::all() {
                let mut y = vec![Octet::ZERO; 4 * length];
                let mut scratch = vec![Octet::ZERO; plan.scratch(2)];
                for v in (0..2).step_by(isa.group(2)) {
                    let at = Rows {
                        table: &rows,
                        stride: 4,
                        parts: [v, 2 + v],
                        ahead: NOTHING,
                    };
                    isa.run(
                        2,
                        Transform {
                            plan: &plan,
                            source: &x,
                            from: at,
                            target: &mut y,
                            to: at,
                            scratch: &mut scratch,
                        },
                    );
                }
                let (x, y) = (floats(&x), floats(&y));
                for f in 0..length {
                    for lane in 0..16 {
                        let (mut re, mut im) = (0f64, 0f64);
                        for t in 0..length {
                            let angle =
                                -std::f64::consts::TAU * (f * t % length) as f64 / length as f64;
                            let (a, b) = (
                                f64::from(x[32 * t + lane]),
                                f64::from(x[32 * t + 16 + lane]),
                            );
                            re += a * angle.cos() - b * angle.sin();
                            im += a * angle.sin() + b * angle.cos();
                        }
                        assert!((f64::from(y[32 * f + lane]) - re).abs() < 2e-5, "{length}");
                        let found = f64::from(y[32 * f + 16 + lane]);
                        assert!((found - im).abs() < 2e-5, "{length}");
                    }
                }
            }
        }
        assert_eq!(TimePlan::at_least(107).length(), 108);
    }
}
