//! Packets between skin, motion controller, classifier and onlookers: plain data, little endian, without padding.
//!
//! | channel | packet | who puts it | when |
//! |---|---|---|---|
//! | `skin/<finger>` | [`SkinFrame`] | the skin's driver | at the skin's rate, 750 Hz |
//! | `sweep/command` | [`SweepCommand`] | the motion controller, a person | when a sweep starts or stops |
//! | `tactile/belief` | [`TactileBelief`] | the classifier | every 50 ms of a sweep, and at its end |
//! | `tactile/status` | [`TactileStatus`] | the classifier | on events, and ten times a second |
//! | `tactile/model` | [`ModelNames`] | the classifier | when a model begins to serve; kept for late joiners |
//!
//! Offsets stand beside every field, in bytes; a test compares them with the compiler's.

use bytemuck::{Pod, Zeroable};
use tactnet_channel::Packet;

/// Most taxels of a frame.
pub const MAX_TAXELS: usize = 1024;
/// Most materials of a classifier that serves.
pub const MAX_MATERIALS: usize = 64;

/// Returns why sweeps of so many taxels, or so many materials, cannot be classified online; `None` if they can.
pub fn unfit(taxels: usize, materials: usize) -> Option<String> {
    let over = |what, most: usize, found: usize| {
        (found > most).then(|| format!("{found} {what}, packets hold {most}"))
    };
    over("taxels", MAX_TAXELS, taxels).or_else(|| over("materials", MAX_MATERIALS, materials))
}

/// Up to `BYTES` bytes of UTF-8, filled up with zeros.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text<const BYTES: usize>([u8; BYTES]);

// SAFETY: an array of bytes, for any length.
unsafe impl<const BYTES: usize> Zeroable for Text<BYTES> {}
// SAFETY: as above; no padding, any bits.
unsafe impl<const BYTES: usize> Pod for Text<BYTES> {}

impl<const BYTES: usize> Text<BYTES> {
    /// As much of `text` as there is room for.
    pub fn new(text: &str) -> Self {
        let mut end = text.len().min(BYTES);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut bytes = [0; BYTES];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self(bytes)
    }

    /// The text; empty if a sender that runs amok put other bytes.
    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|b| *b == 0).unwrap_or(BYTES);
        std::str::from_utf8(&self.0[..end]).unwrap_or("")
    }
}

impl<const BYTES: usize> Default for Text<BYTES> {
    fn default() -> Self {
        Self([0; BYTES])
    }
}

impl<const BYTES: usize> std::fmt::Debug for Text<BYTES> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Debug::fmt(self.as_str(), f)
    }
}

/// One frame of a finger's skin, 4120 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct SkinFrame {
    /// 0: number of the frame since the sensor started; a gap is a lost frame.
    pub sequence: u64,
    /// 8: time of the measurement by the sensor's clock, nanoseconds.
    pub sensor_time_ns: u64,
    /// 16: number of taxels that are valid.
    pub taxels: u32,
    /// 20: zero.
    pub reserved: u32,
    /// 24: digits, row by row; the rest is zero.
    pub digits: [f32; MAX_TAXELS],
}

impl SkinFrame {
    /// The valid taxels.
    pub fn values(&self) -> &[f32] {
        &self.digits[..(self.taxels as usize).min(MAX_TAXELS)]
    }
}

/// A wish of the motion controller or a person, 80 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct SweepCommand {
    /// 0: see [`Command`].
    pub kind: u32,
    /// 4: number of the finger, from 0, in the order of the service's table.
    pub finger: u32,
    /// 8: number of the motion; comes back with beliefs.
    pub motion: u64,
    /// 16: for [`Command::Enroll`]: number of sweeps to take, the newest that were complete.
    pub sweeps: u32,
    /// 20: zero.
    pub reserved: u32,
    /// 24: for [`Command::Enroll`]: name of the new material; for [`Command::Start`]: what is swept over, where that is known (it is recorded,
    /// the classifier does not look).
    pub material: Text<56>,
}

/// The request of a [`SweepCommand`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Command {
    /// The finger begins to move; the next frame is the first of the sweep.
    Start = 1,
    /// The finger has stopped.
    Stop = 2,
    /// The next sweep is of another object: forget what was fused.
    Reset = 3,
    /// Learn a new material from the newest sweeps.
    Enroll = 4,
}

impl SweepCommand {
    /// Returns the request; `None` for a number that is no command.
    pub fn command(&self) -> Option<Command> {
        [
            Command::Start,
            Command::Stop,
            Command::Reset,
            Command::Enroll,
        ]
        .into_iter()
        .find(|command| *command as u32 == self.kind)
    }
}

/// A belief about the material, 632 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct TactileBelief {
    /// 0: number of the sweep since the service started, from 1.
    pub sweep: u64,
    /// 8: number of the motion, as commanded; 0 if nobody commanded.
    pub motion: u64,
    /// 16: version of the model.
    pub model_version: u64,
    /// 24: sequence of the newest frame that was used.
    pub last_frame: u64,
    /// 32: from that frame's put to this packet's, nanoseconds.
    pub latency_ns: u64,
    /// 40: see [`Stage`].
    pub stage: u32,
    /// 44: number of the finger.
    pub finger: u32,
    /// 48: frames of the window that were used.
    pub frames: u32,
    /// 52: how many of them were interpolated.
    pub filled_in: u32,
    /// 56: number of materials that are valid.
    pub materials: u32,
    /// 60: most probable material of this sweep.
    pub label: u32,
    /// 64: see [`Verdict`].
    pub verdict: u32,
    /// 68: entropy of `posterior`, nats.
    pub entropy: f32,
    /// 72: how strange the sweep is; meaningless without a verdict.
    pub strangeness: f32,
    /// 76: what it was compared with.
    pub threshold: f32,
    /// 80: number of sweeps in `fused`; 0: it is flat.
    pub fused_sweeps: u32,
    /// 84: most probable material of the fused sweeps.
    pub fused_label: u32,
    /// 88: entropy of `fused`, nats.
    pub fused_entropy: f32,
    /// 92: whether the object is known, given the mean strangeness of its whole sweeps; see [`Verdict`].
    pub fused_verdict: u32,
    /// 96: probabilities given this sweep alone; the rest is zero.
    pub posterior: [f32; MAX_MATERIALS],
    /// 352: probabilities given all fused sweeps; the rest is zero.
    pub fused: [f32; MAX_MATERIALS],
    /// 608: zero.
    pub reserved_end: [u64; 3],
}

/// How far a prediction is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Stage {
    /// Of a sweep that is going on.
    Anytime = 1,
    /// Of a whole sweep, without dropout.
    Plain = 2,
    /// Of a whole sweep, by Monte Carlo dropout; this is the one that is fused, where the service has masks.
    Dropout = 3,
}

/// Known material or not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Verdict {
    /// The classifier cannot tell, or not yet.
    NotTold = 0,
    /// It is one of the materials.
    Known = 1,
    /// It is none of them.
    Unknown = 2,
}

/// Events and counters of the service, 296 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct TactileStatus {
    /// 0: see [`Event`].
    pub event: u32,
    /// 4: number of the finger.
    pub finger: u32,
    /// 8: number of the sweep.
    pub sweep: u64,
    /// 16: number of the motion.
    pub motion: u64,
    /// 24: version of the model that serves.
    pub model_version: u64,
    /// 32: since the service started.
    pub counters: Counters,
    /// 104: for people, one line.
    pub text: Text<192>,
}

/// Counters of the service, 72 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Counters {
    /// 0: frames that came.
    pub frames: u64,
    /// 8: frames that were put and never came.
    pub dropped_frames: u64,
    /// 16: beliefs that were put.
    pub beliefs: u64,
    /// 24: whole sweeps classified.
    pub sweeps: u64,
    /// 32: sweeps that were rejected.
    pub rejected: u64,
    /// 40: whole sweeps of unknown materials.
    pub unknown: u64,
    /// 48: predictions that took longer than promised.
    pub deadline_misses: u64,
    /// 56: longest time from a frame's put until the service had dealt with it, nanoseconds.
    pub worst_delay_ns: u64,
    /// 64: allocations of the thread that follows frames, while it followed them.
    pub allocations: u64,
}

/// An event of the service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Event {
    /// Nothing; counters only.
    Alive = 0,
    /// A sweep began.
    Begun = 1,
    /// A sweep was classified.
    Classified = 2,
    /// A sweep cannot be used; the text says why.
    Rejected = 3,
    /// The fused sweeps were forgotten.
    Reset = 4,
    /// A command cannot be followed; the text says why.
    Refused = 5,
    /// Another model serves from now on.
    Swapped = 6,
    /// A new model cannot serve; the text says why.
    ModelRejected = 7,
    /// A new material was learnt; the text names it.
    Enrolled = 8,
    /// A component cannot be reached; the text says why.
    Unreachable = 9,
}

/// The materials of the model that serves, 4136 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ModelNames {
    /// 0: version of the model.
    pub version: u64,
    /// 8: frames per second.
    pub sample_rate_hz: f64,
    /// 16: frames of a window.
    pub steps: u32,
    /// 20: rows of taxels.
    pub rows: u32,
    /// 24: columns of taxels.
    pub cols: u32,
    /// 28: Monte Carlo dropout masks.
    pub mc_samples: u32,
    /// 32: number of materials that are valid.
    pub materials: u32,
    /// 36: zero.
    pub reserved: u32,
    /// 40: their names.
    pub names: [Text<64>; MAX_MATERIALS],
}

macro_rules! packets {
    ($($packet:ident $version:literal,)*) => { $(
        impl Packet for $packet {
            const NAME: &'static str = stringify!($packet);
            const VERSION: u32 = $version;
        }
    )* };
}
// A packet's version goes up with its layout.
packets!(SkinFrame 2, SweepCommand 1, TactileBelief 2, TactileStatus 1, ModelNames 1,);

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use super::*;

    #[test]
    fn packets_lie_as_documented() {
        assert_eq!(size_of::<SkinFrame>(), 24 + 4 * MAX_TAXELS);
        assert_eq!(size_of::<SweepCommand>(), 80);
        assert_eq!(size_of::<TactileBelief>(), 632);
        assert_eq!(size_of::<TactileStatus>(), 296);
        assert_eq!(size_of::<Counters>(), 72);
        assert_eq!(size_of::<ModelNames>(), 40 + 64 * 64);
        let documented = include_str!("packets.rs");
        // Every `/// N: ...` stands before `pub name:` of the packet that is open.
        let mut found = Vec::new();
        let (mut packet, mut offset) = ("", None);
        for line in documented.lines().map(str::trim) {
            if let Some(name) = line.strip_prefix("pub struct ") {
                packet = name.split([' ', '<', '(']).next().unwrap();
            } else if let Some(text) = line.strip_prefix("/// ") {
                offset = text
                    .split_once(": ")
                    .and_then(|(n, _)| n.parse::<usize>().ok())
                    .or(offset);
            } else if let (Some(name), Some(at)) = (line.strip_prefix("pub "), offset) {
                let name = name.split(':').next().unwrap();
                found.push((packet, name, at));
                offset = None;
            }
        }
        macro_rules! offsets {
            ($($packet:ident { $($field:ident)* })*) => {
                vec![$($((stringify!($packet), stringify!($field), offset_of!($packet, $field)),)*)*]
            };
        }
        let compiled = offsets! {
            SkinFrame { sequence sensor_time_ns taxels reserved digits }
            SweepCommand { kind finger motion sweeps reserved material }
            TactileBelief { sweep motion model_version last_frame latency_ns stage finger frames filled_in materials label verdict
                entropy strangeness threshold fused_sweeps fused_label fused_entropy fused_verdict posterior fused reserved_end }
            TactileStatus { event finger sweep motion model_version counters text }
            Counters { frames dropped_frames beliefs sweeps rejected unknown deadline_misses worst_delay_ns allocations }
            ModelNames { version sample_rate_hz steps rows cols mc_samples materials reserved names }
        };
        assert_eq!(found, compiled);
    }

    #[test]
    fn text_is_cut_between_characters_and_survives_nonsense() {
        assert_eq!(Text::<4>::new("ab").as_str(), "ab");
        assert_eq!(Text::<4>::new("abcü").as_str(), "abc");
        assert_eq!(Text::<4>::new("").as_str(), "");
        assert_eq!(Text::<2>([0xff, 0xff]).as_str(), "");
    }
}
