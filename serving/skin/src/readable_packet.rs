//! Tactile packets as JSON objects, with enum values and material names as text.

use bytemuck::AnyBitPattern;
use serde::Serialize;
use tactnet_channel::Packet;

use crate::packets::{
    Command, Event, ModelNames, SkinFrame, Stage, SweepCommand, TactileBelief, TactileStatus,
    Verdict,
};

/// A tactile packet in readable form. Invalid numbers become `"?"` or `null`.
///
/// # Example
/// ```
/// use bytemuck::Zeroable;
/// use tactnet_channel::Packet;
/// use tactnet_skin::{ReadablePacket, packets::{Command, SweepCommand}};
///
/// let start = SweepCommand { kind: Command::Start as u32, motion: 3, ..SweepCommand::zeroed() };
/// let (name, version) = (SweepCommand::NAME, SweepCommand::VERSION);
/// let readable = ReadablePacket::new(name, version, bytemuck::bytes_of(&start), None);
/// assert!(matches!(
///     readable,
///     Some(ReadablePacket::SweepCommand { command: "start", motion: 3, .. })
/// ));
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "type")]
pub enum ReadablePacket {
    /// A frame of the skin.
    SkinFrame {
        /// Sequence number since the sensor started.
        frame: u64,
        /// Measurement time by the sensor's clock, in ms.
        sensor_time_ms: f64,
        /// `[taxels]`: values in digits, row by row.
        values: Vec<f32>,
    },
    /// A command of the motion controller or a person.
    SweepCommand {
        /// `start`, `stop`, `reset` or `enroll`.
        command: &'static str,
        /// Index of the finger, from 0.
        finger: u32,
        /// Number of the motion.
        motion: u64,
        /// The material under the finger or to be enrolled; empty if unknown.
        material: String,
    },
    /// A prediction of the material.
    TactileBelief {
        /// Number of the sweep, from 1.
        sweep: u64,
        /// Index of the finger, from 0.
        finger: u32,
        /// `anytime`, `plain` or `dropout`.
        stage: &'static str,
        /// Number of frames of the sweep so far.
        frames: u32,
        /// Number of frames of a complete sweep, if the network is known.
        #[serde(skip_serializing_if = "Option::is_none")]
        sweep_frames: Option<u32>,
        /// True during the sweep, while the prediction may still change.
        provisional: bool,
        /// Prediction from this sweep alone.
        sweep_says: MaterialPrediction,
        /// Prediction from all sweeps of the object; `None` before the first complete sweep.
        object_says: Option<MaterialPrediction>,
        /// Number of complete sweeps in `object_says`.
        object_sweeps: u32,
        /// Delay from the newest frame to this belief, in ms.
        latency_ms: f64,
    },
    /// An event of the classifier.
    TactileStatus {
        /// `alive`, `begun`, `classified`, `rejected`, …
        event: &'static str,
        /// Index of the finger, from 0.
        finger: u32,
        /// Number of the sweep.
        sweep: u64,
        /// Number of frames received so far.
        frames: u64,
        /// Number of complete sweeps so far.
        sweeps: u64,
        /// Number of rejected sweeps so far.
        rejected: u64,
        /// One line of text for people.
        text: String,
    },
    /// The serving network.
    ModelNames {
        /// Version of the network.
        version: u64,
        /// Sample rate, in frames per second.
        sample_rate_hz: f64,
        /// Number of frames in a sweep.
        steps: u32,
        /// Number of taxel rows.
        rows: u32,
        /// Number of taxel columns.
        cols: u32,
        /// Names of the materials, by label.
        materials: Vec<String>,
    },
}

/// The most probable material of a prediction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MaterialPrediction {
    /// Label of the material.
    pub label: u32,
    /// Name of the material, if the network is known.
    pub material: Option<String>,
    /// Probability of the material, 0 to 1.
    pub probability: Option<f32>,
    /// `known`, `unknown` or `not told`.
    pub verdict: &'static str,
}

impl ReadablePacket {
    /// Returns the first item of a packet, or `None` if the packet is not tactile, of another version, or too short.
    ///
    /// - `packet`, `version`: the packet type, from the channel table
    /// - `network`: the network that made the predictions, if known
    pub fn new(
        packet: &str,
        version: u32,
        bytes: &[u8],
        network: Option<&ModelNames>,
    ) -> Option<Self> {
        None.or_else(|| item(packet, version, bytes).map(|frame| of_frame(&frame)))
            .or_else(|| item(packet, version, bytes).map(|command| of_command(&command)))
            .or_else(|| item(packet, version, bytes).map(|belief| of_belief(&belief, network)))
            .or_else(|| item(packet, version, bytes).map(|status| of_status(&status)))
            .or_else(|| item(packet, version, bytes).map(|model| of_names(&model)))
    }
}

/// Returns the names of a network's materials, by label.
///
/// # Example
/// ```
/// use bytemuck::Zeroable;
/// use tactnet_skin::{material_names, packets::{ModelNames, Text}};
///
/// let mut model = ModelNames { materials: 1, ..ModelNames::zeroed() };
/// model.names[0] = Text::new("cork");
/// assert_eq!(material_names(&model), ["cork"]);
/// ```
pub fn material_names(model: &ModelNames) -> Vec<String> {
    let known = (model.materials as usize).min(model.names.len());
    let names = model.names[..known].iter();
    names.map(|name| name.as_str().to_owned()).collect()
}

fn item<T: Packet + AnyBitPattern>(packet: &str, version: u32, bytes: &[u8]) -> Option<T> {
    let first = bytes.get(..size_of::<T>())?;
    (packet == T::NAME && version == T::VERSION).then(|| bytemuck::pod_read_unaligned(first))
}

fn of_frame(frame: &SkinFrame) -> ReadablePacket {
    ReadablePacket::SkinFrame {
        frame: frame.sequence,
        sensor_time_ms: frame.sensor_time_ns as f64 / 1e6,
        values: frame.values().to_vec(),
    }
}

fn of_command(command: &SweepCommand) -> ReadablePacket {
    ReadablePacket::SweepCommand {
        command: match command.command() {
            Some(Command::Start) => "start",
            Some(Command::Stop) => "stop",
            Some(Command::Reset) => "reset",
            Some(Command::Enroll) => "enroll",
            Some(Command::Adapt) => "adapt",
            None => "?",
        },
        finger: command.finger,
        motion: command.motion,
        material: command.material.as_str().into(),
    }
}

fn of_belief(belief: &TactileBelief, network: Option<&ModelNames>) -> ReadablePacket {
    let names = network.map(material_names).unwrap_or_default();
    let answer = |label: u32, probabilities: &[f32], verdict: u32| MaterialPrediction {
        label,
        material: names.get(label as usize).cloned(),
        probability: probabilities.get(label as usize).copied(),
        verdict: match verdict {
            verdict if verdict == Verdict::Known as u32 => "known",
            verdict if verdict == Verdict::Unknown as u32 => "unknown",
            verdict if verdict == Verdict::NotTold as u32 => "not told",
            _ => "?",
        },
    };
    ReadablePacket::TactileBelief {
        sweep: belief.sweep,
        finger: belief.finger,
        stage: match belief.stage {
            stage if stage == Stage::Anytime as u32 => "anytime",
            stage if stage == Stage::Plain as u32 => "plain",
            stage if stage == Stage::Dropout as u32 => "dropout",
            _ => "?",
        },
        frames: belief.frames,
        sweep_frames: network.map(|network| network.steps),
        provisional: belief.stage == Stage::Anytime as u32,
        sweep_says: answer(belief.label, &belief.posterior, belief.verdict),
        object_says: (belief.fused_sweeps > 0)
            .then(|| answer(belief.fused_label, &belief.fused, belief.fused_verdict)),
        object_sweeps: belief.fused_sweeps,
        latency_ms: belief.latency_ns as f64 / 1e6,
    }
}

impl Event {
    /// Returns the event's name, as in JSON.
    ///
    /// # Example
    /// ```
    /// use tactnet_skin::packets::Event;
    ///
    /// assert_eq!(Event::ModelRejected.name(), "model rejected");
    /// ```
    pub fn name(self) -> &'static str {
        match self {
            Self::Alive => "alive",
            Self::Begun => "begun",
            Self::Classified => "classified",
            Self::Rejected => "rejected",
            Self::Reset => "reset",
            Self::Refused => "refused",
            Self::Swapped => "swapped",
            Self::ModelRejected => "model rejected",
            Self::Enrolled => "enrolled",
            Self::Unreachable => "unreachable",
            Self::Like => "like",
            Self::OtherBlock => "other block",
            Self::Unlike => "unlike",
            Self::Masked => "masked",
            Self::Adapted => "adapted",
        }
    }
}

fn of_status(status: &TactileStatus) -> ReadablePacket {
    ReadablePacket::TactileStatus {
        event: Event::of(status.event).map_or("?", Event::name),
        finger: status.finger,
        sweep: status.sweep,
        frames: status.counters.frames,
        sweeps: status.counters.sweeps,
        rejected: status.counters.rejected,
        text: status.text.as_str().into(),
    }
}

fn of_names(model: &ModelNames) -> ReadablePacket {
    ReadablePacket::ModelNames {
        version: model.version,
        sample_rate_hz: model.sample_rate_hz,
        steps: model.steps,
        rows: model.rows,
        cols: model.cols,
        materials: material_names(model),
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    #[test]
    fn every_tactile_packet_is_readable_and_no_other() {
        fn read<T: Packet>(packet: &T) -> Option<ReadablePacket> {
            ReadablePacket::new(T::NAME, T::VERSION, bytemuck::bytes_of(packet), None)
        }
        let status = TactileStatus::zeroed();
        assert!(read(&SkinFrame::zeroed()).is_some());
        assert!(read(&SweepCommand::zeroed()).is_some());
        assert!(read(&TactileBelief::zeroed()).is_some());
        assert!(read(&status).is_some());
        let model = ModelNames {
            materials: u32::MAX,
            ..ModelNames::zeroed()
        };
        assert!(read(&model).is_some());
        let bytes = bytemuck::bytes_of(&status);
        for (packet, version, bytes) in [
            ("Imu", 1, bytes),
            (TactileStatus::NAME, 99, bytes),
            (TactileStatus::NAME, TactileStatus::VERSION, &bytes[..9]),
        ] {
            assert_eq!(ReadablePacket::new(packet, version, bytes, None), None);
        }
    }
}
