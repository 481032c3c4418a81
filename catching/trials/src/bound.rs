//! Cramer-Rao bound for the prediction of flights from the circles of both cameras with a fixed head.

use nalgebra::{Isometry3, Matrix3, Point3, SMatrix, SVector, Vector3};
use tactnet_catching::flight::{BALL_RADIUS, Flight};
use tactnet_catching_packets::Cameras;

/// Standard deviation of the centre of a circle, in pixels.
const CENTRE: f64 = 0.3;
const RADIUS: f64 = 0.4;
/// Relative standard deviation of the drag before the first picture.
const DRAG_PRIOR: f64 = 0.15;

/// Minimum root mean square error of an unbiased prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// Time from the last picture to the catch, in s.
    pub left: f64,
    /// Error perpendicular to the flight, in mm.
    pub across_mm: f64,
    /// Error along the flight, in ms.
    pub along_ms: f64,
}

/// Returns the bounds for a flight of `seconds`, from the second picture on, for a head at `head` in the inertial
/// frame.
///
/// - `first`: time from the release to the first picture, in s
pub fn bounds(
    release: &Flight,
    first: f64,
    seconds: f64,
    head: &Isometry3<f64>,
    cameras: &Cameras,
) -> Vec<Bound> {
    let to_head = head.inverse();
    let Flight { p, v, k, .. } = release;
    let state = State::from([p.x, p.y, p.z, v.x, v.y, v.z, *k]);
    let mut information = SMatrix::<f64, 7, 7>::identity() * 1e-9;
    information[(6, 6)] += (DRAG_PRIOR * release.k).powi(-2);
    let caught = flight_of(&state).after(seconds);
    let heading = caught.v / caught.v.norm();
    let at_catch = slopes(&state, |state| flight_of(state).after(seconds).p);
    let mut found = Vec::new();
    let frame = 1.0 / cameras.rate;
    for picture in 0.. {
        let t = first + frame * f64::from(picture);
        if t >= seconds {
            break;
        }
        let seen = slopes(&state, |state| {
            let ball = to_head * Point3::from(flight_of(state).after(t).p);
            circles(&ball, cameras)
        });
        information += seen.transpose() * seen;
        if picture == 0 {
            continue;
        }
        let Some(covariance) = information.try_inverse() else {
            continue;
        };
        let position: Matrix3<f64> = at_catch * covariance * at_catch.transpose();
        let along = (heading.transpose() * position * heading)[0].max(0.0);
        found.push(Bound {
            left: seconds - t,
            across_mm: (position.trace() - along).max(0.0).sqrt() * 1e3,
            along_ms: along.sqrt() / caught.v.norm() * 1e3,
        });
    }
    found
}

/// Position, velocity and drag of a ball.
type State = SVector<f64, 7>;

fn flight_of(state: &State) -> Flight {
    let [p, v] = [0, 3].map(|first| state.fixed_rows::<3>(first).into_owned());
    Flight::without_spin(p, v, state[6])
}

/// Returns centre and radius of a ball in the pictures of both cameras, in standard deviations.
///
/// - `ball`: position in the frame of the head, in m
fn circles(ball: &Point3<f64>, cameras: &Cameras) -> SVector<f64, 6> {
    let seen = ball.coords - Vector3::from(cameras.centre);
    let mut numbers = SVector::<f64, 6>::zeros();
    for (camera, side) in [0.5, -0.5].into_iter().enumerate() {
        let p = seen - Vector3::new(0.0, side * cameras.baseline, 0.0);
        numbers[3 * camera] = -cameras.focal * p.y / p.x / CENTRE;
        numbers[3 * camera + 1] = -cameras.focal * p.z / p.x / CENTRE;
        numbers[3 * camera + 2] = cameras.focal * BALL_RADIUS / p.x / RADIUS;
    }
    numbers
}

/// Returns the central differences of a function of a state.
pub(crate) fn slopes<const N: usize, const M: usize>(
    state: &SVector<f64, M>,
    of: impl Fn(&SVector<f64, M>) -> SVector<f64, N>,
) -> SMatrix<f64, N, M> {
    let mut slopes = SMatrix::<f64, N, M>::zeros();
    for i in 0..M {
        let h = 1e-5;
        let (mut more, mut less) = (*state, *state);
        more[i] += h;
        less[i] -= h;
        slopes.set_column(i, &((of(&more) - of(&less)) / (2.0 * h)));
    }
    slopes
}

#[cfg(test)]
mod tests {
    use tactnet_catching_packets::RobotDescription;

    use super::*;

    /// A throw from 5 m that is caught after 0.8 s at 6.4 m/s. Published values for these cameras are 9.0 and 2.9 mm,
    /// 2.1 and 0.83 ms for 10 and 15 pictures. The places of head and catch are not published, so the tolerance is a
    /// third.
    #[test]
    fn bounds_are_near_those_that_others_found() {
        let cameras = RobotDescription::nominal().cameras;
        let (p, v) = (Vector3::new(5.6, 0.0, 1.5), Vector3::new(-6.6, 0.1, 3.3));
        let (release, head) = (
            Flight::without_spin(p, v, 0.032),
            Isometry3::translation(0.0, 0.0, 1.45),
        );
        let bounds = bounds(&release, 0.02, 0.8, &head, &cameras);
        let at = |left: f64| {
            let off = |bound: &Bound| (bound.left - left).abs();
            *bounds
                .iter()
                .min_by(|a, b| off(a).total_cmp(&off(b)))
                .unwrap()
        };
        let (ten, fifteen) = (at(0.4), at(0.2));
        assert!((ten.across_mm / 9.0 - 1.0).abs() < 0.34, "{ten:?}");
        assert!((ten.along_ms / 2.1 - 1.0).abs() < 0.34, "{ten:?}");
        assert!((fifteen.across_mm / 2.9 - 1.0).abs() < 0.34, "{fifteen:?}");
        assert!((fifteen.along_ms / 0.83 - 1.0).abs() < 0.34, "{fifteen:?}");
        assert!(bounds.is_sorted_by(|a, b| b.across_mm < a.across_mm));
    }
}
