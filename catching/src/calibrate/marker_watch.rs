//! Monitors the calibration during operation by comparing detected markers with their expected positions. Only arms at
//! rest count, as in a calibration session.

use std::collections::VecDeque;

use nalgebra::DMatrix;
use tactnet_catching_packets::packets::{
    CalibrationHold, CalibrationState, JointState, MarkerFeature, MarkerFeatures, Text,
};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, joint};

use super::corrections::Corrections;
use super::error::CalibrationError;
use super::gravity::loads;
use super::joint_history::{AROUND_NS, JointHistory};
use super::kept::KeptCalibration;
use super::model::Model;
use super::problem::Noise;
use super::session::Picture;
use super::slip::{SlipConfig, SlipWatch};
use super::unknowns::{Unknowns, at};
use crate::robot::Robot;

/// Maximum joint speed of an arm at rest, in rad/s.
const STILL: f64 = 0.02;
/// Time for which an arm must rest before the exposure, in ns.
const STILL_NS: u64 = 30_000_000;
/// Period at which an unchanged state is published, in ns.
const TELL_NS: u64 = 500_000_000;
/// Maximum number of pictures that wait for joint states around their exposure.
const WAITING: usize = 8;

/// Monitor of both arms' markers.
#[derive(Debug, Clone)]
pub struct MarkerWatch {
    model: Model,
    noise: Noise,
    corrections: Corrections,
    unknowns: Unknowns,
    covariance: DMatrix<f64>,
    identity: String,
    history: JointHistory,
    waiting: VecDeque<MarkerFeatures>,
    arms: [SlipWatch; ARMS],
    /// Time of the first detected slip, in ns; 0 if none.
    since_ns: u64,
    /// Last published state and its time, in ns.
    told: Option<(CalibrationHold, u64)>,
}

impl MarkerWatch {
    /// Creates a monitor without observations.
    ///
    /// - `robot`: as described
    ///
    /// # Errors
    /// Returns an error if a setting is invalid.
    pub fn new(
        robot: &Robot,
        kept: &KeptCalibration,
        config: SlipConfig,
    ) -> Result<Self, CalibrationError> {
        let watch = SlipWatch::new(config)?;
        Ok(Self {
            model: Model::new(robot),
            noise: Noise::default(),
            corrections: Corrections::new(robot, Some(&kept.parameters)),
            unknowns: kept.parameters.unknowns(),
            covariance: kept.covariance(),
            identity: kept.identity(),
            history: JointHistory::new(),
            waiting: VecDeque::with_capacity(WAITING),
            arms: [watch.clone(), watch],
            since_ns: 0,
            told: None,
        })
    }

    /// Takes the packets since the last step. Markers are evaluated once the joint states around their exposure are
    /// known. Returns the state when it changes and every half second. A detected slip is permanent.
    ///
    /// - `features`: markers in pairs of pictures
    /// - `joints`: measured joint states, one per millisecond
    pub fn step(
        &mut self,
        now_ns: u64,
        features: &[MarkerFeatures],
        joints: &[JointState],
    ) -> Option<CalibrationState> {
        for seen in features {
            if self.waiting.len() == WAITING {
                self.waiting.pop_front();
            }
            self.waiting.push_back(*seen);
            self.judge();
        }
        for state in joints {
            self.history.push(state);
            self.judge();
        }
        let state = self.state(now_ns);
        let hold = state.hold()?;
        let same = self
            .told
            .is_some_and(|(told, told_ns)| told == hold && now_ns <= told_ns + TELL_NS);
        if same {
            return None;
        }
        self.told = Some((hold, now_ns));
        Some(state)
    }

    fn state(&self, now_ns: u64) -> CalibrationState {
        let judges = self.arms.iter().any(SlipWatch::is_full);
        let hold = match (self.since_ns, judges) {
            (0, false) => CalibrationHold::NotTold,
            (0, true) => CalibrationHold::Holds,
            _ => CalibrationHold::Lost,
        };
        CalibrationState {
            t_ns: now_ns,
            hold: hold as u64,
            since_ns: self.since_ns,
            innovations: self.arms.each_ref().map(SlipWatch::innovations),
            mean_square: self.arms.each_ref().map(|arm| arm.mean().unwrap_or(0.0)),
            identity: Text::new(&self.identity),
        }
    }

    fn judge(&mut self) {
        let Some(known_ns) = self.history.last().map(|state| state.sensor_ns) else {
            return;
        };
        let is_due = |seen: &mut MarkerFeatures| seen.exposure_ns + AROUND_NS <= known_ns;
        while let Some(seen) = self.waiting.pop_front_if(is_due) {
            for (arm, features) in [&seen.left, &seen.right].into_iter().enumerate() {
                let Some(picture) = self.picture(arm, features, seen.exposure_ns) else {
                    continue;
                };
                let (x, covariance) = (&self.unknowns, &self.covariance);
                let watch = &mut self.arms[arm];
                let slip = watch.picture(&self.model, &self.noise, x, covariance, &picture);
                if slip.is_some() && self.since_ns == 0 {
                    self.since_ns = known_ns;
                }
            }
        }
    }

    /// Returns a marker's features with the joint state at the exposure. Returns `None` while the arm moves or if the
    /// history is incomplete.
    fn picture(
        &self,
        arm: usize,
        features: &[MarkerFeature; 2],
        exposure_ns: u64,
    ) -> Option<Picture> {
        let features = features.map(|feature| feature.pixel());
        if features == [None; 2] {
            return None;
        }
        let late = self.unknowns[at::CAMERA_JOINTS];
        let moment_ns = exposure_ns.saturating_add_signed(-(late * 1e9).round() as i64);
        let state = self.history.at(moment_ns)?;
        let before = self.history.at(moment_ns.saturating_sub(STILL_NS))?;
        let own = joint::ARM[arm].clone();
        let stands = |state: &JointState| state.dq[own.clone()].iter().all(|dq| dq.abs() < STILL);
        if !(stands(state) && stands(before)) {
            return None;
        }
        let links = self.corrections.links(&state.q);
        let of_arm = |q: &[f64]| -> [f64; ARM_JOINTS] { std::array::from_fn(|i| q[own.start + i]) };
        // Loads follow from the described masses, because measured torques oscillate with the torso.
        let loads = loads(self.corrections.robot(), arm, &of_arm(&links));
        let neck = self.history.neck(exposure_ns)?;
        Some(Picture {
            features,
            ..Picture::without_features(arm, of_arm(&state.q), loads, neck)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::{Priors, UNKNOWNS};

    #[test]
    fn the_state_is_told_at_first_and_every_half_second() {
        let robot = Robot::nominal();
        let sigmas = Priors::default().sigmas().unwrap();
        let covariance = &sigmas * sigmas.transpose();
        let kept = KeptCalibration::new(&robot, &Unknowns::zeros(UNKNOWNS), &covariance);
        let mut watch = MarkerWatch::new(&robot, &kept, SlipConfig::default()).unwrap();
        let mut hold = |ms: u64| {
            let state = watch.step(ms * 1_000_000, &[], &[]);
            state.and_then(|state| state.hold())
        };
        assert_eq!(hold(1), Some(CalibrationHold::NotTold));
        assert_eq!((hold(2), hold(501)), (None, None));
        assert_eq!(hold(502), Some(CalibrationHold::NotTold));
    }
}
