//! Creates a calibration session from sensor data.
//!
//! Features and samples have time stamps of separate clocks. Each waits until the joint states around its time stamp
//! are known. It then gets the neck's position, velocity and acceleration at that time.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::Vector3;
use tactnet_catching_packets::packets::{Circles, ImuSample, JointState};
use tactnet_catching_packets::{ARM_JOINTS, joint};

use super::joint_history::{AROUND_NS, JointHistory};
use super::model::Model;
use super::routine::Phase;
use super::session::{NeckMotion, Picture, Rest, Session, Turn};
use super::stamps::StampLine;
use super::unknowns::Unknowns;
use crate::track::CAMERAS;

/// Number of IMU samples that are averaged while the head turns.
const AVERAGED_SAMPLES: usize = 8;

/// Sums of IMU samples.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    acceleration: Vector3<f64>,
    rate: Vector3<f64>,
    stamp_ns: u64,
    count: usize,
}

impl Sums {
    fn add(&mut self, sample: &ImuSample) {
        self.acceleration += Vector3::from(sample.acceleration);
        self.rate += Vector3::from(sample.rate);
        self.stamp_ns += sample.sensor_ns;
        self.count += 1;
    }
}

enum Waiting {
    Picture(Picture),
    Turn([f64; 3]),
}

/// Recorder of a session.
pub struct Recorder {
    session: Session,
    history: JointHistory,
    waiting: VecDeque<(u64, Waiting)>,
    rest: Option<(usize, Sums)>,
    turn: Sums,
    /// Time stamps of cameras and inertial unit without jitter.
    cameras: StampLine,
    imu: StampLine,
}

impl Recorder {
    /// Creates an empty recorder.
    ///
    /// - `robot_seconds`: duration of the session's motion, in s
    pub fn new(robot_seconds: f64) -> Self {
        Self {
            session: Session {
                robot_seconds,
                ..Session::default()
            },
            history: JointHistory::new(),
            waiting: VecDeque::new(),
            rest: None,
            turn: Sums::default(),
            cameras: StampLine::default(),
            imu: StampLine::default(),
        }
    }

    /// Adds the joint state, every millisecond.
    pub fn joints(&mut self, state: &JointState) {
        self.history.push(state);
        while let Some((stamp_ns, waiting)) = self
            .waiting
            .pop_front_if(|(stamp_ns, _)| *stamp_ns + AROUND_NS <= state.sensor_ns)
        {
            let Some(neck) = self.history.neck(stamp_ns) else {
                continue;
            };
            match waiting {
                Waiting::Picture(picture) => {
                    self.session.pictures.push(Picture { neck, ..picture })
                }
                Waiting::Turn(rate) => self.session.turns.push(Turn { neck, rate }),
            }
        }
    }

    /// Adds an IMU sample.
    pub fn sample(&mut self, sample: &ImuSample, phase: Phase) {
        let sample = &ImuSample {
            sensor_ns: self.imu.time(sample.number, sample.sensor_ns),
            ..*sample
        };
        if let Some((number, sums)) = self.rest
            && phase != Phase::Rest(number)
        {
            self.finish_rest(&sums);
            self.rest = None;
        }
        match phase {
            Phase::Rest(number) => {
                let (_, sums) = self.rest.get_or_insert((number, Sums::default()));
                sums.add(sample);
            }
            Phase::Turn => {
                self.turn.add(sample);
                if self.turn.count == AVERAGED_SAMPLES {
                    let sums = std::mem::take(&mut self.turn);
                    let rate = (sums.rate / AVERAGED_SAMPLES as f64).into();
                    let stamp_ns = sums.stamp_ns / AVERAGED_SAMPLES as u64;
                    self.wait(stamp_ns, Waiting::Turn(rate));
                }
            }
            Phase::Way | Phase::Marker { .. } => self.turn = Sums::default(),
        }
    }

    /// Adds the features of a pair of pictures, in pixels. First index: left and right arm's marker; second index: left
    /// and right picture.
    ///
    /// - `frame`: number of the pair
    pub fn features(
        &mut self,
        frame: u64,
        stamp_ns: u64,
        features: &[[Option<[f64; 2]>; CAMERAS]; 2],
        phase: Phase,
    ) {
        if let Some(picture) = self.picture(phase) {
            self.push(frame, stamp_ns, picture, features[picture.arm]);
        }
    }

    /// Adds the circles of a pair of pictures, among which the model finds the marker. Returns its features.
    ///
    /// - `x`: unknowns that give the marker's expected position
    pub fn circles(
        &mut self,
        model: &Model,
        x: &Unknowns,
        circles: &[Circles; CAMERAS],
        phase: Phase,
    ) -> [Option<[f64; 2]>; CAMERAS] {
        let Some(picture) = self.picture(phase) else {
            return [None; CAMERAS];
        };
        let features = model.find_marker(x, &picture, circles);
        let [left, _] = circles;
        self.push(left.frame, left.exposure_ns, picture, features);
        features
    }

    /// Returns arm and neck now, without features, if the phase is that of a marker.
    fn picture(&self, phase: Phase) -> Option<Picture> {
        let (Phase::Marker { configuration, arm }, Some(joints)) = (phase, self.history.last())
        else {
            return None;
        };
        let own = joint::ARM[arm].start;
        let q = std::array::from_fn(|i| joints.q[own + i]);
        let loads = std::array::from_fn(|i| -joints.tau[own + i]);
        let neck = NeckMotion::standing(NeckMotion::of(&joints.q));
        Some(Picture {
            configuration,
            ..Picture::without_features(arm, q, loads, neck)
        })
    }

    /// Adds features to a picture, whose neck at its time stamp is not known yet.
    fn push(
        &mut self,
        frame: u64,
        stamp_ns: u64,
        mut picture: Picture,
        features: [Option<[f64; 2]>; CAMERAS],
    ) {
        picture.features = features;
        let stamp_ns = self.cameras.time(frame, stamp_ns);
        if features != [None; CAMERAS] {
            self.wait(stamp_ns, Waiting::Picture(picture));
        }
    }

    /// Returns the recorded session.
    pub fn finish(mut self) -> Session {
        if let Some((_, sums)) = self.rest {
            self.finish_rest(&sums);
        }
        self.mean_loads();
        self.session
    }

    /// Replaces the loads of each configuration's pictures by their mean, because the torso still oscillates and moves
    /// the arms.
    fn mean_loads(&mut self) {
        let mut sums: BTreeMap<usize, ([f64; ARM_JOINTS], f64)> = BTreeMap::new();
        for picture in &self.session.pictures {
            let (sum, count) = sums.entry(picture.configuration).or_default();
            for (sum, load) in sum.iter_mut().zip(picture.loads) {
                *sum += load;
            }
            *count += 1.0;
        }
        for picture in &mut self.session.pictures {
            let (sum, count) = sums[&picture.configuration];
            picture.loads = sum.map(|sum| sum / count);
        }
    }

    fn finish_rest(&mut self, sums: &Sums) {
        let Some(state) = self.history.last() else {
            return;
        };
        let count = sums.count as f64;
        self.session.rests.push(Rest {
            neck: NeckMotion::of(&state.q),
            acceleration: (sums.acceleration / count).into(),
            rate: (sums.rate / count).into(),
            samples: sums.count,
        });
    }

    fn wait(&mut self, stamp_ns: u64, what: Waiting) {
        // The time stamps come from two clocks, so they may arrive out of order.
        let place = self
            .waiting
            .partition_point(|(other, _)| *other <= stamp_ns);
        self.waiting.insert(place, (stamp_ns, what));
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    /// Pan follows `2 t^2`; picture time stamps fall between joint time stamps.
    #[test]
    fn features_get_the_necks_motion_at_their_stamps() {
        let mut recorder = Recorder::new(1.0);
        let phase = Phase::Marker {
            configuration: 3,
            arm: 1,
        };
        for tick in 1..=100u64 {
            let t = tick as f64 * 1e-3;
            let mut state = JointState::zeroed();
            state.sensor_ns = tick * 1_000_000;
            state.q[4] = 2.0 * t * t;
            state.dq[4] = 4.0 * t;
            state.tau[13] = 5.0;
            recorder.joints(&state);
            if tick == 50 {
                let features = [[None; 2], [Some([1.0, 2.0]), None]];
                recorder.features(1, 53_400_000, &features, phase);
                recorder.features(1, 53_400_000, &features, Phase::Way);
                recorder.features(2, 53_400_000, &[[Some([0.0; 2]); 2], [None; 2]], phase);
            }
        }
        let session = recorder.finish();
        assert_eq!(session.pictures.len(), 1);
        let picture = &session.pictures[0];
        assert_eq!((picture.configuration, picture.arm), (3, 1));
        assert_eq!(picture.loads[0], -5.0);
        let t = 0.0534;
        assert!((picture.neck.q[0] - 2.0 * t * t).abs() < 1e-12);
        assert!((picture.neck.dq[0] - 4.0 * t).abs() < 1e-12);
        assert!((picture.neck.ddq[0] - 4.0).abs() < 1e-9);
    }

    #[test]
    fn rests_are_means_of_their_own_samples() {
        let mut recorder = Recorder::new(1.0);
        recorder.joints(&JointState::zeroed());
        for number in 0..30u64 {
            let mut sample = ImuSample::zeroed();
            let place = (number / 10) as usize;
            sample.acceleration = [place as f64, 0.0, 9.81];
            let phase = [Phase::Rest(0), Phase::Way, Phase::Rest(2)][place];
            recorder.sample(&sample, phase);
        }
        let session = recorder.finish();
        let means = session.rests.iter().map(|rest| rest.acceleration[0]);
        assert_eq!(means.collect::<Vec<f64>>(), [0.0, 2.0]);
        assert!(session.rests.iter().all(|rest| rest.samples == 10));
    }
}
