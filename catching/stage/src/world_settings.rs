//! Settings of the simulated world in real time.

use serde::{Deserialize, Serialize};
use tactnet_catching_world::{TendonSlip, WorldConfig};

tactnet_catching_packets::settings! {
    /// Settings of the world.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct WorldSettings {
        /// Settings of the physics.
        pub world: WorldConfig = WorldConfig::default(),
        /// Seed of all random numbers.
        pub seed: u64 = 1,
        /// Number of balls per throw, 1 or 2.
        pub balls: usize = 1,
        /// Time that the robot waits before a throw, in s.
        pub rest: f64 = 3.0,
        /// Time from the middle of an exposure to the picture's arrival in memory, in s.
        pub camera: f64 = 0.04,
        /// Duration of circle detection, in s. Circles that come straight from the true state arrive that much later
        /// than pictures.
        pub detection: f64 = 0.0145,
        /// Possible materials of the balls. A caught ball is held until it is explored; empty disables the exploration.
        pub materials: Vec<String> = Vec::new(),
        /// Caught balls stay in the hand until a command opens it.
        pub throw_back: bool = false,
        /// Renders pictures; otherwise circles come straight from the true state, with noise, misses and clutter.
        pub pixels: bool = false,
        /// Tendon slip during the run.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub slip: Option<SlipAt> = None,
    }
}

/// A tendon slip during a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlipAt {
    /// Number of the throw after the slip, counted from 1.
    pub throw: u64,
    /// Slipping tendon and amount.
    pub tendon: TendonSlip,
}

/// Returns the index of the material of the ball of a grip, or `None` without materials. Each seed has its own order.
pub fn material_of_grip(seed: u64, grip: u64, materials: usize) -> Option<usize> {
    // SplitMix64 (Steele et al., 2014).
    let mut mixed = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ grip;
    mixed = mixed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^= mixed >> 31;
    mixed
        .checked_rem(materials as u64)
        .map(|place| place as usize)
}
