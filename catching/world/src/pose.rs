//! Poses for tests.

use tactnet_catching_packets::{JOINTS, joint};

/// Returns a pose with both hands half a metre in front of their shoulders, open towards the thrower and slightly
/// upwards.
pub(crate) fn ready() -> [f64; JOINTS] {
    let mut q = [0.0; JOINTS];
    q[joint::LEFT_ARM].copy_from_slice(&[-1.155, 1.929, 1.8544, 2.0674, 2.495, 0.2335, 2.1568]);
    q[joint::RIGHT_ARM].copy_from_slice(&[1.204, 1.7887, -1.9331, 2.0674, -2.0753, 0.3498, 0.6376]);
    q
}
