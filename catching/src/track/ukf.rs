//! One ball: a square-root unscented Kalman filter of position, velocity, drag and lift (van der Merwe and Wan 2001), with the head's errors as
//! consider states (Schmidt 1966).
//!
//! The joint covariance of head's errors (first) and ball's is kept as a lower triangular root:
//!
//! ```text
//! | head     0  |     covariance of the ball: shared shared' + own own'
//! | shared  own |     what sigma points are drawn from: own alone, the ball's errors if the head's were known
//! ```
//!
//! The unscented transform serves the ball's own part, where flight and projection are curved; the head's errors, millimetres and
//! milliradians, go through its statistical linearisation: a head that errs by `(dp, dtheta)` sees a ball at `x` as if it were at
//! `x - dp + d x dtheta`, with `d` from head to ball. If the head is known exactly this is the plain filter, to rounding.
//!
//! A circle's innovation has the covariance `S = S_own + E E'`, `E = H shared + H_head head`. The gain for the ball is the optimal one,
//! the head's is zero. So `own own'` becomes `own own' - K_0 S_own K_0' + (K - K_0) S_own (K - K_0)'` with `K_0` the gain if the head were
//! known (downdates and updates of rank three), and `shared` becomes `shared - K E`.

use nalgebra::{Cholesky, Matrix3, SMatrix, SVector, Vector3};
use tactnet_catching_packets::RobotDescription;

use super::camera::{CAMERAS, Camera, View};
use super::config::TrackConfig;
use super::head::{HEAD, Head, HeadDrift, HeadMatrix};
use super::triangular::{add, lower, subtract};
use crate::flight::Flight;

/// Position, velocity, drag, lift.
pub const STATES: usize = 10;
const ALPHA: f64 = 0.5;
const BETA: f64 = 2.0;
/// `n + lambda`, with kappa = 0.
const SPREAD: f64 = ALPHA * ALPHA * STATES as f64;
/// Weight of the middle sigma point in a mean; -3.
const MIDDLE: f64 = (SPREAD - STATES as f64) / SPREAD;
/// Its weight in a covariance; -0.25.
const MIDDLE_SQUARE: f64 = MIDDLE + 1.0 - ALPHA * ALPHA + BETA;
/// Weight of each other one.
const OTHER: f64 = 0.5 / SPREAD;

type State = SVector<f64, STATES>;
type Root = SMatrix<f64, STATES, STATES>;

/// A ball's state with its covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct BallState {
    /// Position, m, velocity, m/s, inertial frame, drag, 1/m, and lift, 1/s.
    pub x: State,
    pub(super) own: Root,
    pub(super) shared: SMatrix<f64, STATES, HEAD>,
    pub(super) head: HeadMatrix,
}

/// What a camera should see of a ball, and how exactly that is known.
#[derive(Debug, Clone)]
pub struct Sight {
    /// The circle: u, v, r, pixels.
    pub circle: Vector3<f64>,
    /// Inverse of the covariance of what is found less what is expected.
    inverse: Matrix3<f64>,
    log_normalisation: f64,
    /// Greatest standard deviation of the centre, pixels.
    pub sigma: f64,
    /// The projection's derivatives by the ball's own errors, of unit variance.
    by_own: SMatrix<f64, 3, STATES>,
    own_root: Matrix3<f64>,
    by_head: SMatrix<f64, 3, HEAD>,
}

impl Sight {
    /// Returns by how much a circle is off: the square, in standard deviations, and the logarithm of the probability density, 1/px^3.
    pub fn distance(&self, circle: &Vector3<f64>) -> (f64, f64) {
        let off = circle - self.circle;
        let square = (off.transpose() * self.inverse * off)[0];
        (square, self.log_normalisation - square / 2.0)
    }
}

impl BallState {
    /// Returns a ball of which all that is known comes from a filter whose head is known exactly.
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
        Flight {
            p: self.p(),
            v: self.v(),
            k: self.x[6],
            lift: self.x.fixed_rows::<3>(7).into_owned(),
        }
    }

    /// Returns the position, m.
    pub fn p(&self) -> Vector3<f64> {
        self.x.fixed_rows::<3>(0).into_owned()
    }

    /// Returns the velocity, m/s.
    pub fn v(&self) -> Vector3<f64> {
        self.x.fixed_rows::<3>(3).into_owned()
    }

    /// Returns the covariance, the head's share included.
    pub fn covariance(&self) -> Root {
        self.own * self.own.transpose() + self.shared * self.shared.transpose()
    }

    /// Returns the covariance as seen from the head, whose own error moves the ball alike.
    pub fn seen_covariance(&self, head: &Head) -> Root {
        let shared = self.shared - self.with_head(head) * self.head;
        self.own * self.own.transpose() + shared * shared.transpose()
    }

    /// Returns how a ball moves with the head's errors: it is where the head is, and turns and drifts with it.
    fn with_head(&self, head: &Head) -> SMatrix<f64, STATES, HEAD> {
        let mut by_head = SMatrix::<f64, STATES, HEAD>::zeros();
        by_head.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        by_head.fixed_view_mut::<3, 3>(3, 3).fill_with_identity();
        by_head
            .fixed_view_mut::<3, 3>(0, 6)
            .copy_from(&-(self.p() - head.position).cross_matrix());
        by_head
            .fixed_view_mut::<3, 3>(3, 6)
            .copy_from(&-(self.v() - head.velocity).cross_matrix());
        by_head
    }

    /// Moves on by `dt` s: 21 flights by Runge and Kutta, white acceleration and the random walks of drag and lift as noise. `None` where the covariance
    /// is no longer positive: the filter is lost.
    pub(super) fn predict(
        &mut self,
        dt: f64,
        drift: &HeadDrift,
        config: &TrackConfig,
    ) -> Option<()> {
        let fly = |x: &State| {
            let ball = Flight {
                p: x.fixed_rows::<3>(0).into_owned(),
                v: x.fixed_rows::<3>(3).into_owned(),
                k: x[6],
                lift: x.fixed_rows::<3>(7).into_owned(),
            }
            .after(dt);
            let drag = std::iter::once(&ball.k);
            State::from_iterator(
                ball.p
                    .iter()
                    .chain(&ball.v)
                    .chain(drag)
                    .chain(&ball.lift)
                    .copied(),
            )
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
        columns
            .fixed_view_mut::<STATES, STATES>(0, 2 * STATES)
            .copy_from(&noise(dt, config));
        let mut own = lower(columns);
        subtract(&mut own, (middle - mean) * (-MIDDLE_SQUARE).sqrt())?;
        // Derivatives of the flight by the ball's own errors, then by what they share with the head's.
        let by_own = (more - less) * (OTHER * scale);
        let shared = by_own * self.own.solve_lower_triangular(&self.shared)?;
        self.x = mean;
        self.own = own;
        self.shared = shared;
        self.drift(drift);
        self.x.iter().all(|x| x.is_finite()).then_some(())
    }

    /// Moves the head's errors on, and makes the joint root triangular again.
    fn drift(&mut self, drift: &HeadDrift) {
        let head = drift.phi * self.head;
        if head.amax() == 0.0 && drift.noise.amax() == 0.0 {
            return;
        }
        const JOINT: usize = HEAD + STATES;
        let mut columns = SMatrix::<f64, JOINT, { 2 * HEAD + STATES }>::zeros();
        columns.fixed_view_mut::<HEAD, HEAD>(0, 0).copy_from(&head);
        columns
            .fixed_view_mut::<STATES, HEAD>(HEAD, 0)
            .copy_from(&self.shared);
        columns
            .fixed_view_mut::<HEAD, HEAD>(0, HEAD)
            .copy_from(&drift.noise);
        columns
            .fixed_view_mut::<STATES, STATES>(HEAD, 2 * HEAD)
            .copy_from(&self.own);
        let joint = lower(columns);
        self.head = joint.fixed_view::<HEAD, HEAD>(0, 0).into_owned();
        self.shared = joint.fixed_view::<STATES, HEAD>(HEAD, 0).into_owned();
        self.own = joint.fixed_view::<STATES, STATES>(HEAD, HEAD).into_owned();
    }

    /// Moves on from one head's pose to the next and takes the circles that are known to be this ball's: what the tracker does with it once it
    /// has decided which circles those are. `None` where the ball is not before a camera, or the filter is lost.
    ///
    /// - `heads`: at the pictures before, where this state is of, and at these
    /// - `circles`: u, v, r of the left and of the right picture, pixels; `None` where the ball was not found
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

    /// Returns what a camera should see; `None` if that is nothing.
    pub(super) fn sight(&self, view: &View, config: &TrackConfig, exposure: f64) -> Option<Sight> {
        let see = |x: &State| view.see(&x.fixed_rows::<3>(0).into_owned());
        let scale = SPREAD.sqrt();
        let middle = see(&self.x)?;
        let (mut more, mut less) = (
            SMatrix::<f64, 3, STATES>::zeros(),
            SMatrix::<f64, 3, STATES>::zeros(),
        );
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
        head_to_ball
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&-Matrix3::identity());
        let from_head = view.from_head(&self.p());
        head_to_ball
            .fixed_view_mut::<3, 3>(0, 6)
            .copy_from(&from_head.cross_matrix());
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

    /// Takes the circle that was found. `None` where the covariance is no longer positive: the filter is lost.
    pub(super) fn update(&mut self, sight: &Sight, circle: &Vector3<f64>) -> Option<()> {
        let cross = self.own * sight.by_own.transpose();
        // The gain if the head were known, times the root of its innovation's covariance.
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

    /// Gives a ball that was just born from circles the head's errors: it is where the head is and turns with it.
    pub(super) fn born_from(&mut self, head: &Head, root: &HeadMatrix) {
        let mut by_head = SMatrix::<f64, STATES, HEAD>::zeros();
        by_head.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        let turned = -(self.p() - head.position).cross_matrix();
        by_head.fixed_view_mut::<3, 3>(0, 6).copy_from(&turned);
        self.shared = by_head * root;
        self.head = *root;
    }
}

/// Returns the root of the noise of `dt` seconds: white acceleration integrated, random walks of drag and lift.
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
