//! Hough votes for circles. For each pixel and radius, the vote is the mean over 24 points of the edge along the normal
//! minus the edge along the tangent.

use tactnet_catching_packets::packets::Circle;

use super::Window;
use super::edges::{DIRECTIONS, Rows, SHARE, directed};

/// Number of points on a circle.
const POINTS: usize = 24;
/// Number of radii per vote.
pub(super) const COUNT: usize = 6;
/// Radii within one octave, relative to the smallest.
pub(super) const RADII: [f64; COUNT] = [
    1.0,
    1.12246,
    1.25992,
    std::f64::consts::SQRT_2,
    1.5874,
    1.7818,
];
/// Full vote in the stored responses: a third of the sum over all points.
const FULL: f64 = POINTS as f64 / 3.0 * SHARE;
/// Number of pixels that are summed in one run.
const RUN: usize = 32;
/// Maximum number of peaks per window.
const MAX_PEAKS: usize = 1024;

/// Returns true if two local maxima of the votes lead to the same circle.
pub(super) fn is_like(a: &Circle, b: &Circle) -> bool {
    let ratio = a.r / b.r;
    (a.u - b.u).powi(2) + (a.v - b.v).powi(2) < (0.2 * a.r.min(b.r)).powi(2)
        && (0.8..1.25).contains(&ratio)
}

/// Point of a circle: offset in pixels and index of its normal direction.
#[derive(Debug, Clone, Copy, Default)]
struct Point {
    right: isize,
    down: isize,
    direction: usize,
}

/// Working memory of the vote.
#[derive(Debug, Clone)]
pub(super) struct Votes {
    rows: Rows,
    planes: [Vec<i8>; DIRECTIONS],
    responses: [Vec<u8>; COUNT],
    pub(super) room: usize,
    window: Window,
    radii: [f64; COUNT],
}

impl Votes {
    /// Allocates the working memory.
    ///
    /// - `room`: number of pixels of the largest window
    pub(super) fn new(room: usize) -> Self {
        Self {
            rows: Rows::default(),
            planes: std::array::from_fn(|_| vec![0; room]),
            responses: std::array::from_fn(|_| vec![0; room]),
            room,
            window: Window::default(),
            radii: [0.0; COUNT],
        }
    }

    /// Computes the edges of a window.
    pub(super) fn edges(&mut self, pixels: &[u8], stride: usize, window: Window, noise: f64) {
        self.window = window;
        let (rows, planes) = (&mut self.rows, &mut self.planes);
        directed(pixels, stride, window, noise, rows, planes);
    }

    /// Computes the votes for circles of these radii, in pixels of the window. Circles that exceed the window have no
    /// votes.
    pub(super) fn cast(&mut self, radii: [f64; COUNT]) {
        self.radii = radii;
        pulp::Arch::new().dispatch(Cast {
            planes: &self.planes,
            responses: &mut self.responses,
            radii,
            size: [self.window.width, self.window.height],
        });
    }

    /// Appends the local maxima of the votes to `peaks`, in pixels of the whole picture.
    ///
    /// - `scale`: pixels of the picture per pixel of the window
    pub(super) fn peaks(&self, threshold: f64, scale: f64, peaks: &mut Vec<Circle>) {
        let least = (threshold * FULL).clamp(1.0, 255.0) as u8;
        let window = self.window;
        let (width, height) = (window.width, window.height);
        let most = peaks.len() + MAX_PEAKS;
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
                            peaks.push(Circle {
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

    /// Returns true if no neighbouring position has more votes for this radius; of equal ones, the first is the peak.
    /// Neighbouring radii are not compared: the votes of a ball lit from one side form a ridge from a circle inside its
    /// lit half to its outline, and the outline is not the maximum.
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

/// Arguments of the vote, which is compiled for each vector width.
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
        let Self {
            planes,
            responses,
            radii,
            size: [width, height],
        } = self;
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
}

/// Writes the mean votes of a row of centres.
///
/// - `from`: index of the row's start in the planes
/// - `margin`: number of columns without votes at both ends
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
        // The last run overlaps the previous one.
        let last = &mut responses[end - RUN..];
        run(planes, &shifts, from + end - RUN, last);
    } else {
        for (column, response) in responses.iter_mut().enumerate().take(end).skip(column) {
            let at = |shift: isize| (from + column).wrapping_add_signed(shift);
            let sum = |(plane, shift): &(usize, isize)| i16::from(planes[*plane][at(*shift)]);
            *response = third(shifts.iter().map(sum).sum());
        }
    }
}

/// Writes the votes of [`RUN`] centres from index `at`.
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
    // The sum is at most 24 times 31, so the product fits into 32 bits and its upper half is the third.
    ((u32::from(sum.max(0) as u16) * 21846) >> 16) as u8
}

fn points(radius: f64) -> [Point; POINTS] {
    std::array::from_fn(|i| {
        let angle = std::f64::consts::TAU * i as f64 / POINTS as f64;
        let [right, down] = [angle.cos(), angle.sin()].map(|part| (radius * part).round());
        let seen = down.atan2(right).rem_euclid(std::f64::consts::PI);
        let direction = (seen / std::f64::consts::PI * DIRECTIONS as f64).round() as usize;
        Point {
            right: right as isize,
            down: down as isize,
            direction: direction % DIRECTIONS,
        }
    })
}
