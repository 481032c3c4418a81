//! Markers at the wrists as detected by the cameras, and the state of the calibration monitor.

use tactnet_packet::{Text, choices, packets};

use crate::ARMS;

packets! {
    /// Marker detected in a picture.
    #[derive(PartialEq)]
    pub struct MarkerFeature {
        /// Horizontal centre, in pixels from the left edge, with the described lens distortion removed.
        #[recorded(1)] pub u: f64,
        /// Vertical centre, in pixels from the top edge, with the described lens distortion removed.
        #[recorded(2)] pub v: f64,
        /// 1 if the marker was found, otherwise 0.
        #[recorded(3)] pub found: u64,
    }

    /// Wrist markers detected in both pictures of one exposure.
    #[derive(PartialEq)] #[version(1)]
    pub struct MarkerFeatures {
        /// Picture number.
        #[recorded(1)] pub frame: u64,
        /// Middle of the exposure on the camera clock, in ns.
        #[recorded(2)] pub exposure_ns: u64,
        /// Left arm's marker in the left and the right picture.
        #[recorded(3)] pub left: [MarkerFeature; 2],
        /// Right arm's marker in the left and the right picture.
        #[recorded(4)] pub right: [MarkerFeature; 2],
    }

    /// Result of the calibration monitor, which compares detected markers with their expected positions.
    #[derive(PartialEq)] #[version(1)]
    pub struct CalibrationState {
        /// Time, in ns.
        #[recorded(1)] pub t_ns: u64,
        /// A [`CalibrationHold`].
        #[recorded(2)] pub hold: u64,
        /// Time since which the calibration is invalid, in ns; 0 while it is valid or undecided.
        #[recorded(3)] pub since_ns: u64,
        /// Number of innovations since the start, for the left and the right arm's marker. One feature in one picture
        /// is one innovation.
        #[recorded(4)] pub innovations: [u64; ARMS],
        /// Mean normalised squared innovation over the last window of each arm. The expected value of a valid
        /// calibration is 2; the value is 0 before the first innovation.
        #[recorded(5)] pub mean_square: [f64; ARMS],
        /// Identity of the calibration.
        #[recorded(6)] pub identity: Text<16>,
    }
}

choices! {
    /// Validity of a calibration.
    pub enum CalibrationHold {
        /// Too few markers were seen to decide.
        NotTold = 1,
        /// Features are at the expected positions.
        Holds = 2,
        /// Features deviate from the expected positions; the robot needs a new calibration.
        Lost = 3,
    }
}

impl MarkerFeature {
    /// Creates a feature at `pixel`, or one that was not found.
    pub fn of(pixel: Option<[f64; 2]>) -> Self {
        let [u, v] = pixel.unwrap_or_default();
        Self {
            u,
            v,
            found: u64::from(pixel.is_some()),
        }
    }

    /// Returns the position in pixels, or `None` if the marker was not found.
    pub fn pixel(&self) -> Option<[f64; 2]> {
        (self.found == 1).then_some([self.u, self.v])
    }
}
