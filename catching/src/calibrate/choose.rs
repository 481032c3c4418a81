//! Greedy choice of the configurations that determine the hands best.
//!
//! The information matrix is `M = I + sum J^T J`, in standard deviations of the priors. The mean square error of hands is
//! `tr(W M^-1)`, where `W` is the mean of `H^T H` over poses, with the derivatives `H` of a hand in the cameras' frames.
//! A configuration with rows `J` reduces it by `tr((I + J M^-1 J^T)^-1 J M^-1 W M^-1 J^T)`. The algorithm repeatedly
//! takes the configuration that reduces it most. Maximising `log det M` instead determines directions that hands do not
//! depend on, and leaves hands less exact than random configurations.

use nalgebra::{DMatrix, Matrix3xX, Point3, Vector3};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, JOINTS, joint};

use super::error::CalibrationError;
use super::gravity::loads;
use super::model::{Model, seen_from_camera};
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
/// Maximum number of poses at which hands are considered.
const POSES: usize = 100;
/// Reason why information matrices have Cholesky factors.
const POSITIVE: &str = "the identity plus squares is positive definite";
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
        let loads = loads(robot, self.arm, &self.q);
        Picture::without_features(self.arm, self.q, loads, neck)
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
    let weight = hands(model, config, candidates)?;
    let mut left = [of_each_arm; ARMS];
    let mut chosen = Vec::with_capacity(ARMS * of_each_arm);
    while left != [0; ARMS] {
        let covariance = known.clone().cholesky().map(|factor| factor.inverse());
        let covariance = covariance.expect(POSITIVE);
        let weighted = &covariance * &weight * &covariance;
        let (_, best) = (0..candidates.len())
            .filter(|i| left[candidates[*i].arm] > 0 && !chosen.contains(i))
            .map(|i| (reduced(&covariance, &weighted, &rows[i]), i))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .expect("enough candidates of each arm were checked above");
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
    let lower = known.cholesky().expect(POSITIVE).unpack();
    Ok(2.0 * lower.diagonal().iter().map(|x| x.ln()).sum::<f64>())
}

/// Returns the reduction of the hands' mean square error, in m^2. The columns of `rows` are the rows of `J`.
fn reduced(covariance: &DMatrix<f64>, weighted: &DMatrix<f64>, rows: &DMatrix<f64>) -> f64 {
    let spread = rows.tr_mul(&(covariance * rows)) + DMatrix::identity(rows.ncols(), rows.ncols());
    let factor = spread.cholesky().expect(POSITIVE);
    factor.solve(&rows.tr_mul(&(weighted * rows))).trace()
}

/// Returns the mean of `H^T H` over poses and cameras, in m^2, from differences of half a standard deviation.
fn hands(
    model: &Model,
    config: &CalibrationConfig,
    poses: &[Candidate],
) -> Result<DMatrix<f64>, CalibrationError> {
    let (guess, sigmas) = (config.priors.guess(), config.priors.sigmas()?);
    let poses = &poses[..poses.len().min(POSES)];
    let mut mean = DMatrix::zeros(UNKNOWNS, UNKNOWNS);
    for pose in poses {
        let loads = loads(model.robot(), pose.arm, &pose.q);
        for camera in 0..CAMERAS {
            let seen = |unknown: usize, part: f64| {
                let mut x = guess.clone();
                x[unknown] += part * sigmas[unknown];
                seen_from_camera(model, &x, camera, pose.arm, &pose.q, &loads, pose.gaze)
            };
            let columns: Vec<_> = (0..UNKNOWNS)
                .map(|i| seen(i, 0.5) - seen(i, -0.5))
                .collect();
            let slope = Matrix3xX::from_columns(&columns);
            mean += slope.tr_mul(&slope) / (CAMERAS * poses.len()) as f64;
        }
    }
    Ok(mean)
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

    /// Returns the root mean square error of hands after configurations, in m.
    fn error(model: &Model, of: &[Candidate], views: &[NeckMotion], poses: &[Candidate]) -> f64 {
        let config = CalibrationConfig::default();
        let mut known = DMatrix::<f64>::identity(UNKNOWNS, UNKNOWNS);
        for one in of {
            let rows = rows(model, &config, one, views).unwrap();
            known += &rows * rows.transpose();
        }
        let covariance = known.cholesky().unwrap().inverse();
        let weight = hands(model, &config, poses).unwrap();
        (weight * covariance).trace().sqrt()
    }

    #[test]
    fn each_configuration_is_the_one_that_leaves_the_least_error_of_hands() {
        let model = Model::new(&Robot::nominal());
        let config = CalibrationConfig::default();
        let candidates = candidates(&model, 24);
        let views = [[0.0; 2], [0.2, -0.15]].map(NeckMotion::standing);
        let chosen = choose(&model, &config, &candidates, &views, 3).unwrap();
        assert_eq!(chosen.len(), 6);
        let error = |of: &[Candidate]| error(&model, of, &views, &candidates);
        assert!(error(&chosen) < error(&candidates[..6]));
        for (number, next) in chosen.iter().enumerate() {
            let taken = &chosen[..number];
            let with = |one: &Candidate| error(&[taken, &[*one]].concat());
            let room = |arm| taken.iter().filter(|one| one.arm == arm).count() < 3;
            let left = candidates
                .iter()
                .filter(|one| !taken.contains(one) && room(one.arm));
            let best = left.map(with).fold(f64::INFINITY, f64::min);
            // The tolerance covers rounding.
            assert!(with(next) < best * (1.0 + 1e-9));
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
