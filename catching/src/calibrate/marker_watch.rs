//! Watches, while the robot works, whether its calibration still holds: markers as the cameras find them beside where the calibration puts
//! them. Only arms that stand are looked at, as in a calibration's session.

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

/// An arm stands if its joints are slower than this, rad/s,
const STILL: f64 = 0.02;
/// and were so long before the exposure, ns.
const STILL_NS: u64 = 30_000_000;
/// Pictures that wait for the joints' states around their exposures, at most.
const WAITING: usize = 8;

/// A watch for each arm.
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
    /// 0: it holds, for all that is known.
    since_ns: u64,
}

impl MarkerWatch {
    /// Returns a watch that has seen nothing.
    ///
    /// - `robot`: as described
    ///
    /// # Errors
    /// Where a setting makes no sense.
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
        })
    }

    /// Takes the markers of a pair of pictures. They wait for the joints around their exposure.
    pub fn features(&mut self, seen: &MarkerFeatures) {
        if self.waiting.len() == WAITING {
            self.waiting.pop_front();
        }
        self.waiting.push_back(*seen);
        self.judge();
    }

    /// Takes the joints' state, every millisecond, as their sensors say.
    pub fn joints(&mut self, state: &JointState) {
        self.history.push(state);
        self.judge();
    }

    /// Returns what is to be told at a time. What was found once stays so: no tendon slips back.
    pub fn state(&self, now_ns: u64) -> CalibrationState {
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
                let slip = self.arms[arm].picture(
                    &self.model,
                    &self.noise,
                    &self.unknowns,
                    &self.covariance,
                    &picture,
                );
                if slip.is_some() && self.since_ns == 0 {
                    self.since_ns = known_ns;
                }
            }
        }
    }

    /// Returns a marker's features with the joints of that moment; `None` while the arm moves, or where too little is known of it.
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
        Some(Picture {
            configuration: 0,
            arm,
            features,
            q: of_arm(&state.q),
            // By the masses as described: measured ones swing with the torso.
            loads: loads(self.corrections.robot(), arm, &of_arm(&links)),
            neck: self.history.neck(exposure_ns)?,
        })
    }
}
