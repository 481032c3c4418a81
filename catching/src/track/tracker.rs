//! Tracker: validates input, assigns ball numbers and reports balls.

use bytemuck::Zeroable;
use nalgebra::Vector3;
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_packets::packets::{
    BallPrediction, BallPredictions, Circles, HeadPose, MAX_BALLS, MAX_CIRCLES,
};

use super::camera::CAMERAS;
use super::config::{TrackConfig, TrackError};
use super::head::Head;
use super::mht::{Hypotheses, Track};
use crate::flight::Flight;

/// Maximum time between pictures and pose of one exposure, in ns.
const MAX_SKEW_NS: u64 = 1_000_000;
/// Step back in time, in ns, from which pictures count as a clock change instead of late.
const CLOCK_SET_NS: u64 = 1_000_000_000;
/// Maximum number of remembered ball numbers.
const MAX_NAMES: usize = 16;
/// Maximum distance in m and velocity difference in m/s at which a new track continues a lost ball.
const SAME_BALL: [f64; 2] = [0.2, 2.0];

/// Number of a reported ball.
#[derive(Debug, Clone, Copy)]
struct Name {
    root: u64,
    number: u64,
    /// Last reported flight.
    flight: Flight,
    t_ns: u64,
}

/// Tracker of balls.
#[derive(Debug, Clone)]
pub struct BallTracker {
    config: TrackConfig,
    size: [f64; 2],
    hypotheses: Hypotheses,
    /// Head pose at the last pictures.
    head: Option<Head>,
    circles: [Vec<Vector3<f64>>; CAMERAS],
    names: Vec<Name>,
    numbers: u64,
}

impl BallTracker {
    /// Creates a tracker without balls.
    ///
    /// # Errors
    /// Returns an error if a setting is invalid.
    pub fn new(robot: &RobotDescription, config: TrackConfig) -> Result<Self, TrackError> {
        config.check_settings()?;
        Ok(Self {
            config,
            size: [
                f64::from(robot.cameras.width),
                f64::from(robot.cameras.height),
            ],
            hypotheses: Hypotheses::new(robot, &config),
            head: None,
            circles: std::array::from_fn(|_| Vec::with_capacity(MAX_CIRCLES)),
            names: Vec::with_capacity(MAX_NAMES),
            numbers: 0,
        })
    }

    /// Processes the circles of a left and a right picture with the head pose at their exposure. Returns the balls that
    /// probably exist, sorted by number. Balls keep their numbers. The order of circles in a packet is irrelevant. Does
    /// not allocate.
    ///
    /// # Errors
    /// Returns an error if pictures or pose are invalid ([`TrackError`]).
    pub fn push(
        &mut self,
        circles: [&Circles; CAMERAS],
        head: &HeadPose,
    ) -> Result<BallPredictions, TrackError> {
        let exposure_ns = self.check(circles)?;
        let pose = Head::new(head).filter(|head| head.t_ns.abs_diff(exposure_ns) <= MAX_SKEW_NS);
        let Some(mut head) = pose else {
            return Err(TrackError::Head {
                exposure_ns,
                found_ns: head.t_ns,
            });
        };
        head.t_ns = exposure_ns;
        let drift = match &self.head {
            Some(last) => Some((head.drift(last), self.since(last.t_ns, exposure_ns)?)),
            None => None,
        };
        self.head = Some(head);
        for (sorted, circles) in self.circles.iter_mut().zip(circles) {
            sorted.clear();
            let circles = circles.valid().iter();
            sorted.extend(circles.map(|circle| Vector3::new(circle.u, circle.v, circle.r)));
            // Sort the circles, so that sums are equal to the bit.
            sorted.sort_unstable_by(|a, b| {
                a.x.total_cmp(&b.x)
                    .then(a.y.total_cmp(&b.y))
                    .then(a.z.total_cmp(&b.z))
            });
        }
        let [left, right] = &self.circles;
        let drift = drift.as_ref().map(|(drift, dt)| (drift, *dt));
        self.hypotheses.frame([left, right], &head, drift);
        Ok(self.report(exposure_ns, &head))
    }

    /// Returns the exposure time if the pictures are a pair with valid circles.
    fn check(&self, circles: [&Circles; CAMERAS]) -> Result<u64, TrackError> {
        let [left, right] = circles;
        let together = left.exposure_ns.abs_diff(right.exposure_ns) <= MAX_SKEW_NS;
        if left.frame != right.frame || [left.camera, right.camera] != [0, 1] || !together {
            return Err(TrackError::Pair {
                left: left.frame,
                right: right.frame,
            });
        }
        for picture in circles {
            if picture.count as usize > MAX_CIRCLES {
                return Err(TrackError::Count {
                    frame: picture.frame,
                    found: picture.count,
                });
            }
            let [width, height] = self.size;
            let sound = |u: f64, size: f64| u >= -size && u <= 2.0 * size;
            if let Some(circle) = picture
                .valid()
                .iter()
                .find(|c| !(sound(c.u, width) && sound(c.v, height) && c.r > 0.0 && c.r <= width))
            {
                return Err(TrackError::Circle {
                    frame: picture.frame,
                    u: circle.u,
                    v: circle.v,
                    r: circle.r,
                });
            }
        }
        Ok(left.exposure_ns)
    }

    /// Returns the time between two pictures, in s.
    fn since(&mut self, last_ns: u64, found_ns: u64) -> Result<f64, TrackError> {
        if found_ns <= last_ns && last_ns - found_ns <= CLOCK_SET_NS {
            return Err(TrackError::Late { last_ns, found_ns });
        }
        let dt = (found_ns as f64 - last_ns as f64) * 1e-9;
        if dt < 0.0 || dt > self.config.longest_gap {
            self.head = None;
            self.hypotheses.clear();
            self.names.clear();
            return Err(TrackError::Gap { last_ns, found_ns });
        }
        Ok(dt)
    }

    fn report(&mut self, exposure_ns: u64, head: &Head) -> BallPredictions {
        let mut balls = [BallPrediction::zeroed(); MAX_BALLS];
        // Prefer balls seen most often, then the most probable ones.
        let mut chosen: [Option<(f64, &Track)>; MAX_BALLS] = [None; MAX_BALLS];
        for track in self.hypotheses.best() {
            let mut next = Some((self.hypotheses.existence(track.root), track));
            if next.is_some_and(|(existence, _)| existence <= self.config.report) {
                continue;
            }
            let rank = |entry: &Option<(f64, &Track)>| {
                entry.map_or(-1.0, |(e, track)| e + f64::from(track.frames.min(100)))
            };
            for place in &mut chosen {
                if rank(&next) > rank(place) {
                    std::mem::swap(place, &mut next);
                }
            }
        }
        let present = |root: u64| chosen.iter().flatten().any(|(_, track)| track.root == root);
        let mut count = 0;
        for (existence, track) in chosen.iter().flatten() {
            let (names, numbers) = (&mut self.names, &mut self.numbers);
            let number = name(names, numbers, track, exposure_ns, present);
            let (p, v) = (track.state.p(), track.state.v());
            let covariance = track.state.seen_covariance(head);
            balls[count] = BallPrediction {
                ball: number,
                t_ns: exposure_ns,
                p: p.into(),
                v: v.into(),
                k: track.state.x[6],
                lift: std::array::from_fn(|i| track.state.x[7 + i]),
                covariance: std::array::from_fn(|i| std::array::from_fn(|j| covariance[(i, j)])),
                existence: existence.min(1.0) as f32,
                frames: track.frames,
            };
            count += 1;
        }
        balls[..count].sort_unstable_by_key(|ball| ball.ball);
        BallPredictions {
            exposure_ns,
            count: count as u64,
            balls,
        }
    }
}

/// Returns the number of a ball: its own, that of a lost ball expected at this position, or a new one.
fn name(
    names: &mut Vec<Name>,
    numbers: &mut u64,
    track: &Track,
    t_ns: u64,
    present: impl Fn(u64) -> bool,
) -> u64 {
    let now = track.state.flight();
    let should_be_there = |name: &Name| {
        let then = name.flight.after((t_ns - name.t_ns) as f64 * 1e-9);
        (then.p - now.p).norm() < SAME_BALL[0] && (then.v - now.v).norm() < SAME_BALL[1]
    };
    // Forget balls lost for longer.
    names.retain(|name| t_ns - name.t_ns < 300_000_000);
    let is_lost = |name: &Name| !present(name.root) && should_be_there(name);
    let known = names.iter().position(|name| name.root == track.root);
    let known = known.or_else(|| names.iter().position(is_lost));
    let name = Name {
        root: track.root,
        number: known.map_or(*numbers, |i| names[i].number),
        flight: now,
        t_ns,
    };
    match known {
        Some(i) => names[i] = name,
        None => {
            *numbers += 1;
            if names.len() == MAX_NAMES {
                names.remove(0);
            }
            names.push(name);
        }
    }
    name.number
}
