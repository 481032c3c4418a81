//! Circle detection with votes of contrast-normalised edges (thesis, section 3.4.1; edges after Frese).
//!
//! ```text
//! picture ─> halved ─> halved … ─> edges C ─> votes of 24 points on circles of six radii ─> peaks ─> edge points on rays ─> circle, sub-pixel
//! predictions ─> gates ─────────────> the same at twice the resolution, in windows
//! ```
//!
//! With 3x3 Sobel filters `S` and the binomial mean `G`, an edge is `C = sqrt(2) S / sqrt(16 G*I^2 - (G*I)^2 + eps^2)`:
//! the share of the local contrast that is one straight edge, independent of illumination. The vote for a circle is the
//! mean over its points of `(n . C)^2 - (t . C)^2` with normal `n` and tangent `t`. It is 1 for a perfect circle and 0
//! on average for texture. Frese's `(n . C)^2` gives 0.5 for texture.

mod edges;
mod eye;
mod gates;
mod lens;
mod refine;
mod votes;

use tactnet_catching_packets::Cameras;
use tactnet_catching_packets::packets::{BallPredictions, Circle, Circles, HeadPose, MAX_CIRCLES};

pub use eye::Eye;
pub use gates::{Gate, gates};
use lens::Lens;
use refine::{Rays, polished, refined};
use votes::{RADII, Votes, is_like};

/// Smallest radius in each level of the pyramid, in pixels of the level. The largest is just below twice this value.
const LEAST_RADIUS: f64 = 4.5;
/// Maximum number of peaks that are refined per picture.
const MOST_PEAKS: usize = 256;
/// Maximum distance between the centres of duplicate circles, relative to the larger radius.
const DUPLICATE_DISTANCE: f64 = 0.5;
/// Minimum radius in the level in which a peak is refined, in pixels of the level. The largest is just below twice this
/// value.
const FINE_RADIUS: f64 = 12.0;

tactnet_catching_packets::settings! {
    /// Settings of circle detection.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct CircleConfig {
        /// Minimum response of a circle outside of gates.
        pub threshold: f64 = 0.3,
        /// Minimum response inside a gate.
        pub gate_threshold: f64 = 0.2,
        /// Maximum radius, in pixels. The minimum is 9 pixels, or 4.5 inside a gate.
        pub largest: f64 = 140.0,
        /// Contrast of noise and faint texture, in grey levels. Edges with much less contrast have little weight.
        pub noise: f64 = 6.0,
        /// Minimum fraction of rays from the centre whose edge lies on the circle.
        pub inliers: f64 = 0.5,
    }
}

/// Circle detector for pictures of one size. Does not allocate after construction.
#[derive(Debug, Clone)]
pub struct CircleDetector {
    config: CircleConfig,
    cameras: Cameras,
    lens: Lens,
    width: usize,
    height: usize,
    /// Picture halved once, twice, and so on.
    halved: Vec<Halved>,
    votes: Votes,
    rays: Rays,
    peaks: Vec<Circle>,
    found: Vec<Circle>,
}

#[derive(Debug, Clone)]
struct Halved {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

/// Rectangle of a picture, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Window {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl Window {
    fn whole(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            ..Self::default()
        }
    }
}

impl CircleDetector {
    /// Creates a detector for pictures of these cameras.
    pub fn new(cameras: &Cameras, config: CircleConfig) -> Self {
        let (width, height) = (cameras.width as usize, cameras.height as usize);
        let mut halved = Vec::new();
        let (mut w, mut h, mut radius) = (width / 2, height / 2, 2.0 * LEAST_RADIUS);
        while radius < config.largest && w > 32 && h > 32 {
            halved.push(Halved {
                width: w,
                height: h,
                pixels: vec![0; w * h],
            });
            (w, h, radius) = (w / 2, h / 2, radius * 2.0);
        }
        Self {
            config,
            cameras: *cameras,
            lens: Lens::new(cameras),
            width,
            height,
            votes: Votes::new((width / 2 + 1) * (height / 2 + 1)),
            halved,
            rays: Rays::default(),
            peaks: Vec::with_capacity(4 * MOST_PEAKS),
            found: Vec::with_capacity(4 * MOST_PEAKS),
        }
    }

    /// Same as [`CircleDetector::find`], with gates at predicted balls for the head pose at the exposure.
    pub fn find_expected(
        &mut self,
        pixels: &[u8],
        expected: Option<(&BallPredictions, &HeadPose)>,
        circles: &mut Circles,
    ) {
        let (cameras, camera) = (self.cameras, circles.camera as usize);
        let expected = expected.into_iter();
        let gates: Vec<Gate> = expected
            .flat_map(|(balls, head)| gates(&cameras, camera, balls, head))
            .collect();
        self.find(pixels, &gates, circles);
    }

    /// Detects the circles of a picture, sorted by decreasing response. The lens distortion is removed from them.
    ///
    /// - `pixels`: brightness, `[height][width]`
    /// - `gates`: expected balls
    /// - `circles`: output; frame number, time and camera are left unchanged
    ///
    /// # Panics
    /// Panics if `pixels` does not have the size of the cameras' pictures.
    pub fn find(&mut self, pixels: &[u8], gates: &[Gate], circles: &mut Circles) {
        let size = self.width * self.height;
        assert_eq!(pixels.len(), size, "pixels of a picture");
        self.halve(pixels);
        self.peaks.clear();
        let noise = self.config.noise;
        for (level, halved) in self.halved.iter().enumerate() {
            let window = Window::whole(halved.width, halved.height);
            self.votes
                .edges(&halved.pixels, halved.width, window, noise);
            let scale = f64::from(2 << level);
            self.votes.cast(RADII.map(|factor| LEAST_RADIUS * factor));
            self.votes
                .peaks(self.config.threshold, scale, &mut self.peaks);
        }
        for gate in gates {
            self.look_into(pixels, gate);
        }
        self.keep_best_peaks();
        self.found.clear();
        for i in 0..self.peaks.len() {
            let peak = self.peaks[i];
            if self.found.iter().any(|circle| is_like(&peak, circle)) {
                continue;
            }
            let circle = self.refined(pixels, &peak);
            let circle = circle.filter(|circle| circle.r <= self.config.largest);
            self.found.extend(circle);
        }
        self.found.sort_by(|a, b| b.response.total_cmp(&a.response));
        circles.count = 0;
        for circle in &self.found {
            let place = circles.count as usize;
            let circle = self.lens.undistorted(circle);
            if place < MAX_CIRCLES && !circles.valid().iter().any(|other| same(other, &circle)) {
                circles.circles[place] = circle;
                circles.count += 1;
            }
        }
    }

    /// Refines a peak at the level where its radius is at least [`FINE_RADIUS`], then at twice the resolution if blur
    /// permits.
    fn refined(&self, pixels: &[u8], peak: &Circle) -> Option<Circle> {
        let mut level = 0;
        while level < self.halved.len() && peak.r / f64::from(2 << level) >= FINE_RADIUS {
            level += 1;
        }
        let (pixels_of, size, scale) = self.level(pixels, level);
        let (peak, inliers) = (scaled(peak, 1.0 / scale), self.config.inliers);
        let circle = refined(&self.rays, pixels_of, size, &peak, inliers)?;
        let mut circle = scaled(&circle, scale);
        if level > 0 {
            let (pixels_of, size, scale) = self.level(pixels, level - 1);
            let coarse = scaled(&circle, 1.0 / scale);
            if let Some(fine) = polished(&self.rays, pixels_of, size, &coarse) {
                circle = scaled(&fine, scale);
            }
        }
        Some(circle)
    }

    /// Returns the pixels of a pyramid level, its width and height, and its scale (pixels of the picture per pixel of
    /// the level).
    fn level<'a>(&'a self, pixels: &'a [u8], level: usize) -> (&'a [u8], [usize; 2], f64) {
        match level {
            0 => (pixels, [self.width, self.height], 1.0),
            _ => {
                let halved = &self.halved[level - 1];
                let size = [halved.width, halved.height];
                (&halved.pixels, size, f64::from(1 << level))
            }
        }
    }

    fn halve(&mut self, pixels: &[u8]) {
        let mut from = (pixels, self.width);
        for halved in &mut self.halved {
            pulp::Arch::new().dispatch(Halve {
                from: from.0,
                from_width: from.1,
                to: &mut halved.pixels,
                width: halved.width,
            });
            from = (&halved.pixels, halved.width);
        }
    }

    /// Searches a gate at twice the resolution of the full search.
    fn look_into(&mut self, pixels: &[u8], gate: &Gate) {
        let [u, v] = self.lens.distorted([gate.u, gate.v]);
        // The coarsest level at which the radius is at least twice the minimum.
        let mut level = 0;
        while level < self.halved.len() && gate.r / f64::from(2 << level) >= 2.0 * LEAST_RADIUS {
            level += 1;
        }
        let (_, [width, height], scale) = self.level(pixels, level);
        let reach = (gate.reach + 1.4 * gate.r) / scale + 2.0;
        let range = |centre: f64, size: usize| {
            let low = (centre / scale - reach).clamp(0.0, size as f64) as usize;
            let high = (centre / scale + reach).clamp(0.0, size as f64) as usize;
            (low, high - low)
        };
        let mut window = Window::default();
        (window.left, window.width) = range(u, width);
        (window.top, window.height) = range(v, height);
        // Limit gates that exceed a quarter of the picture.
        let room = self.votes.room;
        if window.width * window.height > room {
            window.height = room / window.width.max(1);
        }
        if window.width < 16 || window.height < 16 {
            return;
        }
        let pixels = match level.checked_sub(1) {
            Some(halved) => &self.halved[halved].pixels,
            None => pixels,
        };
        self.votes.edges(pixels, width, window, self.config.noise);
        let middle = gate.r / scale;
        // Six radii from 0.8 to 1.25 times the expected one.
        let radii = std::array::from_fn(|i| middle * 0.8 * 1.5625_f64.powf(i as f64 / 5.0));
        self.votes.cast(radii);
        self.votes
            .peaks(self.config.gate_threshold, scale, &mut self.peaks);
    }

    /// Merges peaks of the same circle and keeps the strongest.
    fn keep_best_peaks(&mut self) {
        self.peaks.sort_by(|a, b| b.response.total_cmp(&a.response));
        let mut kept = 0;
        for i in 0..self.peaks.len() {
            let peak = self.peaks[i];
            let is_new = self.peaks[..kept]
                .iter()
                .all(|other| !is_like(&peak, other));
            if is_new && kept < MOST_PEAKS {
                self.peaks[kept] = peak;
                kept += 1;
            }
        }
        self.peaks.truncate(kept);
    }
}

/// Returns the circle with all lengths multiplied by `by`.
fn scaled(circle: &Circle, by: f64) -> Circle {
    let [u, v, r] = [circle.u, circle.v, circle.r].map(|length| length * by);
    Circle { u, v, r, ..*circle }
}

fn same(a: &Circle, b: &Circle) -> bool {
    (a.u - b.u).hypot(a.v - b.v) < DUPLICATE_DISTANCE * a.r.max(b.r)
}

/// Averages blocks of two by two pixels; compiled for each vector width.
struct Halve<'a> {
    from: &'a [u8],
    from_width: usize,
    to: &'a mut [u8],
    width: usize,
}

impl pulp::NullaryFnOnce for Halve<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let from_width = self.from_width;
        let pairs = self.from.chunks_exact(2 * from_width);
        for (rows, to) in pairs.zip(self.to.chunks_exact_mut(self.width)) {
            let (upper, lower) = rows.split_at(from_width);
            let four = upper.chunks_exact(2).zip(lower.chunks_exact(2));
            for (to, (a, b)) in to.iter_mut().zip(four) {
                let sum = u16::from(a[0]) + u16::from(a[1]) + u16::from(b[0]) + u16::from(b[1]);
                *to = ((sum + 2) >> 2) as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use proptest::prelude::*;
    use tactnet_catching_packets::RobotDescription;
    use tactnet_catching_packets::packets::BallPrediction;

    use crate::calibrate::Corrections;
    use crate::robot::Robot;
    use crate::track::{Camera, Head, View};

    fn cameras(distortion: [f64; 2]) -> Cameras {
        Cameras {
            width: 400,
            height: 312,
            focal: 346.5,
            distortion,
            ..RobotDescription::nominal().cameras
        }
    }

    /// Returns a disc with soft edges on a background that gets brighter to the right.
    fn disc(cameras: &Cameras, [u, v, r]: [f64; 3], shades: [f64; 2]) -> Vec<u8> {
        let (width, height) = (cameras.width as usize, cameras.height as usize);
        let pixels = (0..width * height).map(|i| {
            let (x, y) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            let share = (r + 0.5 - (x - u).hypot(y - v)).clamp(0.0, 1.0);
            let ground = shades[0] + 0.05 * x;
            (ground + share * (shades[1] - ground)).round() as u8
        });
        pixels.collect()
    }

    fn found(cameras: &Cameras, pixels: &[u8], gates: &[Gate]) -> Vec<Circle> {
        let mut circles = Circles::zeroed();
        CircleDetector::new(cameras, CircleConfig::default()).find(pixels, gates, &mut circles);
        circles.valid().to_vec()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn discs_are_found_to_a_tenth_of_a_pixel(
            u in 90.0..310.0f64, v in 90.0..220.0f64, r in 9.5..60.0f64, dark: bool,
        ) {
            let cameras = cameras([0.0; 2]);
            let shades = if dark { [120.0, 40.0] } else { [60.0, 180.0] };
            let circles = found(&cameras, &disc(&cameras, [u, v, r], shades), &[]);
            prop_assert_eq!(circles.len(), 1, "{:?}", circles);
            let circle = circles[0];
            prop_assert!((circle.u - u).hypot(circle.v - v) < 0.1, "{circle:?}");
            prop_assert!((circle.r - r).abs() < 0.15, "{circle:?}");
            prop_assert!(circle.response > 0.7, "{circle:?}");
        }

        /// Gates may have any position and size.
        #[test]
        fn no_gate_breaks_the_search(u in -500.0..900.0f64, v in -500.0..900.0f64, r in 0.0..500.0f64, reach in 0.0..2000.0f64) {
            let cameras = cameras([-0.08, 0.02]);
            let pixels = disc(&cameras, [200.0, 150.0, 20.0], [60.0, 180.0]);
            let circles = found(&cameras, &pixels, &[Gate { u, v, r, reach }]);
            prop_assert_eq!(circles.len(), 1);
        }
    }

    #[test]
    fn small_balls_are_found_where_they_are_expected_and_nowhere_else() {
        let cameras = cameras([0.0; 2]);
        let place = [211.3, 140.6, 5.5];
        let pixels = disc(&cameras, place, [60.0, 180.0]);
        assert_eq!(found(&cameras, &pixels, &[]), []);
        let [u, v, r, reach] = [217.0, 137.0, 5.0, 12.0];
        let circles = found(&cameras, &pixels, &[Gate { u, v, r, reach }]);
        assert_eq!(circles.len(), 1);
        let away = (circles[0].u - place[0]).hypot(circles[0].v - place[1]);
        assert!(away < 0.15, "{circles:?}");
    }

    #[test]
    fn an_eye_expects_balls_where_they_are_predicted_and_forgets_old_predictions() {
        let cameras = cameras([0.0; 2]);
        let robot = Robot::new(RobotDescription {
            cameras,
            ..RobotDescription::nominal()
        });
        let mut eye = Eye::new(Corrections::new(&robot, None));
        let mut circles = Circles::zeroed();
        circles.exposure_ns = 1_000_000_000;
        let mut head = HeadPose::zeroed();
        (head.t_ns, head.quaternion[3]) = (circles.exposure_ns, 1.0);
        eye.pose(&head);
        let mut ball = BallPrediction::zeroed();
        (ball.t_ns, ball.p) = (circles.exposure_ns, [2.75, 0.1, 0.1]);
        let view = View::new(Camera::pair(&cameras)[0], &Head::new(&head).unwrap());
        let place = view.see(&ball.p.into()).unwrap().into();
        let pixels = disc(&cameras, place, [60.0, 180.0]);
        let mut balls = BallPredictions::zeroed();
        (balls.count, balls.balls[0]) = (1, ball);
        for (age_ns, count) in [(0, 1), (400_000_000, 1), (600_000_000, 0)] {
            balls.exposure_ns = circles.exposure_ns - age_ns;
            eye.step(&pixels, Some(&balls), &mut circles);
            assert_eq!(circles.count, count, "{age_ns}");
        }
        eye.step(&pixels, None, &mut circles);
        assert_eq!(circles.count, 0);
    }

    #[test]
    fn the_lens_is_undone() {
        let cameras = cameras([-0.08, 0.02]);
        let lens = Lens::new(&cameras);
        // Position in a picture without distortion.
        let place = [330.0, 90.0, 14.0];
        let [u, v] = lens.distorted([place[0], place[1]]);
        let [right, _] = lens.distorted([place[0] + place[2], place[1]]);
        let [left, _] = lens.distorted([place[0] - place[2], place[1]]);
        assert!((u - place[0]).hypot(v - place[1]) > 1.0);
        let pixels = disc(&cameras, [u, v, (right - left) / 2.0], [60.0, 180.0]);
        let circles = found(&cameras, &pixels, &[]);
        assert_eq!(circles.len(), 1);
        let circle = circles[0];
        let off = (circle.u - place[0]).hypot(circle.v - place[1]);
        assert!(off < 0.2, "{circle:?}");
        assert!((circle.r - place[2]).abs() < 0.4, "{circle:?}");
    }

    #[test]
    fn noise_and_stripes_hold_no_circles() {
        let cameras = cameras([0.0; 2]);
        let mut state = 1_u64;
        let mut noise = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as u32
        };
        let noisy: Vec<u8> = (0..400 * 312).map(|_| 100 + (noise() % 9) as u8).collect();
        assert_eq!(found(&cameras, &noisy, &[]), []);
        let stripes: Vec<u8> = (0..400 * 312)
            .map(|i| if i % 400 / 14 % 2 == 0 { 60 } else { 190 })
            .collect();
        assert_eq!(found(&cameras, &stripes, &[]), []);
    }
}
