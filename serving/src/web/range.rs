//! Value range of the page's colour scale.

use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

/// Minimum and maximum reading so far. The range includes zero unless all readings are further from zero than half of
/// their spread, as for a skin with an offset at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DisplayRange {
    seen: Option<[f32; 2]>,
    /// True while every reading is a whole number.
    whole: bool,
}

impl Default for DisplayRange {
    fn default() -> Self {
        Self {
            seen: None,
            whole: true,
        }
    }
}

impl DisplayRange {
    /// Extends the range.
    ///
    /// - `digits`: values of a frame; values that are not finite are ignored
    pub(super) fn widen(&mut self, digits: &[f32]) {
        for &digit in digits.iter().filter(|digit| digit.is_finite()) {
            let [least, most] = self.seen.unwrap_or([digit; 2]);
            self.seen = Some([least.min(digit), most.max(digit)]);
            self.whole &= digit.fract() == 0.0;
        }
    }

    /// Returns the lower and upper end of the scale before rounding; both 0 before the first reading.
    fn ends(&self) -> [f32; 2] {
        let Some([least, most]) = self.seen else {
            return [0.0; 2];
        };
        if 2.0 * least.max(-most) > most - least && most > least {
            return [least, most];
        }
        [least.min(0.0), most.max(0.0)]
    }
}

impl Serialize for DisplayRange {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let [least, most] = self.ends();
        let mut fields = serializer.serialize_struct("Range", 3)?;
        fields.serialize_field("least", &least)?;
        fields.serialize_field("most", &most)?;
        fields.serialize_field("whole", &self.whole)?;
        fields.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_sweep_reached_is_kept_when_the_skin_is_at_rest() {
        let mut range = DisplayRange::default();
        assert_eq!(range.ends(), [0.0, 0.0]);
        range.widen(&[3.0, -2.0, f32::NAN]);
        assert!(range.whole);
        range.widen(&[f32::INFINITY, 140.5]);
        for _ in 0..3 {
            range.widen(&[0.0, 1.0]);
        }
        assert_eq!((range.ends(), range.whole), ([-2.0, 140.5], false));
    }

    #[test]
    fn zero_is_left_out_where_readings_are_far_from_it() {
        for (readings, ends) in [
            ([2010.0, 1990.0], [1990.0, 2010.0]),
            ([-2010.0, -1990.0], [-2010.0, -1990.0]),
            ([326.0, 788.0], [326.0, 788.0]),
            ([20.0, 60.0], [0.0, 60.0]),
            ([7.0, 7.0], [0.0, 7.0]),
        ] {
            let mut range = DisplayRange::default();
            range.widen(&readings);
            assert_eq!(range.ends(), ends);
        }
    }
}
