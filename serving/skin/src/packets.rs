//! Packets exchanged by the skin driver, the motion controller, the classifier and observers: plain data, little
//! endian, without padding.
//!
//! | channel | packet | sender | time |
//! |---|---|---|---|
//! | `skin/<finger>` | [`SkinFrame`] | the skin driver | at the skin's rate, 750 Hz |
//! | `sweep/command` | [`SweepCommand`] | the motion controller or a person | when a sweep starts or stops |
//! | `tactile/belief` | [`TactileBelief`] | the classifier | every 50 ms during a sweep, and at its end |
//! | `tactile/status` | [`TactileStatus`] | the classifier | on events, and ten times a second |
//! | `tactile/model` | [`ModelNames`] | the classifier | when a model starts to serve; kept for late subscribers |
//!
//! This file is the only definition. The page of packets in the book (with offsets), the C and C++ headers, the Python module
//! `tactnet.packets` and the messages of recordings are generated from [`DESCRIPTION`].

use tactnet_channel::{Described, Description, choices, packets};

pub use tactnet_channel::Text;

/// Maximum number of taxels in a frame.
pub const MAX_TAXELS: usize = 1024;
/// Maximum number of materials of a classifier that serves.
pub const MAX_MATERIALS: usize = 64;

/// Returns the reason why a model with this many taxels and materials does not fit the packets, or `None` if it fits.
///
/// # Example
/// ```
/// use tactnet_skin::packets::unfit;
///
/// assert_eq!(unfit(16, 36), None);
/// assert_eq!(unfit(2000, 36).unwrap(), "2000 taxels, packets hold 1024");
/// ```
pub fn unfit(taxels: usize, materials: usize) -> Option<String> {
    let over = |what, most: usize, found: usize| {
        (found > most).then(|| format!("{found} {what}, packets hold {most}"))
    };
    over("taxels", MAX_TAXELS, taxels).or_else(|| over("materials", MAX_MATERIALS, materials))
}

// A change of layout increments the packet's version. A `recorded` number is never reused for another field.
packets! {
    /// One frame of a finger's skin.
    #[version(2)]
    pub struct SkinFrame {
        /// Number of the frame since the sensor started; a gap is a lost frame.
        #[recorded(1)]
        pub sequence: u64,
        /// Measurement time by the sensor's clock, in ns.
        #[recorded(2)]
        pub sensor_time_ns: u64,
        /// Number of valid taxels.
        pub taxels: u32,
        /// Always zero.
        pub reserved: u32,
        /// Taxel values in digits, row by row; unused entries are zero.
        #[recorded(3, taxels)]
        pub digits: [f32; MAX_TAXELS],
    }

    /// A command of the motion controller or a person.
    #[version(1)]
    pub struct SweepCommand {
        /// The command; see [`Command`].
        #[recorded(1)]
        pub kind: u32,
        /// Index of the finger in the service's table, from 0.
        #[recorded(2)]
        pub finger: u32,
        /// Number of the motion, which the beliefs repeat.
        #[recorded(3)]
        pub motion: u64,
        /// For [`Command::Enroll`] and [`Command::Adapt`]: number of most recent complete sweeps to use.
        #[recorded(4)]
        pub sweeps: u32,
        /// Always zero.
        pub reserved: u32,
        /// For [`Command::Enroll`]: name of the new material. For [`Command::Start`]: the material under the finger, if
        /// known. It is recorded; the classifier ignores it.
        #[recorded(5)]
        pub material: Text<56>,
    }

    /// A prediction of the material.
    #[version(2)]
    pub struct TactileBelief {
        /// Number of the sweep since the service started, from 1.
        #[recorded(1)]
        pub sweep: u64,
        /// Number of the motion from the command; 0 without a command.
        #[recorded(2)]
        pub motion: u64,
        /// Version of the model.
        #[recorded(3)]
        pub model_version: u64,
        /// Sequence number of the newest frame used.
        #[recorded(4)]
        pub last_frame: u64,
        /// Delay between the sending of that frame and the sending of this packet, in ns.
        #[recorded(5)]
        pub latency_ns: u64,
        /// Stage of the prediction; see [`Stage`].
        #[recorded(6)]
        pub stage: u32,
        /// Index of the finger.
        #[recorded(7)]
        pub finger: u32,
        /// Number of frames of the window used.
        #[recorded(8)]
        pub frames: u32,
        /// Number of interpolated frames among them.
        #[recorded(9)]
        pub filled_in: u32,
        /// Number of valid materials.
        pub materials: u32,
        /// Label of the most probable material of this sweep.
        #[recorded(10)]
        pub label: u32,
        /// Verdict of this sweep; see [`Verdict`].
        #[recorded(11)]
        pub verdict: u32,
        /// Entropy of `posterior`, in nats.
        #[recorded(12)]
        pub entropy: f32,
        /// Novelty score of the sweep; undefined without a verdict.
        #[recorded(13)]
        pub strangeness: f32,
        /// Threshold for the novelty score.
        #[recorded(14)]
        pub threshold: f32,
        /// Number of sweeps in `fused`. If 0, `fused` is uniform.
        #[recorded(15)]
        pub fused_sweeps: u32,
        /// Label of the most probable material of the fused sweeps.
        #[recorded(16)]
        pub fused_label: u32,
        /// Entropy of `fused`, in nats.
        #[recorded(17)]
        pub fused_entropy: f32,
        /// Verdict of the object, from the mean novelty score of its complete sweeps; see [`Verdict`].
        #[recorded(20)]
        pub fused_verdict: u32,
        /// Probabilities given this sweep alone; unused entries are zero.
        #[recorded(18, materials)]
        pub posterior: [f32; MAX_MATERIALS],
        /// Probabilities given all fused sweeps; unused entries are zero.
        #[recorded(19, materials)]
        pub fused: [f32; MAX_MATERIALS],
        /// Always zero.
        pub reserved_end: [u64; 3],
    }

    /// Counters of the service, since its start.
    #[derive(Default, PartialEq, Eq)]
    pub struct Counters {
        /// Number of received frames.
        #[recorded(7)]
        pub frames: u64,
        /// Number of frames that were sent but not received.
        #[recorded(8)]
        pub dropped_frames: u64,
        /// Number of beliefs sent.
        #[recorded(9)]
        pub beliefs: u64,
        /// Number of complete sweeps classified.
        #[recorded(10)]
        pub sweeps: u64,
        /// Number of rejected sweeps.
        #[recorded(11)]
        pub rejected: u64,
        /// Number of complete sweeps of unknown materials.
        #[recorded(12)]
        pub unknown: u64,
        /// Number of predictions that missed their deadline.
        #[recorded(13)]
        pub deadline_misses: u64,
        /// Maximum time from the sending of a frame to the end of its processing, in ns.
        #[recorded(14)]
        pub worst_delay_ns: u64,
        /// Number of allocations of the frame thread while it processed frames.
        #[recorded(15)]
        pub allocations: u64,
    }

    /// An event of the service, with its counters.
    #[version(1)]
    pub struct TactileStatus {
        /// The event; see [`Event`].
        #[recorded(1)]
        pub event: u32,
        /// Index of the finger.
        #[recorded(2)]
        pub finger: u32,
        /// Number of the sweep.
        #[recorded(3)]
        pub sweep: u64,
        /// Number of the motion.
        #[recorded(4)]
        pub motion: u64,
        /// Version of the serving model.
        #[recorded(5)]
        pub model_version: u64,
        /// Counters since the service started.
        pub counters: Counters,
        /// One line of text for people.
        #[recorded(6)]
        pub text: Text<192>,
    }

    /// Materials and shape of the serving model.
    #[version(1)]
    pub struct ModelNames {
        /// Version of the model.
        #[recorded(1)]
        pub version: u64,
        /// Sample rate, in frames per second.
        #[recorded(2)]
        pub sample_rate_hz: f64,
        /// Number of frames in a window.
        #[recorded(3)]
        pub steps: u32,
        /// Number of taxel rows.
        #[recorded(4)]
        pub rows: u32,
        /// Number of taxel columns.
        #[recorded(5)]
        pub cols: u32,
        /// Number of Monte Carlo dropout masks.
        #[recorded(6)]
        pub mc_samples: u32,
        /// Number of valid materials.
        pub materials: u32,
        /// Always zero.
        pub reserved: u32,
        /// Names of the materials, by label.
        #[recorded(7, materials)]
        pub names: [Text<64>; MAX_MATERIALS],
    }
}

choices! {
    /// Kind of a [`SweepCommand`].
    pub enum Command {
        /// The finger starts to move; the next frame is the first of the sweep.
        Start = 1,
        /// The finger has stopped.
        Stop = 2,
        /// The next sweep belongs to another object; the fused sweeps are discarded.
        Reset = 3,
        /// Enroll a new material from the most recent sweeps.
        Enroll = 4,
        /// Adapt the model to the most recent sweeps of all fingers, which must be of mixed materials.
        Adapt = 5,
    }

    /// Stage of a prediction.
    pub enum Stage {
        /// Prediction during a sweep.
        Anytime = 1,
        /// Prediction of a complete sweep, without dropout.
        Plain = 2,
        /// Prediction of a complete sweep with Monte Carlo dropout. If the service has masks, this prediction is fused.
        Dropout = 3,
    }

    /// Verdict on whether the material is known.
    pub enum Verdict {
        /// The classifier is not calibrated, or has not decided yet.
        NotTold = 0,
        /// The material is one of the trained materials.
        Known = 1,
        /// The material is none of the trained materials.
        Unknown = 2,
    }

    /// Kind of event of the service.
    pub enum Event {
        /// No event; the packet carries counters only.
        Alive = 0,
        /// A sweep started.
        Begun = 1,
        /// A sweep was classified.
        Classified = 2,
        /// A sweep was rejected; the text gives the reason.
        Rejected = 3,
        /// The fused sweeps were discarded.
        Reset = 4,
        /// A command was refused; the text gives the reason.
        Refused = 5,
        /// Another model serves from now on.
        Swapped = 6,
        /// A new model was refused; the text gives the reason.
        ModelRejected = 7,
        /// A new material was enrolled; the text names it.
        Enrolled = 8,
        /// A component cannot be reached; the text gives the reason.
        Unreachable = 9,
        /// The sweeps of this object, the newest of which the packet names, are like the training data; the text gives p-values.
        Like = 10,
        /// They differ from the training data no more than its recording blocks differ from one another.
        OtherBlock = 11,
        /// They are unlike the training data; the text says what differs.
        Unlike = 12,
        /// Other taxels are masked as dead from now on; the text names them.
        Masked = 13,
        /// The model was adapted to recent sweeps; the text says by how much.
        Adapted = 14,
    }
}

impl SkinFrame {
    /// Returns the valid taxel values, in digits.
    ///
    /// # Example
    /// ```
    /// use bytemuck::Zeroable;
    /// use tactnet_skin::packets::SkinFrame;
    ///
    /// let mut frame = SkinFrame { taxels: 2, ..SkinFrame::zeroed() };
    /// frame.digits[..2].copy_from_slice(&[3.0, 4.0]);
    /// assert_eq!(frame.values(), [3.0, 4.0]);
    /// ```
    pub fn values(&self) -> &[f32] {
        &self.digits[..(self.taxels as usize).min(MAX_TAXELS)]
    }
}

impl SweepCommand {
    /// Returns the command, or `None` if `kind` is not a valid number.
    ///
    /// # Example
    /// ```
    /// use bytemuck::Zeroable;
    /// use tactnet_skin::packets::{Command, SweepCommand};
    ///
    /// let start = SweepCommand { kind: Command::Start as u32, ..SweepCommand::zeroed() };
    /// assert_eq!(start.command(), Some(Command::Start));
    /// assert_eq!(SweepCommand::zeroed().command(), None);
    /// ```
    pub fn command(&self) -> Option<Command> {
        Command::of(self.kind)
    }
}

/// Description of the packets, from which the definitions for other languages are generated.
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
