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
//! They are described here and nowhere else: `docs/packets.md` (with offsets), the headers of C and C++, `tactnet.packets` of Python and the
//! messages of recordings are generated from [`DESCRIPTION`].

use tactnet_channel::{Described, Description, choices, packets};

pub use tactnet_channel::Text;

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

// A packet's version goes up with its layout; a number of `recorded` is never used for another field.
packets! {
    /// One frame of a finger's skin.
    #[version(2)]
    pub struct SkinFrame {
        /// Number of the frame since the sensor started; a gap is a lost frame.
        #[recorded(1)]
        pub sequence: u64,
        /// Time of the measurement by the sensor's clock, nanoseconds.
        #[recorded(2)]
        pub sensor_time_ns: u64,
        /// Number of taxels that are valid.
        pub taxels: u32,
        /// Zero.
        pub reserved: u32,
        /// Digits, row by row; the rest is zero.
        #[recorded(3, taxels)]
        pub digits: [f32; MAX_TAXELS],
    }

    /// A wish of the motion controller or a person.
    #[version(1)]
    pub struct SweepCommand {
        /// See [`Command`].
        #[recorded(1)]
        pub kind: u32,
        /// Number of the finger, from 0, in the order of the service's table.
        #[recorded(2)]
        pub finger: u32,
        /// Number of the motion; comes back with beliefs.
        #[recorded(3)]
        pub motion: u64,
        /// For [`Command::Enroll`]: number of sweeps to take, the newest that were complete.
        #[recorded(4)]
        pub sweeps: u32,
        /// Zero.
        pub reserved: u32,
        /// For [`Command::Enroll`]: name of the new material; for [`Command::Start`]: what is swept over, where that is known (it is recorded,
        /// the classifier does not look).
        #[recorded(5)]
        pub material: Text<56>,
    }

    /// A belief about the material.
    #[version(2)]
    pub struct TactileBelief {
        /// Number of the sweep since the service started, from 1.
        #[recorded(1)]
        pub sweep: u64,
        /// Number of the motion, as commanded; 0 if nobody commanded.
        #[recorded(2)]
        pub motion: u64,
        /// Version of the model.
        #[recorded(3)]
        pub model_version: u64,
        /// Sequence of the newest frame that was used.
        #[recorded(4)]
        pub last_frame: u64,
        /// From that frame's put to this packet's, nanoseconds.
        #[recorded(5)]
        pub latency_ns: u64,
        /// See [`Stage`].
        #[recorded(6)]
        pub stage: u32,
        /// Number of the finger.
        #[recorded(7)]
        pub finger: u32,
        /// Frames of the window that were used.
        #[recorded(8)]
        pub frames: u32,
        /// How many of them were interpolated.
        #[recorded(9)]
        pub filled_in: u32,
        /// Number of materials that are valid.
        pub materials: u32,
        /// Most probable material of this sweep.
        #[recorded(10)]
        pub label: u32,
        /// See [`Verdict`].
        #[recorded(11)]
        pub verdict: u32,
        /// Entropy of `posterior`, nats.
        #[recorded(12)]
        pub entropy: f32,
        /// How strange the sweep is; meaningless without a verdict.
        #[recorded(13)]
        pub strangeness: f32,
        /// What it was compared with.
        #[recorded(14)]
        pub threshold: f32,
        /// Number of sweeps in `fused`; 0: it is flat.
        #[recorded(15)]
        pub fused_sweeps: u32,
        /// Most probable material of the fused sweeps.
        #[recorded(16)]
        pub fused_label: u32,
        /// Entropy of `fused`, nats.
        #[recorded(17)]
        pub fused_entropy: f32,
        /// Whether the object is known, given the mean strangeness of its whole sweeps; see [`Verdict`].
        #[recorded(20)]
        pub fused_verdict: u32,
        /// Probabilities given this sweep alone; the rest is zero.
        #[recorded(18, materials)]
        pub posterior: [f32; MAX_MATERIALS],
        /// Probabilities given all fused sweeps; the rest is zero.
        #[recorded(19, materials)]
        pub fused: [f32; MAX_MATERIALS],
        /// Zero.
        pub reserved_end: [u64; 3],
    }

    /// Counters of the service.
    #[derive(Default, PartialEq, Eq)]
    pub struct Counters {
        /// Frames that came.
        #[recorded(7)]
        pub frames: u64,
        /// Frames that were put and never came.
        #[recorded(8)]
        pub dropped_frames: u64,
        /// Beliefs that were put.
        #[recorded(9)]
        pub beliefs: u64,
        /// Whole sweeps classified.
        #[recorded(10)]
        pub sweeps: u64,
        /// Sweeps that were rejected.
        #[recorded(11)]
        pub rejected: u64,
        /// Whole sweeps of unknown materials.
        #[recorded(12)]
        pub unknown: u64,
        /// Predictions that took longer than promised.
        #[recorded(13)]
        pub deadline_misses: u64,
        /// Longest time from a frame's put until the service had dealt with it, nanoseconds.
        #[recorded(14)]
        pub worst_delay_ns: u64,
        /// Allocations of the thread that follows frames, while it followed them.
        #[recorded(15)]
        pub allocations: u64,
    }

    /// Events and counters of the service.
    #[version(1)]
    pub struct TactileStatus {
        /// See [`Event`].
        #[recorded(1)]
        pub event: u32,
        /// Number of the finger.
        #[recorded(2)]
        pub finger: u32,
        /// Number of the sweep.
        #[recorded(3)]
        pub sweep: u64,
        /// Number of the motion.
        #[recorded(4)]
        pub motion: u64,
        /// Version of the model that serves.
        #[recorded(5)]
        pub model_version: u64,
        /// Since the service started.
        pub counters: Counters,
        /// For people, one line.
        #[recorded(6)]
        pub text: Text<192>,
    }

    /// The materials of the model that serves.
    #[version(1)]
    pub struct ModelNames {
        /// Version of the model.
        #[recorded(1)]
        pub version: u64,
        /// Frames per second.
        #[recorded(2)]
        pub sample_rate_hz: f64,
        /// Frames of a window.
        #[recorded(3)]
        pub steps: u32,
        /// Rows of taxels.
        #[recorded(4)]
        pub rows: u32,
        /// Columns of taxels.
        #[recorded(5)]
        pub cols: u32,
        /// Monte Carlo dropout masks.
        #[recorded(6)]
        pub mc_samples: u32,
        /// Number of materials that are valid.
        pub materials: u32,
        /// Zero.
        pub reserved: u32,
        /// Their names.
        #[recorded(7, materials)]
        pub names: [Text<64>; MAX_MATERIALS],
    }
}

choices! {
    /// The request of a [`SweepCommand`].
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

    /// How far a prediction is.
    pub enum Stage {
        /// Of a sweep that is going on.
        Anytime = 1,
        /// Of a whole sweep, without dropout.
        Plain = 2,
        /// Of a whole sweep, by Monte Carlo dropout; this is the one that is fused, where the service has masks.
        Dropout = 3,
    }

    /// Known material or not.
    pub enum Verdict {
        /// The classifier cannot tell, or not yet.
        NotTold = 0,
        /// It is one of the materials.
        Known = 1,
        /// It is none of them.
        Unknown = 2,
    }

    /// An event of the service.
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
}

impl SkinFrame {
    /// The valid taxels.
    pub fn values(&self) -> &[f32] {
        &self.digits[..(self.taxels as usize).min(MAX_TAXELS)]
    }
}

impl SweepCommand {
    /// Returns the request; `None` for a number that is no command.
    pub fn command(&self) -> Option<Command> {
        Command::of(self.kind)
    }
}

/// The packets for other languages.
pub const DESCRIPTION: Description = Description {
    project: "tactnet",
    source: "serving/skin/src/packets.rs",
    constants: &[
        ("MAX_TAXELS", "Most taxels of a frame.", MAX_TAXELS),
        (
            "MAX_MATERIALS",
            "Most materials of a classifier that serves.",
            MAX_MATERIALS,
        ),
    ],
    choices: &[
        Command::CHOICE,
        Stage::CHOICE,
        Verdict::CHOICE,
        Event::CHOICE,
    ],
    packets: &[
        SkinFrame::LAYOUT,
        SweepCommand::LAYOUT,
        TactileBelief::LAYOUT,
        Counters::LAYOUT,
        TactileStatus::LAYOUT,
        ModelNames::LAYOUT,
    ],
};
