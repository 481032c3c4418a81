//! Errors of predictions, compared with the true ball at the hand.

use nalgebra::{Isometry3, Matrix3, Point3, SMatrix, SVector, Vector3};
use serde::Serialize;
use tactnet_catching::flight::{DRAG, Flight};
use tactnet_catching_packets::packets::BallPrediction;
use tactnet_catching_world::{FlightSample, TICK_NS};
use tactnet_plot::{chi_square_band, quantile};

use crate::bound::slopes;

/// Time before the catch at which predictions are evaluated, in s.
pub const AHEAD: f64 = 0.2;
/// Maximum distance between a prediction and its ball, in m.
pub(crate) const SAME_BALL: f64 = 0.5;

/// Error of a prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LookAhead {
    /// Time from the exposure of its last picture to the catch, in s.
    pub left: f64,
    /// Error perpendicular to the flight at the catch, in mm.
    pub across_mm: f64,
    /// Error along the flight in ms; negative if early.
    pub along_ms: f64,
    /// Root mean square of `across_mm` according to the filter, in mm.
    pub sigma_across_mm: f64,
    /// Standard deviation of `along_ms` according to the filter, in ms.
    pub sigma_along_ms: f64,
    /// Normalised squared error of the position seen from the head; 3 on average if the covariance is correct.
    pub nees: f64,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct TimedPrediction {
    pub exposure_ns: u64,
    pub prediction: BallPrediction,
    /// Transformation from the estimated to the true head pose at the exposure.
    pub aligned: Isometry3<f64>,
}

impl TimedPrediction {
    fn as_said(&self, t_ns: u64) -> Flight {
        let ball = &self.prediction;
        Flight::of(ball).after((t_ns as f64 - ball.t_ns as f64) * 1e-9)
    }

    /// Returns the predicted ball at a time, corrected for the error of the head pose.
    pub fn at(&self, t_ns: u64) -> Flight {
        let then = self.as_said(t_ns);
        Flight {
            p: (self.aligned * Point3::from(then.p)).coords,
            v: self.aligned.rotation * then.v,
            k: then.k,
            lift: self.aligned.rotation * then.lift,
        }
    }

    /// Returns the distance of the predicted ball from a true flight at the exposure in m, or `None` if the ball did
    /// not fly then.
    pub fn distance(&self, flight: &[FlightSample]) -> Option<f64> {
        let sample = flight
            .iter()
            .min_by_key(|sample| sample.t_ns.abs_diff(self.exposure_ns))?;
        (sample.t_ns.abs_diff(self.exposure_ns) < 2 * TICK_NS)
            .then(|| (self.at(self.exposure_ns).p - sample.state.position).norm())
    }

    /// Computes the error at the time of the catch. A hand needs the ball relative to the head, which integrates its
    /// pose until then: `aligned` maps the estimated head pose at the catch to the true one.
    pub fn judge(
        &self,
        aligned: &Isometry3<f64>,
        catch_ns: u64,
        p: &Vector3<f64>,
        v: &Vector3<f64>,
    ) -> LookAhead {
        let said = (aligned * Point3::from(self.as_said(catch_ns).p)).coords;
        let error = said - p;
        let heading = v / v.norm();
        let along = error.dot(&heading);
        let covariance = self.covariance_at(catch_ns);
        let variance_along = (heading.transpose() * covariance * heading)[0].max(0.0);
        let variance_across = (covariance.trace() - variance_along).max(0.0);
        let nees = covariance
            .try_inverse()
            .map_or(f64::NAN, |inverse| (error.transpose() * inverse * error)[0]);
        LookAhead {
            left: (catch_ns as f64 - self.exposure_ns as f64) * 1e-9,
            across_mm: (error - heading * along).norm() * 1e3,
            along_ms: along / v.norm() * 1e3,
            sigma_across_mm: variance_across.sqrt() * 1e3,
            sigma_along_ms: variance_along.sqrt() / v.norm() * 1e3,
            nees,
        }
    }

    /// Returns the covariance of the position, by finite differences along the flight.
    fn covariance_at(&self, t_ns: u64) -> Matrix3<f64> {
        let ball = &self.prediction;
        let dt = (t_ns as f64 - ball.t_ns as f64) * 1e-9;
        let state = SVector::<f64, 10>::from_fn(|i, _| match i {
            0..3 => ball.p[i],
            3..6 => ball.v[i - 3],
            6 => ball.k,
            _ => ball.lift[i - 7],
        });
        let slopes = slopes(&state, |state| {
            let three = |first| state.fixed_rows::<3>(first).into_owned();
            let (p, v, lift) = (three(0), three(3), three(7));
            let k = state[6];
            Flight { p, v, k, lift }.after(dt).p
        });
        let covariance = SMatrix::<f64, 10, 10>::from_fn(|i, k| ball.covariance[i][k]);
        slopes * covariance * slopes.transpose()
    }
}

/// Returns the ball of a sample with the usual drag.
pub(crate) fn as_flight(sample: &FlightSample) -> Flight {
    Flight::without_spin(sample.state.position, sample.state.velocity, DRAG)
}

/// Returns the ball of a true flight, sampled every millisecond, at a time; `None` before its first sample.
pub(crate) fn true_at(flight: &[FlightSample], at_ns: u64) -> Option<Flight> {
    let sample = flight.iter().rfind(|sample| sample.t_ns <= at_ns)?;
    Some(as_flight(sample).after((at_ns - sample.t_ns) as f64 * 1e-9))
}

/// Returns the transformation from an estimated to a true frame.
pub(crate) fn between(thought: &Isometry3<f64>, is: &Isometry3<f64>) -> Isometry3<f64> {
    is * thought.inverse()
}

/// Error perpendicular to the flight from which a prediction is far off, in mm.
const FAR_OFF_MM: f64 = 50.0;

/// Errors of the last predictions at least 200 ms before the catch, and the consistency of the filter. `None` without
/// predictions, and for the filter without a covariance.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct PredictionErrors {
    /// Median error perpendicular to the flight, in mm.
    pub across_mm_p50_200ms: Option<f64>,
    /// 95th percentile of that error, in mm.
    pub across_mm_p95_200ms: Option<f64>,
    /// Share of these predictions that are more than 5 cm off.
    pub far_off_200ms: Option<f64>,
    /// Root mean square of that error, in mm.
    pub across_mm_rms_200ms: Option<f64>,
    /// Root mean square error along the flight, in ms.
    pub along_ms_rms_200ms: Option<f64>,
    /// Mean normalised squared error of the position; 3 if the filter's covariance is correct.
    pub nees_200ms: Option<f64>,
    /// 95 % band of that mean for a correct covariance.
    pub nees_band: Option<[f64; 2]>,
    /// True if the mean is within the band.
    pub nees_in_band: Option<bool>,
    /// Number of balls behind these statistics.
    pub predictions: usize,
}

impl PredictionErrors {
    /// Returns the statistics of predictions; without those of the covariance if it is not `estimated`.
    pub(crate) fn of(ahead: &[LookAhead], estimated: bool) -> Self {
        if ahead.is_empty() {
            return Self::default();
        }
        let number = ahead.len() as f64;
        let rms = |of: fn(&LookAhead) -> f64| {
            Some((ahead.iter().map(|a| of(a).powi(2)).sum::<f64>() / number).sqrt())
        };
        let mut across: Vec<f64> = ahead.iter().map(|a| a.across_mm).collect();
        across.sort_by(f64::total_cmp);
        let far_off = across.iter().filter(|mm| **mm > FAR_OFF_MM).count();
        let nees = ahead.iter().map(|a| a.nees).sum::<f64>() / number;
        let band @ [low, high] = chi_square_band(3.0, ahead.len());
        Self {
            across_mm_p50_200ms: Some(quantile(&across, 0.5)),
            across_mm_p95_200ms: Some(quantile(&across, 0.95)),
            far_off_200ms: Some(far_off as f64 / number),
            across_mm_rms_200ms: rms(|a| a.across_mm),
            along_ms_rms_200ms: rms(|a| a.along_ms),
            nees_200ms: estimated.then_some(nees),
            nees_band: estimated.then_some(band),
            nees_in_band: estimated.then_some(low <= nees && nees <= high),
            predictions: ahead.len(),
        }
    }
}
