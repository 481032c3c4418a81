use tactnet_packet::FieldType;

use super::*;

#[test]
fn sizes_are_as_documented() {
    assert_eq!(size_of::<ArmPath>(), 376);
    assert_eq!(size_of::<BodyPath>(), 104);
    assert_eq!(size_of::<Gaze>(), 184);
    assert_eq!(size_of::<PlanRequest>(), 704);
    assert_eq!(size_of::<ControllerCommand>(), 80);
    assert_eq!(size_of::<SafetyState>(), 40);
    assert_eq!(size_of::<CatchStatus>(), 96);
    assert_eq!(size_of::<CatchOutcome>(), 200);
    assert_eq!(size_of::<JointState>(), 496);
    assert_eq!(size_of::<ThrowPath>(), 832);
    assert_eq!(size_of::<HandOpening>(), 16);
    assert_eq!(size_of::<ThrowStatus>(), 96);
    assert_eq!(size_of::<ThrownBack>(), 112);
    assert_eq!(size_of::<MarkerFeatures>(), 112);
    assert_eq!(size_of::<CalibrationState>(), 72);
}

#[test]
fn features_hold_the_pixels_that_they_were_made_of() {
    for pixel in [None, Some([3.0, 4.0])] {
        assert_eq!(MarkerFeature::of(pixel).pixel(), pixel);
    }
}

#[test]
fn modes_and_phases_that_are_none_are_refused() {
    let state = |mode| ControllerState {
        mode,
        ..ControllerState::zeroed()
    };
    assert_eq!(state(6).mode(), Some(ControllerMode::Stuck));
    assert_eq!((state(0).mode(), state(1 << 32 | 1).mode()), (None, None));
    let mut status = CatchStatus::zeroed();
    status.phase = 8;
    assert_eq!(status.phase(), Some(CatchPhase::Stuck));
    let mut throws = ThrowStatus::zeroed();
    throws.phase = 5;
    assert_eq!(throws.phase(), None);
    let mut calibration = CalibrationState::zeroed();
    calibration.hold = 3;
    assert_eq!(calibration.hold(), Some(CalibrationHold::Lost));
}

/// A duplicate field number would lose a field in recordings. Nested packets must precede the packets that contain
/// them.
#[test]
fn the_description_is_in_order() {
    let mut before: Vec<&str> = Vec::new();
    for layout in DESCRIPTION.packets {
        let mut numbers: Vec<u32> = layout.recorded().iter().map(|of| of.0).collect();
        numbers.dedup();
        assert_eq!(numbers.len(), layout.recorded().len(), "{}", layout.name);
        for field in layout.fields {
            let mut kind = field.kind;
            while let FieldType::Array(of, _) = kind {
                kind = *of;
            }
            if let FieldType::Packet(part) = kind {
                assert!(before.contains(&part.name), "{}", part.name);
            }
        }
        before.push(layout.name);
    }
}
