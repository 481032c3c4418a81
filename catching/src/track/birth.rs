//! Creation of a track from one stereo pair: position, consistency of disparity and radius, and prior of the velocity.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::camera::{CAMERAS, Camera};
use super::config::TrackConfig;
use super::head::{Head, HeadMatrix};
use super::triangular::lower;
use super::ukf::{BallState, STATES};
use crate::flight::GRAVITY;

/// Number of Gauss-Newton steps; the third one moves by nanometres.
const STEPS: usize = 3;

/// Candidate of a new ball.
#[derive(Debug, Clone)]
pub(super) struct Birth {
    pub state: BallState,
    /// Logarithm of the density that a ball appears, is detected in both pictures and causes these two circles, in
    /// 1/px^6.
    pub log_density: f64,
}

/// Returns the ball that corresponds to a left and a right circle. Of their six values, a position explains three; the
/// rest must lie within the gate. Returns `None` if rows, radii and disparity disagree or no ball can appear there.
pub(super) fn birth(
    cameras: &[Camera; CAMERAS],
    circles: [&Vector3<f64>; CAMERAS],
    head: &Head,
    head_root: &HeadMatrix,
    config: &TrackConfig,
) -> Option<Birth> {
    let variances = config.variances();
    // Cheap tests first: rows and radii differ only by noise.
    let off = circles[0] - circles[1];
    let rows = (off.y - row_difference(cameras, circles)).powi(2) / (2.0 * variances.y);
    // Radii are equal near the optical axis and differ by up to 2 % far from it.
    let radii = (off.z.abs() - 0.02 * circles[0].z).max(0.0).powi(2) / (2.0 * variances.z);
    if rows > config.gate || radii > config.gate || off.x <= 0.0 {
        return None;
    }
    let (seen, covariance, square) = triangulate(cameras, circles, &variances)?;
    let throws = &config.throws;
    let p = head.position + head.rotation * seen;
    let within = (throws.distance[0]..=throws.distance[1]).contains(&seen.norm())
        && (throws.lowest..=throws.highest).contains(&p.z);
    if square > config.gate || !within {
        return None;
    }
    let turned = head.rotation * covariance * head.rotation.transpose();
    let mut state = thrown(&p, &turned, head, config)?;
    state.born_from(head, head_root);
    // Integral of the density of the six values over all positions, uniform in the volume.
    let logs = variances.iter().map(|v| (v * std::f64::consts::TAU).ln());
    let log_noise = CAMERAS as f64 * logs.sum::<f64>();
    let log_position = (covariance * std::f64::consts::TAU).determinant().ln();
    let log_density = (config.births / throws.volume).ln()
        + 2.0 * config.detection.ln()
        + 0.5 * (log_position - log_noise - square);
    log_density
        .is_finite()
        .then_some(Birth { state, log_density })
}

/// Returns the row difference of a ball between left and right picture, in pixels, that results from different heights
/// or forward positions of the cameras. It is 0 for aligned cameras. The depth follows from the disparity.
fn row_difference(cameras: &[Camera; CAMERAS], circles: [&Vector3<f64>; CAMERAS]) -> f64 {
    let [left, right] = cameras;
    let apart = left.offset - right.offset;
    let down = (circles[1].y - right.size[1] / 2.0) / right.focal;
    (circles[0].x - circles[1].x) / apart.y * (apart.z + down * apart.x)
}

/// Returns position and covariance in the head frame by weighted least squares, and the remaining sum of squares.
fn triangulate(
    cameras: &[Camera; CAMERAS],
    circles: [&Vector3<f64>; CAMERAS],
    variances: &Vector3<f64>,
) -> Option<(Vector3<f64>, Matrix3<f64>, f64)> {
    let [left, right] = cameras;
    let depth = left.focal * (left.offset.y - right.offset.y) / (circles[0].x - circles[1].x);
    let mut p = left.offset
        + Vector3::new(
            depth,
            (left.size[0] / 2.0 - circles[0].x) * depth / left.focal,
            (left.size[1] / 2.0 - circles[0].y) * depth / left.focal,
        );
    let see = |p: &Vector3<f64>| -> Option<SVector<f64, 6>> {
        let [a, b] = [left.outline(p)?, right.outline(p)?];
        Some(SVector::from_iterator(a.iter().chain(b.iter()).copied()))
    };
    let found =
        SVector::<f64, 6>::from_iterator(circles[0].iter().chain(circles[1].iter()).copied());
    let weights = SVector::<f64, 6>::from_fn(|i, _| 1.0 / variances[i % 3]);
    let mut covariance = Matrix3::zeros();
    for _ in 0..STEPS {
        let mut jacobian = SMatrix::<f64, 6, 3>::zeros();
        let h = 1e-5;
        for i in 0..3 {
            let step = Vector3::ith(i, h);
            jacobian.set_column(i, &((see(&(p + step))? - see(&(p - step))?) / (2.0 * h)));
        }
        let weighted = SMatrix::<f64, 3, 6>::from_fn(|i, j| jacobian[(j, i)] * weights[j]);
        covariance = (weighted * jacobian).try_inverse()?;
        p += covariance * (weighted * (found - see(&p)?));
    }
    let off = found - see(&p)?;
    let square = off.component_mul(&off).dot(&weights);
    let covariance = (covariance + covariance.transpose()) * 0.5;
    (square.is_finite() && p.x > 0.0).then_some((p, covariance, square))
}

/// Returns a ball at `p`, thrown at the robot: with the prior's horizontal speed and the vertical speed needed to
/// arrive.
fn thrown(
    p: &Vector3<f64>,
    covariance: &Matrix3<f64>,
    head: &Head,
    config: &TrackConfig,
) -> Option<BallState> {
    let throws = &config.throws;
    let to_aim = head.position + Vector3::from(throws.aim) - p;
    let distance = to_aim.xy().norm().max(0.2);
    let ahead = Vector3::new(to_aim.x, to_aim.y, 0.0) / to_aim.xy().norm();
    if !ahead.x.is_finite() {
        return None;
    }
    let aside = Vector3::z().cross(&ahead);
    let [towards, spread] = throws.towards;
    let time = distance / towards;
    let rise = to_aim.z / time + GRAVITY * time / 2.0;
    // A slower ball must fly higher.
    let rise_by_speed = to_aim.z / distance - GRAVITY * distance / (2.0 * towards * towards);
    // Limits lateral speeds to the forward speed.
    let sideways = (throws.spread[0] / time).min(towards / 2.0);
    let upward = (throws.spread[1] / time).min(towards / 2.0);
    let mut columns = SMatrix::<f64, STATES, { 2 * STATES }>::zeros();
    let position = covariance.cholesky()?.unpack();
    columns.fixed_view_mut::<3, 3>(0, 0).copy_from(&position);
    let mut velocity = columns.fixed_view_mut::<3, 3>(3, 3);
    let by_speed = ahead * spread + Vector3::z() * (rise_by_speed * spread);
    velocity.set_column(0, &by_speed);
    velocity.set_column(1, &(aside * sideways));
    velocity.set_column(2, &(Vector3::z() * upward));
    columns[(6, 6)] = config.drag[1];
    for i in 7..STATES {
        columns[(i, i)] = config.lift;
    }
    let v = ahead * towards + Vector3::z() * rise;
    let forces = [config.drag[0], 0.0, 0.0, 0.0];
    let x = SVector::from_iterator(p.iter().chain(v.iter()).chain(&forces).copied());
    Some(BallState::new(x, lower(columns)))
}

/// Returns false if the ball deviates by more than three standard deviations from a throw: too slow, too fast, or too
/// high.
pub(super) fn is_throw(state: &BallState, config: &TrackConfig) -> bool {
    let throws = &config.throws;
    let covariance = state.covariance();
    let (v, speed) = (state.v(), state.v().norm());
    let velocity = covariance.fixed_view::<3, 3>(3, 3);
    let sigma = 3.0 * (v.transpose() * velocity * v)[0].max(0.0).sqrt() / speed.max(1e-3);
    let rise = v.z.max(0.0);
    let apex = state.x[2] + rise * rise / (2.0 * GRAVITY);
    // Derivative of the apex with respect to the vertical velocity; that with respect to the height is 1.
    let by_velocity = rise / GRAVITY;
    let apex_variance = covariance[(2, 2)]
        + 2.0 * by_velocity * covariance[(2, 5)]
        + by_velocity * by_velocity * covariance[(5, 5)];
    speed + sigma > throws.speed[0]
        && speed - sigma < throws.speed[1]
        && apex - 3.0 * apex_variance.max(0.0).sqrt() < throws.highest
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use proptest::prelude::*;
    use tactnet_catching_packets::RobotDescription;
    use tactnet_catching_packets::packets::HeadPose;

    fn cameras() -> [Camera; 2] {
        Camera::pair(&RobotDescription::nominal().cameras)
    }

    fn head() -> Head {
        Head::new(&HeadPose {
            position: [0.1, 0.0, 1.45],
            quaternion: [0.0, 0.0, 0.0, 1.0],
            ..HeadPose::zeroed()
        })
        .unwrap()
    }

    /// Calibrated cameras may be misaligned.
    #[test]
    fn a_ball_is_born_before_cameras_of_which_one_sits_higher_and_farther_ahead() {
        let mut description = RobotDescription::nominal().cameras;
        description.shifts = [[0.006, 0.0, -0.004], [-0.004, 0.002, 0.006]];
        let cameras = Camera::pair(&description);
        let head = head();
        for seen in [[5.0, 0.4, 1.0], [4.0, -0.3, -0.8], [2.0, 0.1, 0.3]].map(Vector3::from) {
            let [left, right] = cameras.map(|camera| camera.outline(&seen).unwrap());
            let config = TrackConfig::default();
            let birth = birth(&cameras, [&left, &right], &head, &head.root(), &config).unwrap();
            let found = birth.state.x.fixed_rows::<3>(0) - head.position;
            // Tolerance: the last Gauss-Newton step.
            assert!((found - seen).norm() < 1e-6, "{found}");
        }
    }

    fn born(circles: [Vector3<f64>; 2]) -> Option<Birth> {
        let head = head();
        let (config, circles) = (TrackConfig::default(), circles.each_ref());
        birth(&cameras(), circles, &head, &head.root(), &config)
    }

    proptest! {
        #[test]
        fn a_ball_is_born_where_it_is(x in 1.0..7.0f64, y in -0.4..0.4f64, z in -0.2..0.3f64) {
            let seen = Vector3::new(x, y * x, z * x);
            let p = head().position + seen;
            prop_assume!(seen.norm() < 7.9 && (0.3..4.0).contains(&p.z));
            let state = born(cameras().map(|camera| camera.outline(&seen).unwrap())).unwrap().state;
            prop_assert!((state.p() - p).norm() < 1e-6, "{}", (state.p() - p).norm());
            prop_assert!(state.v().x < -3.0 && state.covariance().cholesky().is_some());
        }
    }

    #[test]
    fn circles_that_disagree_on_the_depth_are_no_ball() {
        let seen = Vector3::new(4.0, 0.3, 0.2);
        let circles = cameras().map(|camera| camera.outline(&seen).unwrap());
        assert!(born(circles).is_some());
        for change in [
            // Rows, radii compared with each other, radii compared with the disparity.
            [Vector3::y() * 3.0, Vector3::zeros()],
            [Vector3::z() * 3.0, Vector3::zeros()],
            [Vector3::z() * 3.0, Vector3::z() * 3.0],
            [Vector3::x() * 30.0, Vector3::zeros()],
            [Vector3::x() * -150.0, Vector3::zeros()],
        ] {
            let born = born([0, 1].map(|i| circles[i] + change[i]));
            assert!(born.is_none(), "{change:?}");
        }
    }

    #[test]
    fn resting_and_too_high_balls_are_not_throws() {
        let state = |v: [f64; 3]| {
            let x =
                SVector::from_row_slice(&[4.0, 0.0, 1.5, v[0], v[1], v[2], 0.03, 0.0, 0.0, 0.0]);
            BallState::new(x, SMatrix::identity() * 0.1)
        };
        let config = TrackConfig::default();
        assert!(is_throw(&state([-5.0, 0.0, 3.0]), &config));
        assert!(!is_throw(&state([0.0, 0.0, 0.0]), &config));
        assert!(!is_throw(&state([-11.0, 0.0, 0.0]), &config));
        assert!(!is_throw(&state([-2.0, 0.0, 8.5]), &config));
    }
}
