//! Markers at the wrists as cameras find them, and whether the calibration still holds.

use tactnet_packet::{Text, choices, packets};

use crate::ARMS;

packets! {
    /// A marker in a picture.
    #[derive(PartialEq)]
    pub struct MarkerFeature {
        /// Its middle, pixels from the left; the described lens's distortion is taken out.
        #[recorded(1)]
        pub u: f64,
        /// Its middle, pixels from the top.
        #[recorded(2)]
        pub v: f64,
        /// 1 if it was found, else 0.
        #[recorded(3)]
        pub found: u64,
    }

    /// Where the markers at the wrists were found in both pictures of an exposure.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct MarkerFeatures {
        /// Number of the pictures.
        #[recorded(1)]
        pub frame: u64,
        /// Middle of the exposure, by the cameras' clock.
        #[recorded(2)]
        pub exposure_ns: u64,
        /// The left arm's marker in the left and in the right picture.
        #[recorded(3)]
        pub left: [MarkerFeature; 2],
        /// The right arm's marker in the left and in the right picture.
        #[recorded(4)]
        pub right: [MarkerFeature; 2],
    }

    /// Whether the calibration still holds: features beside where it expects them.
    #[derive(PartialEq)]
    #[version(1)]
    pub struct CalibrationState {
        /// When.
        #[recorded(1)]
        pub t_ns: u64,
        /// A [`CalibrationHold`].
        #[recorded(2)]
        pub hold: u64,
        /// Since when it no longer holds; 0 while nothing says so.
        #[recorded(3)]
        pub since_ns: u64,
        /// Innovations since the watch began, of the left and of the right arm's marker: a feature in one picture each.
        #[recorded(4)]
        pub innovations: [u64; ARMS],
        /// Mean normalised square of the last of them, up to a window of each arm: 2 where the calibration holds; 0: there is none yet.
        #[recorded(5)]
        pub mean_square: [f64; ARMS],
        /// What the calibration is known by.
        #[recorded(6)]
        pub identity: Text<16>,
    }
}

choices! {
    /// Whether a calibration still holds.
    pub enum CalibrationHold {
        /// Too little was seen of the markers so far.
        NotTold = 1,
        /// Features fall where they should.
        Holds = 2,
        /// They no longer do: calibrate anew.
        Lost = 3,
    }
}

impl MarkerFeature {
    /// A marker that was found there, pixels, or was not.
    pub fn of(pixel: Option<[f64; 2]>) -> Self {
        let [u, v] = pixel.unwrap_or_default();
        Self {
            u,
            v,
            found: u64::from(pixel.is_some()),
        }
    }

    /// Returns where it was found, pixels.
    pub fn pixel(&self) -> Option<[f64; 2]> {
        (self.found == 1).then_some([self.u, self.v])
    }
}

impl CalibrationState {
    /// Returns whether it holds; `None` for a number that says nothing.
    pub fn hold(&self) -> Option<CalibrationHold> {
        CalibrationHold::of(u32::try_from(self.hold).ok()?)
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    #[test]
    fn bytes_are_where_they_are_documented() {
        assert_eq!(size_of::<MarkerFeature>(), 24);
        assert_eq!(size_of::<MarkerFeatures>(), 112);
        assert_eq!(size_of::<CalibrationState>(), 72);
        let features = MarkerFeatures {
            right: [None, Some([3.0, 4.0])].map(MarkerFeature::of),
            ..MarkerFeatures::zeroed()
        };
        let bytes = bytemuck::bytes_of(&features);
        assert_eq!(bytes[88..96], 3.0_f64.to_le_bytes());
        assert_eq!(bytes[104..112], 1_u64.to_le_bytes());
        assert_eq!(
            features.right.map(|feature| feature.pixel()),
            [None, Some([3.0, 4.0])]
        );
        let state = CalibrationState {
            mean_square: [0.0, 2.5],
            identity: Text::new("0123456789abcdef"),
            ..CalibrationState::zeroed()
        };
        let bytes = bytemuck::bytes_of(&state);
        assert_eq!(bytes[48..56], 2.5_f64.to_le_bytes());
        assert_eq!(bytes[56..], *b"0123456789abcdef");
    }

    #[test]
    fn what_says_nothing_is_refused() {
        let state = |hold| CalibrationState {
            hold,
            ..CalibrationState::zeroed()
        };
        assert_eq!(state(3).hold(), Some(CalibrationHold::Lost));
        assert_eq!((state(0).hold(), state(1 << 32 | 1).hold()), (None, None));
    }
}
