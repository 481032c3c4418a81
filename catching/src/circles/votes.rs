//! Votes of edges for circles: for each pixel and radius, the mean over 24 points around it of how much more edge lies along the normal
//! than along the circle.

use tactnet_catching_packets::packets::Circle;

use super::Window;
use super::edges::{DIRECTIONS, Rows, SHARE, directed};

/// Points of a circle.
const POINTS: usize = 24;
/// Radii that are voted for together.
pub(super) const COUNT: usize = 6;
/// An octave of them.
pub(super) const RADII: [f64; COUNT] = [
    1.0,
    1.12246,
    1.25992,
    std::f64::consts::SQRT_2,
    1.5874,
    1.7818,
];
/// Full votes: a third of all points'.
const FULL: f64 = POINTS as f64 / 3.0 * SHARE;
/// Pixels that are summed up together.
const RUN: usize = 32;
/// Peaks that are looked for in one window.
const MOST: usize = 1024;

/// A circle that many edges vote for, in pixels of the whole picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Peak {
    pub(super) u: f64,
    pub(super) v: f64,
    pub(super) r: f64,
    pub(super) response: f64,
}

impl Peak {
    pub(super) fn of(circle: &Circle) -> Self {
        Self {
            u: circle.u,
            v: circle.v,
            r: circle.r,
            response: circle.response,
        }
    }

    /// The same in pixels that are so many times smaller.
    pub(super) fn scaled(&self, by: f64) -> Self {
        Self {
            u: self.u * by,
            v: self.v * by,
            r: self.r * by,
            response: self.response,
        }
    }

    /// Returns true if both lead to the same circle.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let ratio = self.r / other.r;
        (self.u - other.u).hypot(self.v - other.v) < 0.2 * self.r.min(other.r)
            && (0.8..1.25).contains(&ratio)
    }
}

/// A point of a circle: a shift of pixels, and the direction that it is seen in.
#[derive(Debug, Clone, Copy, Default)]
struct Point {
    right: isize,
    down: isize,
    direction: usize,
}

/// Working memory.
#[derive(Debug, Clone)]
pub(super) struct Votes {
    rows: Rows,
    planes: [Vec<i8>; DIRECTIONS],
    responses: [Vec<u8>; COUNT],
    room: usize,
    window: Window,
    radii: [f64; COUNT],
}

impl Votes {
    /// - `room`: pixels of the largest window
    pub(super) fn new(room: usize) -> Self {
        Self {
            rows: Rows::default(),
            planes: std::array::from_fn(|_| vec![0; room]),
            responses: std::array::from_fn(|_| vec![0; room]),
            room,
            window: Window {
                left: 0,
                top: 0,
                width: 0,
                height: 0,
            },
            radii: [0.0; COUNT],
        }
    }

    pub(super) fn room(&self) -> usize {
        self.room
    }

    /// Finds the edges of a window.
    pub(super) fn edges(&mut self, pixels: &[u8], stride: usize, window: Window, noise: f64) {
        self.window = window;
        directed(
            pixels,
            stride,
            window,
            noise,
            &mut self.rows,
            &mut self.planes,
        );
    }

    /// Lets the edges vote for circles of these radii, pixels of the window; those that reach over its rim have no votes.
    pub(super) fn cast(&mut self, radii: [f64; COUNT]) {
        self.radii = radii;
        let (width, height) = (self.window.width, self.window.height);
        let (planes, responses) = (&self.planes, &mut self.responses);
        pulp::Arch::new().dispatch(Cast {
            planes,
            responses,
            radii,
            size: [width, height],
        });
    }

    /// Adds the circles with more votes than their neighbours.
    ///
    /// - `scale`: pixels of the picture in one of the window
    pub(super) fn peaks(&self, threshold: f64, window: Window, scale: f64, peaks: &mut Vec<Peak>) {
        let least = (threshold * FULL).clamp(1.0, 255.0) as u8;
        let (width, height) = (window.width, window.height);
        let most = peaks.len() + MOST;
        for (i, responses) in self.responses.iter().enumerate() {
            for line in 1..height - 1 {
                let from = line * width;
                for (start, run) in responses[from..from + width].chunks(RUN).enumerate() {
                    if run.iter().fold(0, |most, &value| most.max(value)) < least {
                        continue;
                    }
                    for (within, &value) in run.iter().enumerate() {
                        let column = start * RUN + within;
                        if value < least || column == 0 || column + 1 == width {
                            continue;
                        }
                        if peaks.len() < most && self.is_peak(i, from + column, value) {
                            peaks.push(Peak {
                                u: (window.left as f64 + column as f64 + 0.5) * scale,
                                v: (window.top as f64 + line as f64 + 0.5) * scale,
                                r: self.radii[i] * scale,
                                response: f64::from(value) / FULL,
                            });
                        }
                    }
                }
            }
        }
    }

    /// No neighbour in place has more votes for the radius; of equal ones the first is the peak. Neighbours in radius do not count: the votes
    /// of a ball that is lit from one side are a ridge, from a circle within its lit half to its outline, which is not the top of it.
    fn is_peak(&self, radius: usize, at: usize, value: u8) -> bool {
        let responses = &self.responses[radius];
        let width = self.window.width;
        [at - width, at, at + width].into_iter().all(|line| {
            (line - 1..=line + 1).all(|place| {
                let other = responses[place];
                other < value || (other == value && place >= at)
            })
        })
    }
}

/// A call of [`cast`], compiled for each vector width that a processor may have.
struct Cast<'a> {
    planes: &'a [Vec<i8>; DIRECTIONS],
    responses: &'a mut [Vec<u8>; COUNT],
    radii: [f64; COUNT],
    size: [usize; 2],
}

impl pulp::NullaryFnOnce for Cast<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        cast(self.planes, self.responses, self.radii, self.size);
    }
}

#[inline(always)]
fn cast(
    planes: &[Vec<i8>; DIRECTIONS],
    responses: &mut [Vec<u8>; COUNT],
    radii: [f64; COUNT],
    [width, height]: [usize; 2],
) {
    for (responses, radius) in responses.iter_mut().zip(radii) {
        let points = points(radius);
        let margin = radius.round() as usize + 1;
        let responses = &mut responses[..width * height];
        for (line, responses) in responses.chunks_exact_mut(width).enumerate() {
            responses.fill(0);
            if line < margin || line + margin >= height || 2 * margin >= width {
                continue;
            }
            sum(planes, &points, line * width, margin, responses);
        }
    }
}

/// Writes the mean votes of a row of centres.
///
/// - `from`: where the row begins in the planes
/// - `margin`: columns at both ends that have no votes
#[inline(always)]
fn sum(
    planes: &[Vec<i8>; DIRECTIONS],
    points: &[Point; POINTS],
    from: usize,
    margin: usize,
    responses: &mut [u8],
) {
    let width = responses.len();
    let shifts: [(usize, isize); POINTS] =
        points.map(|point| (point.direction, point.down * width as isize + point.right));
    let end = width - margin;
    let mut column = margin;
    while column + RUN <= end {
        run(planes, &shifts, from + column, &mut responses[column..]);
        column += RUN;
    }
    if column < end && end >= margin + RUN {
        // The last run overlaps the one before.
        run(
            planes,
            &shifts,
            from + end - RUN,
            &mut responses[end - RUN..],
        );
    } else {
        for (column, response) in responses.iter_mut().enumerate().take(end).skip(column) {
            let at = |shift: isize| (from + column).wrapping_add_signed(shift);
            let sum = |(plane, shift): &(usize, isize)| i16::from(planes[*plane][at(*shift)]);
            *response = third(shifts.iter().map(sum).sum());
        }
    }
}

/// Writes the votes of [`RUN`] centres from `at` on.
#[inline(always)]
fn run(
    planes: &[Vec<i8>; DIRECTIONS],
    shifts: &[(usize, isize); POINTS],
    at: usize,
    responses: &mut [u8],
) {
    let mut sums = [0_i16; RUN];
    for four in shifts.chunks_exact(4) {
        let mut together = [0_i8; RUN];
        for (plane, shift) in four {
            let at = at.wrapping_add_signed(*shift);
            let votes: &[i8] = &planes[*plane][at..at + RUN];
            for i in 0..RUN {
                together[i] = together[i].wrapping_add(votes[i]);
            }
        }
        for i in 0..RUN {
            sums[i] += i16::from(together[i]);
        }
    }
    for (response, sum) in responses[..RUN].iter_mut().zip(sums) {
        *response = third(sum);
    }
}

#[inline(always)]
fn third(sum: i16) -> u8 {
    // At most 24 times 31, so that 16 bits hold the product's upper half.
    ((u32::from(sum.max(0) as u16) * 21846) >> 16) as u8
}

fn points(radius: f64) -> [Point; POINTS] {
    std::array::from_fn(|i| {
        let angle = std::f64::consts::TAU * i as f64 / POINTS as f64;
        let (right, down) = (
            (radius * angle.cos()).round(),
            (radius * angle.sin()).round(),
        );
        let seen = down.atan2(right).rem_euclid(std::f64::consts::PI);
        let direction = (seen / std::f64::consts::PI * DIRECTIONS as f64).round() as usize;
        Point {
            right: right as isize,
            down: down as isize,
            direction: direction % DIRECTIONS,
        }
    })
}
