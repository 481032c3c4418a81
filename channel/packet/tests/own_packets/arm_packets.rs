//! Packets of arm. Generated from arm.toml; do not edit.

use tactnet_channel::{Described, Description, Text, choices, packets};

/// Joints of the arm.
pub const JOINTS: usize = 3;

choices! {
    /// Mode of the arm.
    pub enum Mode {
        /// Brakes closed.
        Braked = 0,
        Moving = 2,
    }
}

packets! {
    /// A vector in the robot's frame.
    pub struct Vector {
        #[recorded(1)]
        pub x: f64,
        #[recorded(2)]
        pub y: f64,
        #[recorded(3)]
        pub z: f64,
    }
    /// Position and orientation.
    pub struct Frame {
        /// Position, in m.
        #[recorded(1)]
        pub at: Vector,
        /// Rotation matrix, row by row.
        #[recorded(2)]
        pub rotation: [[f64; 3]; 3],
    }
    /// State of a joint.
    pub struct Joint {
        /// Angle, in rad.
        #[recorded(1)]
        pub position: f64,
        /// In Nm.
        #[recorded(2)]
        pub torque: f32,
        /// Bits of the drive's errors.
        #[recorded(3)]
        pub errors: u16,
        /// Temperature of the motor, in °C.
        #[recorded(4)]
        pub temperature: i8,
        pub reserved: u8,
    }
    /// State of the arm, a thousand times a second.
    #[version(2)]
    pub struct ArmState {
        /// Time of the measurement, in ns.
        #[recorded(1)]
        pub time_ns: u64,
        /// Mode; see Mode.
        #[recorded(2)]
        pub mode: u32,
        /// Number of valid contacts.
        pub contacts: u32,
        /// Joints, from the base.
        #[recorded(4)]
        pub joints: [Joint; 3],
        /// Frame of the hand.
        #[recorded(5)]
        pub hand: Frame,
        /// Two points for each contact.
        #[recorded(6, contacts)]
        pub contact_points: [[Vector; 2]; 2],
        /// Digits, by layer, row and column.
        #[recorded(7)]
        pub grid: [[[i16; 4]; 3]; 2],
        /// Name of the tool.
        #[recorded(8)]
        pub tool: Text<9>,
        #[recorded(20)]
        pub tags: [Text<4>; 2],
        pub reserved: [u8; 7],
    }
}

/// Description of the packets, from which the definitions for other languages are generated.
pub const DESCRIPTION: Description = Description {
    project: "arm",
    source: "arm.toml",
    constants: &[("JOINTS", "Joints of the arm.", JOINTS)],
    choices: &[Mode::CHOICE],
    packets: &[Vector::LAYOUT, Frame::LAYOUT, Joint::LAYOUT, ArmState::LAYOUT],
};
