//! Multiple hypothesis tracker (Reid 1979, Cox and Hingorani 1996).
//!
//! A hypothesis has a weight relative to the one that explains all circles as clutter of density `c`. A track with
//! existence `e` and detection probability `d` contributes `e d N / c` if it has a circle of density `N`, and `1 - e d`
//! otherwise. A birth contributes the density of its pair over `c^2`. Within a hypothesis, a track with a circle
//! exists; one without exists with probability `e (1 - d) / (1 - e d)`. The sum over all hypotheses is the existence
//! probability of a ball. The ancestor of the best hypothesis some pictures ago is accepted (N-scan pruning).
//!
//! Hypotheses share tracks: each circle updates each track at most once.
//!
//! Clutter is not independent from picture to picture: round objects of a room are found again and again. A pair of
//! circles is therefore no new ball if it is where a pair of an earlier picture was ([`Place`]).

mod assign;

use nalgebra::{Matrix3, Vector3};
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_packets::packets::MAX_CIRCLES;

use super::birth::{Birth, birth, is_throw};
use super::camera::{CAMERAS, Camera, View};
use super::config::TrackConfig;
use super::head::{Head, HeadDrift};
use super::murty::{Costs, KBest};
use super::ukf::{BallState, Sight};
use crate::flight::BALL_RADIUS;

pub(super) const MAX_HYPOTHESES: usize = 64;
/// Maximum number of pictures before the best hypothesis is accepted.
pub(super) const MAX_SCANS: usize = 8;
/// Maximum number of tracks per hypothesis.
const MAX_TRACKS: usize = 8;
/// Maximum number of circle pairs that may be new balls.
const MAX_BIRTHS: usize = 64;
/// Number of pictures whose pairs are remembered, and maximum number of pairs of each.
const REMEMBERED: usize = 3;
const MAX_PLACES: usize = 256;
/// Error of the head's direction between remembered pictures, in rad. A thrown ball moves by many times more.
const DIRECTION_ERROR: f64 = 0.002;
/// Existence probability below which a track ends.
const LEAST_EXISTENCE: f64 = 0.01;
/// Distance in front of the head below which a ball has passed, in m.
const PASSED: f64 = 0.1;
/// Index that stands for no circle or no track.
const NONE: u16 = u16::MAX;

/// Ball of a hypothesis.
#[derive(Debug, Clone)]
pub(super) struct Track {
    pub state: BallState,
    /// Identifier of its birth, equal in all hypotheses.
    pub root: u64,
    /// Existence probability.
    pub existence: f64,
    /// Number of picture pairs in which both cameras detected it.
    pub frames: u32,
    found: [bool; CAMERAS],
    visible: bool,
    /// Time for which no camera can see it, in s.
    unseen: f64,
}

#[derive(Debug, Clone, Copy)]
struct Hypothesis {
    log_weight: f64,
    tracks: [u16; MAX_TRACKS],
    count: usize,
    /// Bit set of the left circles assigned to a track.
    used: u32,
    /// Identifiers of the hypothesis and its ancestors, picture by picture.
    history: [u64; MAX_SCANS + 1],
}

impl Hypothesis {
    fn tracks(&self) -> &[u16] {
        &self.tracks[..self.count]
    }

    fn keep(&mut self, keep: impl Fn(u16) -> bool) {
        let mut count = 0;
        for i in 0..self.count {
            if keep(self.tracks[i]) {
                self.tracks[count] = self.tracks[i];
                count += 1;
            }
        }
        self.count = count;
    }

    fn push(&mut self, track: u16) {
        if track != NONE && self.count < MAX_TRACKS {
            self.tracks[self.count] = track;
            self.count += 1;
        }
    }
}

/// Result of one assignment for a hypothesis.
#[derive(Debug, Clone, Copy)]
struct Child {
    parent: usize,
    log_weight: f64,
    circles: [u16; MAX_TRACKS],
    /// Indices of the birth candidates.
    births: [u16; MAX_TRACKS],
    born: usize,
}

/// Pair of circles that may be a new ball.
#[derive(Debug, Clone)]
struct Candidate {
    left: usize,
    right: usize,
    birth: Birth,
    /// Its track, once a hypothesis uses it.
    track: u16,
}

/// Position of a pair of circles in the inertial frame.
#[derive(Debug, Clone, Copy)]
struct Place {
    p: Vector3<f64>,
    covariance: Matrix3<f64>,
}

impl Place {
    fn of(state: &BallState, head: &Head) -> Self {
        let p = state.p();
        let aside = DIRECTION_ERROR * (p - head.position).norm();
        let covariance = state.covariance().fixed_view::<3, 3>(0, 0).into_owned();
        Self {
            p,
            covariance: covariance + Matrix3::from_diagonal_element(aside * aside),
        }
    }

    /// Returns true if both may be the same object at rest.
    fn is_same(&self, other: &Self, gate: f64) -> bool {
        let off = self.p - other.p;
        let inverse = || (self.covariance + other.covariance).try_inverse();
        off.norm_squared() < 1.0 && inverse().is_some_and(|s| (off.transpose() * s * off)[0] < gate)
    }
}

/// All hypotheses, best first, with their tracks.
#[derive(Debug, Clone)]
pub(super) struct Hypotheses {
    config: TrackConfig,
    cameras: [Camera; CAMERAS],
    exposure: f64,
    log_clutter: f64,
    tracks: Vec<Track>,
    updated: Vec<Track>,
    hypotheses: Vec<Hypothesis>,
    children: Vec<Child>,
    candidates: Vec<Candidate>,
    /// Pairs of this picture and of earlier ones, newest first.
    places: [Vec<Place>; REMEMBERED + 1],
    sights: Vec<Option<Sight>>,
    /// Log weight gain of an assigned circle, by track and circle.
    gains: Vec<f64>,
    /// Log weight of a missing circle, by track.
    misses: Vec<f64>,
    /// Updated tracks by track and circle, with the missed one last.
    memo: Vec<u16>,
    costs: Costs,
    best: KBest,
    roots: u64,
    ids: u64,
}

impl Hypotheses {
    pub fn new(robot: &RobotDescription, config: &TrackConfig) -> Self {
        let most = MAX_HYPOTHESES * MAX_TRACKS;
        let [width, height] = Camera::pair(&robot.cameras)[0].size;
        let radii = config.clutter_radius[1] - config.clutter_radius[0];
        let mut hypotheses = Vec::with_capacity(MAX_HYPOTHESES);
        hypotheses.push(Hypothesis {
            log_weight: 0.0,
            tracks: [NONE; MAX_TRACKS],
            count: 0,
            used: 0,
            history: [0; MAX_SCANS + 1],
        });
        Self {
            config: *config,
            cameras: Camera::pair(&robot.cameras),
            exposure: robot.cameras.exposure,
            log_clutter: (config.clutter / (width * height * radii)).ln(),
            tracks: Vec::with_capacity(most),
            updated: Vec::with_capacity(most),
            hypotheses,
            children: Vec::with_capacity(MAX_HYPOTHESES + 1),
            candidates: Vec::with_capacity(MAX_BIRTHS),
            places: std::array::from_fn(|_| Vec::with_capacity(MAX_PLACES)),
            sights: Vec::with_capacity(most),
            gains: vec![0.0; most * MAX_CIRCLES],
            misses: vec![0.0; most],
            memo: vec![NONE; most * (MAX_CIRCLES + 1)],
            costs: Costs::default(),
            best: KBest::new(config.assignments),
            roots: 0,
            ids: 0,
        }
    }

    /// Removes all tracks.
    pub fn clear(&mut self) {
        self.tracks.clear();
        self.places.iter_mut().for_each(Vec::clear);
        self.hypotheses.truncate(1);
        let only = &mut self.hypotheses[0];
        (only.log_weight, only.count) = (0.0, 0);
    }

    /// Processes a pair of pictures, `dt` s after the previous one. Does not allocate.
    pub fn frame(
        &mut self,
        circles: [&[Vector3<f64>]; CAMERAS],
        head: &Head,
        drift: Option<(&HeadDrift, f64)>,
    ) {
        let dt = drift.map_or(0.0, |(_, dt)| dt);
        if let Some((drift, dt)) = drift {
            for track in &mut self.tracks {
                track.existence *= self.config.survival;
                if track.state.predict(dt, drift, &self.config).is_none() {
                    track.existence = 0.0;
                }
            }
            // Invalid filters must not predict circles.
            self.drop_tracks(|track| track.existence > 0.0);
        }
        for track in &mut self.tracks {
            (track.found, track.visible) = ([false; CAMERAS], false);
        }
        self.candidates.clear();
        self.scan(0, circles[0], head);
        self.seek_births(circles, head);
        self.scan(1, circles[1], head);
        for track in &mut self.tracks {
            track.frames += u32::from(track.found == [true; CAMERAS]);
            let unseen = track.unseen + dt;
            track.unseen = if track.visible { 0.0 } else { unseen };
        }
        let config = self.config;
        self.drop_tracks(|track| {
            let ahead = (head.rotation.transpose() * (track.state.p() - head.position)).x;
            let flies = track.state.x[2] > BALL_RADIUS && ahead > PASSED;
            let exists = track.existence > LEAST_EXISTENCE && track.unseen < config.longest_unseen;
            flies && exists && is_throw(&track.state, &config)
        });
        self.prune();
    }

    /// Returns the tracks of the best hypothesis.
    pub fn best(&self) -> impl Iterator<Item = &Track> {
        let best = self.hypotheses[0].tracks();
        best.iter().map(|track| &self.tracks[usize::from(*track)])
    }

    /// Returns the existence probability of a ball.
    pub fn existence(&self, root: u64) -> f64 {
        let existence = |hypothesis: &Hypothesis| {
            let tracks = hypothesis.tracks().iter();
            let tracks = tracks.map(|track| &self.tracks[usize::from(*track)]);
            let of_root = tracks.filter(|track| track.root == root);
            hypothesis.log_weight.exp() * of_root.map(|track| track.existence).sum::<f64>()
        };
        self.hypotheses.iter().map(existence).sum()
    }

    fn drop_tracks(&mut self, keep: impl Fn(&Track) -> bool) {
        let Self {
            tracks, hypotheses, ..
        } = self;
        for hypothesis in hypotheses {
            hypothesis.keep(|track| keep(&tracks[usize::from(track)]));
        }
    }

    /// Assigns the circles of one picture to the tracks of each hypothesis in the best ways.
    fn scan(&mut self, camera: usize, circles: &[Vector3<f64>], head: &Head) {
        self.compare(camera, circles, head);
        self.assign(circles.len());
        self.apply(camera, circles);
    }

    fn compare(&mut self, camera: usize, circles: &[Vector3<f64>], head: &Head) {
        let view = View::new(self.cameras[camera], head);
        self.sights.clear();
        for (i, track) in self.tracks.iter_mut().enumerate() {
            let sight = track.state.sight(&view, &self.config, self.exposure);
            let detection = sight.as_ref().map_or(0.0, |sight| {
                let inside = view.camera.inside(&sight.circle) / (3.0 * sight.sigma);
                // At the picture's edge, both outcomes are equally probable.
                self.config.detection * ((inside + 1.0) / 2.0).clamp(0.0, 1.0)
            });
            track.visible |= detection > 0.0;
            let found = track.existence * detection;
            self.misses[i] = (1.0 - found).ln();
            for (j, circle) in circles.iter().enumerate() {
                self.gains[i * MAX_CIRCLES + j] = match &sight {
                    Some(sight) if found > 0.0 => {
                        let (square, log_density) = sight.distance(circle);
                        if square <= self.config.gate {
                            found.ln() + log_density - self.log_clutter - self.misses[i]
                        } else {
                            f64::NEG_INFINITY
                        }
                    }
                    _ => f64::NEG_INFINITY,
                };
            }
            self.sights.push(sight);
        }
    }

    /// Collects the circle pairs that may be new balls. A left circle assigned in one hypothesis remains available in
    /// others.
    fn seek_births(&mut self, circles: [&[Vector3<f64>]; CAMERAS], head: &Head) {
        let (root, gate) = (head.root(), self.config.gate);
        self.places.rotate_right(1);
        let [places, earlier @ ..] = &mut self.places;
        places.clear();
        for (left, a) in circles[0].iter().enumerate() {
            for (right, b) in circles[1].iter().enumerate() {
                let birth = birth(&self.cameras, [a, b], head, &root, &self.config);
                let Some(birth) = birth else { continue };
                let place = Place::of(&birth.state, head);
                if places.len() < MAX_PLACES {
                    places.push(place);
                }
                let was_there = |earlier: &Place| earlier.is_same(&place, gate);
                let rests = earlier.iter().flatten().any(was_there);
                if !rests && self.candidates.len() < MAX_BIRTHS {
                    self.candidates.push(Candidate {
                        left,
                        right,
                        birth,
                        track: NONE,
                    });
                }
            }
        }
    }

    /// Converts children to hypotheses with updated tracks.
    fn apply(&mut self, camera: usize, circles: &[Vector3<f64>]) {
        self.updated.clear();
        self.memo[..self.tracks.len() * (MAX_CIRCLES + 1)].fill(NONE);
        let mut parents = [self.hypotheses[0]; MAX_HYPOTHESES];
        parents[..self.hypotheses.len()].copy_from_slice(&self.hypotheses);
        self.hypotheses.clear();
        for i in 0..self.children.len() {
            let child = self.children[i];
            let parent = parents[child.parent];
            let mut hypothesis = Hypothesis {
                log_weight: child.log_weight,
                count: 0,
                used: 0,
                ..parent
            };
            for (track, circle) in parent.tracks().iter().zip(child.circles) {
                hypothesis.push(self.updated_track(usize::from(*track), circle, camera, circles));
                if circle != NONE {
                    hypothesis.used |= 1 << circle;
                }
            }
            for candidate in &child.births[..child.born] {
                let candidate = &mut self.candidates[usize::from(*candidate)];
                if candidate.track == NONE {
                    candidate.track = self.updated.len() as u16;
                    self.updated.push(Track {
                        state: candidate.birth.state.clone(),
                        root: self.roots,
                        existence: 1.0,
                        frames: 0,
                        found: [true; CAMERAS],
                        visible: true,
                        unseen: 0.0,
                    });
                    self.roots += 1;
                }
                hypothesis.push(candidate.track);
            }
            self.hypotheses.push(hypothesis);
        }
        std::mem::swap(&mut self.tracks, &mut self.updated);
    }

    /// Returns the track after an assigned or missing circle, created on first use.
    fn updated_track(
        &mut self,
        track: usize,
        circle: u16,
        camera: usize,
        circles: &[Vector3<f64>],
    ) -> u16 {
        let missed = circle == NONE;
        let column = usize::from(circle).min(MAX_CIRCLES);
        let place = track * (MAX_CIRCLES + 1) + column;
        if self.memo[place] != NONE || self.updated.len() == self.updated.capacity() {
            return self.memo[place];
        }
        let mut after = self.tracks[track].clone();
        if missed {
            // Existence without a circle: e (1 - d) / (1 - e d).
            let neither = self.misses[track].exp();
            after.existence = 1.0 - (1.0 - after.existence) / neither;
        } else {
            after.existence = 1.0;
            after.found[camera] = true;
            let sight = self.sights[track].as_ref();
            if sight
                .and_then(|sight| after.state.update(sight, &circles[usize::from(circle)]))
                .is_none()
            {
                return NONE;
            }
        }
        self.memo[place] = self.updated.len() as u16;
        self.updated.push(after);
        self.memo[place]
    }

    /// Merges identical hypotheses, drops improbable ones, applies N-scan pruning, and removes unused tracks.
    fn prune(&mut self) {
        let Self {
            hypotheses,
            config,
            ids,
            ..
        } = self;
        // Hypotheses are sorted by weight; merging keeps the better one.
        let mut kept = 0;
        for i in 0..hypotheses.len() {
            let hypothesis = hypotheses[i];
            if let Some(same) = hypotheses[..kept]
                .iter_mut()
                .find(|other| other.tracks() == hypothesis.tracks())
            {
                let (a, b) = (same.log_weight, hypothesis.log_weight);
                same.log_weight = a.max(b) + (-(a - b).abs()).exp().ln_1p();
            } else {
                hypotheses[kept] = hypothesis;
                kept += 1;
            }
        }
        hypotheses.truncate(kept);
        hypotheses.sort_unstable_by(|a, b| {
            b.log_weight
                .total_cmp(&a.log_weight)
                .then_with(|| a.tracks().cmp(b.tracks()))
        });
        for hypothesis in hypotheses.iter_mut() {
            hypothesis.history.rotate_right(1);
            hypothesis.history[0] = *ids;
            *ids += 1;
        }
        let settled = hypotheses[0].history[config.scans];
        let least = hypotheses[0].log_weight + config.least_weight.ln();
        hypotheses.retain(|h| h.history[config.scans] == settled && h.log_weight >= least);
        let most = hypotheses[0].log_weight;
        let weights = hypotheses.iter().map(|h| (h.log_weight - most).exp());
        let sum: f64 = weights.sum();
        for hypothesis in hypotheses.iter_mut() {
            hypothesis.log_weight -= most + sum.ln();
        }
        self.remove_unused_tracks();
    }

    fn remove_unused_tracks(&mut self) {
        let Self {
            hypotheses, tracks, ..
        } = self;
        let mut kept = 0;
        for i in 0..tracks.len() {
            let old = i as u16;
            if !hypotheses.iter().any(|h| h.tracks().contains(&old)) {
                continue;
            }
            tracks.swap(kept, i);
            for hypothesis in hypotheses.iter_mut() {
                let count = hypothesis.count;
                for track in &mut hypothesis.tracks[..count] {
                    if *track == old {
                        *track = kept as u16;
                    }
                }
            }
            kept += 1;
        }
        tracks.truncate(kept);
    }
}
