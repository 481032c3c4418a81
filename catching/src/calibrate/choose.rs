//! Greedy D-optimal choice of informative configurations.
//!
//! The information matrix is `M = I + sum J^T J`, in standard deviations of the priors. A configuration with rows `J`
//! adds `log det(I + J M^-1 J^T)` to `log det M`. The algorithm repeatedly takes the configuration that adds most. The
//! gain of a configuration never increases when others are taken. Earlier values are therefore upper bounds, and only
//! few must be recomputed.

use nalgebra::{DMatrix, Point3, Vector3};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, JOINTS, joint};

use super::error::CalibrationError;
use super::gravity::loads;
use super::model::Model;
use super::problem::CalibrationConfig;
use super::session::{NeckMotion, Picture};
use super::unknowns::{UNKNOWNS, Unknowns, at};
use crate::robot::Robot;
use crate::safety::Bodies;
use crate::track::CAMERAS;

/// Fraction of the arms' joint ranges in which configurations are drawn.
const RANGE_SHARE: f64 = 0.9;
/// Smallest and largest distance of a marker from the head frame along its x axis, in m.
const MARKER_DISTANCE: [f64; 2] = [0.35, 1.2];
/// Margins of pan and tilt to the ends of their ranges, for the neck sweep and joint offsets, in rad.
const NECK_MARGIN: [f64; 2] = [0.32, 0.24];
/// Minimum distance of bodies on the way, in m. It exceeds the errors of an uncalibrated robot.
const CLEARANCE: f64 = 0.04;
/// Number of checked positions on the way from the waiting pose.
const WAY_CHECKS: usize = 12;
/// Margin at each picture edge, as a fraction of width or height, in which markers are ignored.
const PICTURE_MARGIN: f64 = 0.02;

/// Configuration of an arm with the gaze towards its marker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Arm: 0 left, 1 right.
    pub arm: usize,
    /// Joint angles of the arm, in rad.
    pub q: [f64; ARM_JOINTS],
    /// Pan and tilt towards the marker, in rad.
    pub gaze: [f64; 2],
}

/// Draws a random configuration. Returns `None` if the marker is not visible or the way from the waiting pose is
/// blocked.
///
/// - `uniform`: source of numbers distributed uniformly in 0 to 1
pub fn draw_candidate(
    model: &Model,
    bodies: &Bodies,
    guess: &Unknowns,
    arm: usize,
    mut uniform: impl FnMut() -> f64,
) -> Option<Candidate> {
    let robot = model.robot();
    let own = robot.arm(arm);
    let q: [f64; ARM_JOINTS] = std::array::from_fn(|i| {
        let [low, high] = own.joints()[i].range;
        (low + high) / 2.0 + (uniform() - 0.5) * RANGE_SHARE * (high - low)
    });
    let last = own.links(&q)[ARM_JOINTS - 1];
    let marker: Vector3<f64> = guess.fixed_rows::<3>(at::marker(arm)).into_owned();
    let point = last.origin + last.rotation * marker;
    let gaze = robot.look_at(&point);
    for (i, joint) in robot.joints()[joint::NECK].iter().enumerate() {
        let [low, high] = joint.range;
        if !(low + NECK_MARGIN[i]..=high - NECK_MARGIN[i]).contains(&gaze[i]) {
            return None;
        }
    }
    let mut neck = [0.0; JOINTS];
    neck[joint::NECK].copy_from_slice(&gaze);
    let away = (robot.head(&neck).inverse() * Point3::from(point)).x;
    let candidate = Candidate { arm, q, gaze };
    let seen = (MARKER_DISTANCE[0]..=MARKER_DISTANCE[1]).contains(&away)
        && (0..CAMERAS).all(|camera| {
            let picture = candidate.picture(robot, NeckMotion::standing(gaze));
            in_picture(model, guess, &picture, camera)
        });
    (seen && is_free(robot, bodies, &candidate)).then_some(candidate)
}

impl Candidate {
    fn picture(&self, robot: &Robot, neck: NeckMotion) -> Picture {
        Picture {
            configuration: 0,
            arm: self.arm,
            features: [None; CAMERAS],
            q: self.q,
            loads: loads(robot, self.arm, &self.q),
            neck,
        }
    }
}

fn in_picture(model: &Model, x: &Unknowns, picture: &Picture, camera: usize) -> bool {
    let cameras = &model.robot().description().cameras;
    let size = [f64::from(cameras.width), f64::from(cameras.height)];
    model.feature(x, picture, camera).is_some_and(|pixel| {
        (0..2).all(|i| {
            (PICTURE_MARGIN * size[i]..(1.0 - PICTURE_MARGIN) * size[i]).contains(&pixel[i])
        })
    })
}

/// Returns true if all bodies keep their distance on the straight joint-space way from the waiting pose.
fn is_free(robot: &Robot, bodies: &Bodies, candidate: &Candidate) -> bool {
    let waiting = robot.waiting();
    let own = joint::ARM[candidate.arm].start;
    (1..=WAY_CHECKS).rev().all(|place| {
        let part = place as f64 / WAY_CHECKS as f64;
        let mut q = waiting;
        for (i, end) in candidate.q.iter().enumerate() {
            q[own + i] += part * (end - waiting[own + i]);
        }
        bodies.least(&q) > CLEARANCE
    })
}

/// Chooses `of_each_arm` configurations of each arm, in the order in which they are taken.
///
/// - `views`: neck motions relative to the gaze while pictures are taken
///
/// # Errors
/// Returns an error if a setting is invalid or an arm has too few candidates.
pub fn choose(
    model: &Model,
    config: &CalibrationConfig,
    candidates: &[Candidate],
    views: &[NeckMotion],
    of_each_arm: usize,
) -> Result<Vec<Candidate>, CalibrationError> {
    for arm in 0..ARMS {
        let found = candidates.iter().filter(|c| c.arm == arm).count();
        if found < of_each_arm {
            return Err(CalibrationError::TooFew {
                arm,
                expected: of_each_arm,
                found,
            });
        }
    }
    let rows: Vec<DMatrix<f64>> = candidates
        .iter()
        .map(|candidate| rows(model, config, candidate, views))
        .collect::<Result<_, _>>()?;
    let mut known = DMatrix::<f64>::identity(UNKNOWNS, UNKNOWNS);
    let mut bounds = vec![f64::INFINITY; candidates.len()];
    let mut left = [of_each_arm; ARMS];
    let mut chosen = Vec::with_capacity(ARMS * of_each_arm);
    while left != [0; ARMS] {
        let lower = lower_factor(&known);
        let mut fresh = vec![false; candidates.len()];
        // Recompute until the largest bound is up to date.
        let best = loop {
            let best = (0..candidates.len())
                .filter(|i| left[candidates[*i].arm] > 0 && !chosen.contains(i))
                .max_by(|a, b| bounds[*a].total_cmp(&bounds[*b]))
                .expect("enough candidates of each arm were checked above");
            if fresh[best] {
                break best;
            }
            bounds[best] = added(&lower, &rows[best]);
            fresh[best] = true;
        };
        known += &rows[best] * rows[best].transpose();
        chosen.push(best);
        left[candidates[best].arm] -= 1;
    }
    Ok(chosen.into_iter().map(|best| candidates[best]).collect())
}

/// Returns `log det M` with the given candidates.
///
/// # Errors
/// Returns an error if a setting is invalid.
pub fn gain(
    model: &Model,
    config: &CalibrationConfig,
    candidates: &[Candidate],
    views: &[NeckMotion],
) -> Result<f64, CalibrationError> {
    let mut known = DMatrix::<f64>::identity(UNKNOWNS, UNKNOWNS);
    for candidate in candidates {
        let rows = rows(model, config, candidate, views)?;
        known += &rows * rows.transpose();
    }
    Ok(log_det(&lower_factor(&known)))
}

fn lower_factor(known: &DMatrix<f64>) -> DMatrix<f64> {
    known
        .clone()
        .cholesky()
        .expect("the identity plus squares is positive definite")
        .unpack()
}

fn log_det(lower: &DMatrix<f64>) -> f64 {
    2.0 * lower.diagonal().iter().map(|x| x.ln()).sum::<f64>()
}

/// Returns `log det(I + J M^-1 J^T)`. The columns of `rows` are the rows of `J`.
fn added(lower: &DMatrix<f64>, rows: &DMatrix<f64>) -> f64 {
    let mut reduced = rows.clone();
    lower.solve_lower_triangular_mut(&mut reduced);
    let square = reduced.tr_mul(&reduced) + DMatrix::identity(rows.ncols(), rows.ncols());
    log_det(&lower_factor(&square))
}

/// Returns the transposed scaled Jacobian of a candidate's features, `[UNKNOWNS][rows]`.
fn rows(
    model: &Model,
    config: &CalibrationConfig,
    candidate: &Candidate,
    views: &[NeckMotion],
) -> Result<DMatrix<f64>, CalibrationError> {
    let guess = config.priors.guess();
    let sigmas = config.priors.sigmas()?;
    let mut columns = Vec::new();
    for view in views {
        let neck = NeckMotion {
            q: std::array::from_fn(|i| candidate.gaze[i] + view.q[i]),
            ..*view
        };
        let picture = candidate.picture(model.robot(), neck);
        for camera in 0..CAMERAS {
            if !in_picture(model, &guess, &picture, camera) {
                continue;
            }
            let Some(block) = model.feature_with_slope(&guess, &picture, camera) else {
                continue;
            };
            for row in 0..block.rows {
                let mut column = Unknowns::zeros(UNKNOWNS);
                for (i, &unknown) in block.columns.iter().enumerate() {
                    column[unknown] =
                        block.jacobian[row][i] * sigmas[unknown] / config.noise.feature;
                }
                columns.push(column);
            }
        }
    }
    Ok(if columns.is_empty() {
        DMatrix::zeros(UNKNOWNS, 0)
    } else {
        DMatrix::from_columns(&columns)
    })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn candidates(model: &Model, count: usize) -> Vec<Candidate> {
        let bodies = Bodies::new(model.robot().description());
        let guess = CalibrationConfig::default().priors.guess();
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut found = Vec::new();
        while found.len() < count {
            let arm = found.len() % ARMS;
            let drawn = draw_candidate(model, &bodies, &guess, arm, || rng.random::<f64>());
            found.extend(drawn);
        }
        found
    }

    /// The lazy choice equals the plain greedy choice.
    #[test]
    fn the_choice_is_the_greedy_one_and_beats_the_first_candidates() {
        let model = Model::new(&Robot::nominal());
        let config = CalibrationConfig::default();
        let candidates = candidates(&model, 24);
        let views = [[0.0; 2], [0.2, -0.15]].map(NeckMotion::standing);
        let chosen = choose(&model, &config, &candidates, &views, 3).unwrap();
        assert_eq!(chosen.len(), 6);
        let all = gain(&model, &config, &chosen, &views).unwrap();
        let first = gain(&model, &config, &candidates[..6], &views).unwrap();
        assert!(all > first, "{all} {first}");
        for (number, next) in chosen.iter().enumerate() {
            let taken = &chosen[..number];
            let with = |one: &Candidate| gain(&model, &config, &[taken, &[*one]].concat(), &views);
            let room = |arm| taken.iter().filter(|one| one.arm == arm).count() < 3;
            let left = candidates
                .iter()
                .filter(|one| !taken.contains(one) && room(one.arm));
            let best = left
                .map(|one| with(one).unwrap())
                .fold(f64::NEG_INFINITY, f64::max);
            // The tolerance covers rounding.
            assert!(with(next).unwrap() > best - 1e-6);
        }
    }

    #[test]
    fn too_few_candidates_are_an_error() {
        let model = Model::new(&Robot::nominal());
        let error = choose(&model, &CalibrationConfig::default(), &[], &[], 4).unwrap_err();
        let error = error.to_string();
        assert!(error.contains("at least 4 configurations"), "{error}");
    }
}
