//! Identities of robots and calibrations: 16 hexadecimal digits of an FNV-1a hash. They detect mix-ups, not tampering.

use tactnet_catching_packets::RobotDescription;

/// Offset basis of 64-bit FNV-1a.
const START: u64 = 0xcbf2_9ce4_8422_2325;
/// Prime of 64-bit FNV-1a.
const FACTOR: u64 = 0x0000_0100_0000_01b3;

/// Returns the identity of a robot. It depends on geometry, optics and masses, which calibrations refer to, but not on
/// joint ranges, speeds and accelerations.
pub fn robot_identity(description: &RobotDescription) -> String {
    let cameras = &description.cameras;
    let head = [cameras.centre, description.imu.position].concat();
    let optics = [
        cameras.baseline,
        f64::from(cameras.width),
        f64::from(cameras.height),
        cameras.focal,
        description.neck.height,
    ];
    let lenses = cameras
        .distortion
        .iter()
        .chain(cameras.shifts.as_flattened());
    let arms = description.arms.iter().flat_map(|arm| {
        let links = arm.links.iter();
        let weights = links.flat_map(|link| std::iter::once(link.mass).chain(link.centre));
        let lengths = [
            arm.lean,
            arm.base_to_shoulder,
            arm.shoulder_to_elbow,
            arm.elbow_to_wrist,
            arm.wrist_to_catch,
        ];
        arm.position.into_iter().chain(lengths).chain(weights)
    });
    let numbers = head.into_iter().chain(optics).chain(lenses.copied());
    identity_of(numbers.chain(arms))
}

/// Returns the hash of a sequence of numbers.
pub(crate) fn identity_of(numbers: impl Iterator<Item = f64>) -> String {
    let hash = numbers
        // Makes -0.0 and 0.0 equal.
        .flat_map(|number| (number + 0.0).to_le_bytes())
        .fold(START, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(FACTOR)
        });
    format!("{hash:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_differ_by_what_calibrations_are_beside_and_by_nothing_else() {
        let nominal = RobotDescription::nominal();
        let known = robot_identity(&nominal);
        assert_eq!(known.len(), 16);
        type Change = fn(&mut RobotDescription);
        let others: [Change; 5] = [
            |robot| robot.arms[1].elbow_to_wrist += 0.001,
            |robot| robot.arms[0].links[6].mass += 0.1,
            |robot| robot.cameras.focal += 1.0,
            |robot| robot.cameras.shifts[1][2] += 0.001,
            |robot| robot.neck.height += 0.01,
        ];
        for change in others {
            let mut other = nominal.clone();
            change(&mut other);
            assert_ne!(robot_identity(&other), known);
        }
        let mut faster = nominal.clone();
        faster.arms[0].joints[3].speed *= 2.0;
        faster.platform.joint.range = [-1.0, 1.0];
        assert_eq!(robot_identity(&faster), known);
    }

    /// Existing files stay valid. The values are those of FNV-1a's authors for an empty input and for eight zero bytes.
    #[test]
    fn identities_do_not_change_from_version_to_version() {
        assert_eq!(identity_of(std::iter::empty()), "cbf29ce484222325");
        assert_eq!(identity_of([0.0].into_iter()), "a8c7f832281a39c5");
        assert_eq!(identity_of([-0.0].into_iter()), "a8c7f832281a39c5");
    }
}
