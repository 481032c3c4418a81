//! Filter of one ball: a square-root unscented Kalman filter of position, velocity, drag and lift (van der Merwe and
//! Wan 2001), with the head's errors as consider states (Schmidt 1966).
//!
//! The joint covariance of the head's errors (first) and the ball's is stored as a lower triangular root:
//!
//! ```text
//! | head     0  |     covariance of the ball: shared shared' + own own'
//! | shared  own |     sigma points are drawn from own alone, the ball's errors for a known head
//! ```
//!
//! The unscented transform covers the ball's own part, where flight and projection are nonlinear. The head's errors,
//! millimetres and milliradians, pass through its statistical linearisation: a head with the error `(dp, dtheta)` sees
//! a ball at `x` as if it were at `x - dp + d x dtheta`, with `d` from head to ball. For an exactly known head this is
//! the plain filter up to rounding.
//!
//! The innovation of a circle has the covariance `S = S_own + E E'`, `E = H shared + H_head head`. The gain of the ball
//! is optimal, that of the head is zero. Hence `own own'` becomes `own own' - K_0 S_own K_0' + (K - K_0) S_own (K -
//! K_0)'` with `K_0` the gain for a known head (updates and downdates of rank three), and `shared` becomes `shared - K
//! E`.

use nalgebra::{Cholesky, Matrix3, SMatrix, SVector, Vector3};
use tactnet_catching_packets::RobotDescription;

use super::camera::{CAMERAS, Camera, View};
use super::config::TrackConfig;
use super::head::{HEAD, Head, HeadDrift, HeadMatrix, set};
use super::triangular::{add, lower, subtract};
use crate::flight::Flight;

/// Number of ball states: position, velocity, drag, lift.
pub const STATES: usize = 10;
/// Spread of the sigma points.
const ALPHA: f64 = 0.5;
/// Weight of prior knowledge about the distribution; 2 is optimal for a normal one.
const BETA: f64 = 2.0;
/// `n + lambda`, with kappa = 0.
const SPREAD: f64 = ALPHA * ALPHA * STATES as f64;
/// Weight of the central sigma point in a mean: -3.
const MIDDLE: f64 = (SPREAD - STATES as f64) / SPREAD;
/// Weight of the central sigma point in a covariance: -0.25.
const MIDDLE_SQUARE: f64 = MIDDLE + 1.0 - ALPHA * ALPHA + BETA;
/// Weight of each other sigma point.
const OTHER: f64 = 0.5 / SPREAD;

type State = SVector<f64, STATES>;
type Root = SMatrix<f64, STATES, STATES>;

/// State of a ball with its covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct BallState {
    /// Position in m and velocity in m/s in the inertial frame, drag in 1/m, and lift in 1/s.
    pub x: State,
    pub(super) own: Root,
    pub(super) shared: SMatrix<f64, STATES, HEAD>,
    pub(super) head: HeadMatrix,
}

/// Predicted circle of a ball with its uncertainty.
#[derive(Debug, Clone)]
pub struct Sight {
    /// Circle: u, v, r, in pixels.
    pub circle: Vector3<f64>,
    /// Inverse of the innovation covariance.
    inverse: Matrix3<f64>,
    log_normalisation: f64,
    /// Largest standard deviation of the centre, in pixels.
    pub sigma: f64,
    /// Derivatives of the projection with respect to the ball's own errors of unit variance.
    by_own: SMatrix<f64, 3, STATES>,
    own_root: Matrix3<f64>,
    by_head: SMatrix<f64, 3, HEAD>,
}

impl Sight {
    /// Returns the squared Mahalanobis distance of a circle and the logarithm of its probability density, in 1/px^3.
    pub fn distance(&self, circle: &Vector3<f64>) -> (f64, f64) {
        let off = circle - self.circle;
        let square = (off.transpose() * self.inverse * off)[0];
        (square, self.log_normalisation - square / 2.0)
    }
}

impl BallState {
    /// Creates a ball whose errors are independent of the head's.
    ///
    /// - `root`: lower triangular root of the covariance
    pub fn new(x: State, root: Root) -> Self {
        Self {
            x,
            own: root,
            shared: SMatrix::zeros(),
            head: HeadMatrix::zeros(),
        }
    }

    /// Returns the flight.
    pub fn flight(&self) -> Flight {
        flight(&self.x)
    }

    /// Returns the position, in m.
    pub fn p(&self) -> Vector3<f64> {
        self.x.fixed_rows::<3>(0).into_owned()
    }

    /// Returns the velocity, in m/s.
    pub fn v(&self) -> Vector3<f64> {
        self.x.fixed_rows::<3>(3).into_owned()
    }

    /// Returns the covariance, including the head's contribution.
    pub fn covariance(&self) -> Root {
        self.own * self.own.transpose() + self.shared * self.shared.transpose()
    }

    /// Returns the covariance relative to the head, whose own error moves the ball alike.
    pub fn seen_covariance(&self, head: &Head) -> Root {
        let shared = self.shared - self.with_head(head) * self.head;
        self.own * self.own.transpose() + shared * shared.transpose()
    }

    /// Returns the derivative of the ball's state with respect to the head's errors for a ball that moves rigidly with
    /// the head.
    fn with_head(&self, head: &Head) -> SMatrix<f64, STATES, HEAD> {
        let mut by_head = SMatrix::<f64, STATES, HEAD>::zeros();
        by_head.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        by_head.fixed_view_mut::<3, 3>(3, 3).fill_with_identity();
        let moved = -(self.p() - head.position).cross_matrix();
        set(&mut by_head, [0, 6], &moved);
        let faster = -(self.v() - head.velocity).cross_matrix();
        set(&mut by_head, [3, 6], &faster);
        by_head
    }

    /// Predicts the state `dt` s ahead: 21 integrated flights, with white acceleration and random walks of drag and
    /// lift as noise. Returns `None` if the covariance is no longer positive definite; the filter is then invalid.
    pub(super) fn predict(
        &mut self,
        dt: f64,
        drift: &HeadDrift,
        config: &TrackConfig,
    ) -> Option<()> {
        let fly = |x: &State| {
            let ball = flight(x).after(dt);
            let motion = ball.p.iter().chain(&ball.v);
            let forces = std::iter::once(&ball.k).chain(&ball.lift);
            State::from_iterator(motion.chain(forces).copied())
        };
        let scale = SPREAD.sqrt();
        let middle = fly(&self.x);
        let (mut more, mut less) = (Root::zeros(), Root::zeros());
        for i in 0..STATES {
            let step = self.own.column(i) * scale;
            more.set_column(i, &fly(&(self.x + step)));
            less.set_column(i, &fly(&(self.x - step)));
        }
        let mean = middle * MIDDLE + (more.column_sum() + less.column_sum()) * OTHER;
        let mut columns = SMatrix::<f64, STATES, { 3 * STATES }>::zeros();
        for i in 0..STATES {
            columns.set_column(i, &((more.column(i) - mean) * OTHER.sqrt()));
            columns.set_column(STATES + i, &((less.column(i) - mean) * OTHER.sqrt()));
        }
        set(&mut columns, [0, 2 * STATES], &noise(dt, config));
        let mut own = lower(columns);
        subtract(&mut own, (middle - mean) * (-MIDDLE_SQUARE).sqrt())?;
        // Derivatives of the flight with respect to the ball's own errors, applied to the part shared with the head.
        let by_own = (more - less) * (OTHER * scale);
        let shared = by_own * self.own.solve_lower_triangular(&self.shared)?;
        self.x = mean;
        self.own = own;
        self.shared = shared;
        self.drift(drift);
        self.x.iter().all(|x| x.is_finite()).then_some(())
    }

    /// Predicts the head's errors and makes the joint root triangular again.
    fn drift(&mut self, drift: &HeadDrift) {
        let head = drift.phi * self.head;
        if head.amax() == 0.0 && drift.noise.amax() == 0.0 {
            return;
        }
        const JOINT: usize = HEAD + STATES;
        let mut columns = SMatrix::<f64, JOINT, { 2 * HEAD + STATES }>::zeros();
        set(&mut columns, [0, 0], &head);
        set(&mut columns, [HEAD, 0], &self.shared);
        set(&mut columns, [0, HEAD], &drift.noise);
        set(&mut columns, [HEAD, 2 * HEAD], &self.own);
        let joint = lower(columns);
        self.head = joint.fixed_view::<HEAD, HEAD>(0, 0).into_owned();
        self.shared = joint.fixed_view::<STATES, HEAD>(HEAD, 0).into_owned();
        self.own = joint.fixed_view::<STATES, STATES>(HEAD, HEAD).into_owned();
    }

    /// Predicts from one head pose to the next and processes circles that are known to belong to this ball, like the
    /// tracker after its assignment. Returns `None` if the ball is not in front of a camera or the filter is invalid.
    ///
    /// - `heads`: pose at the time of this state, and at the pictures
    /// - `circles`: u, v, r in the left and the right picture, in pixels; `None` if not detected
    pub fn follow(
        &mut self,
        robot: &RobotDescription,
        config: &TrackConfig,
        heads: [&Head; 2],
        circles: [Option<&Vector3<f64>>; CAMERAS],
    ) -> Option<()> {
        let [before, now] = heads;
        let dt = (now.t_ns as f64 - before.t_ns as f64) * 1e-9;
        self.predict(dt, &now.drift(before), config)?;
        for (camera, circle) in Camera::pair(&robot.cameras).into_iter().zip(circles) {
            let Some(circle) = circle else { continue };
            let sight = self.sight(&View::new(camera, now), config, robot.cameras.exposure)?;
            self.update(&sight, circle)?;
        }
        Some(())
    }

    /// Returns the predicted circle of a camera, or `None` if the ball is not visible.
    pub(super) fn sight(&self, view: &View, config: &TrackConfig, exposure: f64) -> Option<Sight> {
        let see = |x: &State| view.see(&x.fixed_rows::<3>(0).into_owned());
        let scale = SPREAD.sqrt();
        let middle = see(&self.x)?;
        let [mut more, mut less] = [SMatrix::<f64, 3, STATES>::zeros(); 2];
        for i in 0..STATES {
            let step = self.own.column(i) * scale;
            more.set_column(i, &see(&(self.x + step))?);
            less.set_column(i, &see(&(self.x - step))?);
        }
        let circle = middle * MIDDLE + (more.column_sum() + less.column_sum()) * OTHER;
        let off = middle - circle;
        let mut own = off * off.transpose() * MIDDLE_SQUARE;
        for i in 0..STATES {
            let (a, b) = (more.column(i) - circle, less.column(i) - circle);
            own += (a * a.transpose() + b * b.transpose()) * OTHER;
        }
        let blur = view.motion(&self.p(), &self.v(), exposure)? * (config.blur / 12f64.sqrt());
        own += Matrix3::from_diagonal(&config.variances()) + blur * blur.transpose();
        let by_own = (more - less) * (OTHER * scale);
        let by_position = self
            .own
            .tr_solve_lower_triangular(&by_own.transpose())?
            .transpose();
        let mut head_to_ball = SMatrix::<f64, STATES, HEAD>::zeros();
        set(&mut head_to_ball, [0, 0], &-Matrix3::identity());
        let from_head = view.from_head(&self.p());
        set(&mut head_to_ball, [0, 6], &from_head.cross_matrix());
        let by_head = by_position * (self.shared + head_to_ball * self.head);
        let total = own + by_head * by_head.transpose();
        let cholesky = Cholesky::new(total)?;
        Some(Sight {
            circle,
            inverse: cholesky.inverse(),
            log_normalisation: -0.5 * (total * std::f64::consts::TAU).determinant().ln(),
            sigma: total[(0, 0)].max(total[(1, 1)]).sqrt(),
            by_own,
            own_root: Cholesky::new(own)?.unpack(),
            by_head,
        })
    }

    /// Processes a detected circle. Returns `None` if the covariance is no longer positive definite; the filter is then
    /// invalid.
    pub(super) fn update(&mut self, sight: &Sight, circle: &Vector3<f64>) -> Option<()> {
        let cross = self.own * sight.by_own.transpose();
        // Gain for a known head, times the root of its innovation covariance.
        let known = sight
            .own_root
            .solve_lower_triangular(&cross.transpose())?
            .transpose();
        let gain = (cross + self.shared * sight.by_head.transpose()) * sight.inverse;
        let rest = gain * sight.own_root - known;
        if sight.by_head.amax() > 0.0 {
            for column in rest.column_iter() {
                add(&mut self.own, column.into_owned());
            }
        }
        for column in known.column_iter() {
            subtract(&mut self.own, column.into_owned())?;
        }
        self.shared -= gain * sight.by_head;
        self.x += gain * (circle - sight.circle);
        self.x.iter().all(|x| x.is_finite()).then_some(())
    }

    /// Correlates a new ball with the head's errors: it moves rigidly with the head.
    pub(super) fn born_from(&mut self, head: &Head, root: &HeadMatrix) {
        let mut by_head = SMatrix::<f64, STATES, HEAD>::zeros();
        by_head.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        let turned = -(self.p() - head.position).cross_matrix();
        set(&mut by_head, [0, 6], &turned);
        self.shared = by_head * root;
        self.head = *root;
    }
}

fn flight(x: &State) -> Flight {
    let [p, v, lift] = [0, 3, 7].map(|first| x.fixed_rows::<3>(first).into_owned());
    Flight {
        p,
        v,
        k: x[6],
        lift,
    }
}

/// Returns the root of the process noise over `dt` seconds: integrated white acceleration, random walks of drag and
/// lift.
fn noise(dt: f64, config: &TrackConfig) -> Root {
    let q = config.acceleration_noise;
    let mut root = Root::zeros();
    for i in 0..3 {
        root[(i, i)] = q * (dt * dt * dt / 3.0).sqrt();
        root[(i + 3, i)] = q * (dt * 3.0).sqrt() / 2.0;
        root[(i + 3, i + 3)] = q * dt.sqrt() / 2.0;
    }
    root[(6, 6)] = config.drag_walk * dt.sqrt();
    for i in 7..STATES {
        root[(i, i)] = config.lift_walk * dt.sqrt();
    }
    root
}
