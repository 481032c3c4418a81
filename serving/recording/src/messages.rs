//! Packets as Protocol Buffers messages, and back.

use prost::Message;
use tactnet_channel::Packet;
use tactnet_skin::packets::{
    Counters, ModelNames, SkinFrame, SweepCommand, TactileBelief, TactileStatus, Text,
};

/// As compiled from `proto/tactnet.proto`.
#[allow(missing_docs)]
pub mod proto {
    include!(concat!(env!("OUT_DIR"), "/tactnet.rs"));
}

/// A `FileDescriptorSet` of all messages, as MCAP schemas of encoding `protobuf` hold it.
pub const DESCRIPTION: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/tactnet.description"));

/// A packet that can be recorded.
pub trait Recordable: Packet + Copy {
    /// Full name of its message.
    const MESSAGE: &'static str;

    /// Its message as bytes.
    fn to_message(&self) -> Vec<u8>;

    /// The packet of a message; `None` for bytes that are none, or hold more than a packet can.
    fn from_message(bytes: &[u8]) -> Option<Self>;
}

/// `values` in the beginning of an array whose rest is zero.
fn filled<T: Copy + Default, const N: usize>(values: &[T]) -> Option<[T; N]> {
    let mut array = [T::default(); N];
    array.get_mut(..values.len())?.copy_from_slice(values);
    Some(array)
}

fn text<const N: usize>(text: &str) -> Option<Text<N>> {
    (text.len() <= N).then(|| Text::new(text))
}

impl Recordable for SkinFrame {
    const MESSAGE: &'static str = "tactnet.SkinFrame";

    fn to_message(&self) -> Vec<u8> {
        proto::SkinFrame {
            sequence: self.sequence,
            sensor_time_ns: self.sensor_time_ns,
            digits: self.values().to_vec(),
        }
        .encode_to_vec()
    }

    fn from_message(bytes: &[u8]) -> Option<Self> {
        let message = proto::SkinFrame::decode(bytes).ok()?;
        Some(Self {
            sequence: message.sequence,
            sensor_time_ns: message.sensor_time_ns,
            taxels: message.digits.len() as u32,
            reserved: 0,
            digits: filled(&message.digits)?,
        })
    }
}

impl Recordable for SweepCommand {
    const MESSAGE: &'static str = "tactnet.SweepCommand";

    fn to_message(&self) -> Vec<u8> {
        proto::SweepCommand {
            kind: self.kind,
            finger: self.finger,
            motion: self.motion,
            sweeps: self.sweeps,
            material: self.material.as_str().into(),
        }
        .encode_to_vec()
    }

    fn from_message(bytes: &[u8]) -> Option<Self> {
        let message = proto::SweepCommand::decode(bytes).ok()?;
        Some(Self {
            kind: message.kind,
            finger: message.finger,
            motion: message.motion,
            sweeps: message.sweeps,
            reserved: 0,
            material: text(&message.material)?,
        })
    }
}

impl Recordable for TactileBelief {
    const MESSAGE: &'static str = "tactnet.TactileBelief";

    fn to_message(&self) -> Vec<u8> {
        let materials = (self.materials as usize).min(self.posterior.len());
        proto::TactileBelief {
            sweep: self.sweep,
            motion: self.motion,
            model_version: self.model_version,
            last_frame: self.last_frame,
            latency_ns: self.latency_ns,
            stage: self.stage,
            finger: self.finger,
            frames: self.frames,
            filled_in: self.filled_in,
            label: self.label,
            verdict: self.verdict,
            entropy: self.entropy,
            strangeness: self.strangeness,
            threshold: self.threshold,
            fused_sweeps: self.fused_sweeps,
            fused_label: self.fused_label,
            fused_entropy: self.fused_entropy,
            posterior: self.posterior[..materials].to_vec(),
            fused: self.fused[..materials].to_vec(),
            fused_verdict: self.fused_verdict,
        }
        .encode_to_vec()
    }

    fn from_message(bytes: &[u8]) -> Option<Self> {
        let message = proto::TactileBelief::decode(bytes).ok()?;
        Some(Self {
            sweep: message.sweep,
            motion: message.motion,
            model_version: message.model_version,
            last_frame: message.last_frame,
            latency_ns: message.latency_ns,
            stage: message.stage,
            finger: message.finger,
            frames: message.frames,
            filled_in: message.filled_in,
            materials: message.posterior.len() as u32,
            label: message.label,
            verdict: message.verdict,
            entropy: message.entropy,
            strangeness: message.strangeness,
            threshold: message.threshold,
            fused_sweeps: message.fused_sweeps,
            fused_label: message.fused_label,
            fused_entropy: message.fused_entropy,
            fused_verdict: message.fused_verdict,
            posterior: filled(&message.posterior)?,
            fused: filled(&message.fused)?,
            reserved_end: [0; 3],
        })
    }
}

impl Recordable for TactileStatus {
    const MESSAGE: &'static str = "tactnet.TactileStatus";

    fn to_message(&self) -> Vec<u8> {
        let counters = self.counters;
        proto::TactileStatus {
            event: self.event,
            finger: self.finger,
            sweep: self.sweep,
            motion: self.motion,
            model_version: self.model_version,
            text: self.text.as_str().into(),
            frames: counters.frames,
            dropped_frames: counters.dropped_frames,
            beliefs: counters.beliefs,
            sweeps: counters.sweeps,
            rejected: counters.rejected,
            unknown: counters.unknown,
            deadline_misses: counters.deadline_misses,
            worst_delay_ns: counters.worst_delay_ns,
            allocations: counters.allocations,
        }
        .encode_to_vec()
    }

    fn from_message(bytes: &[u8]) -> Option<Self> {
        let message = proto::TactileStatus::decode(bytes).ok()?;
        Some(Self {
            event: message.event,
            finger: message.finger,
            sweep: message.sweep,
            motion: message.motion,
            model_version: message.model_version,
            counters: Counters {
                frames: message.frames,
                dropped_frames: message.dropped_frames,
                beliefs: message.beliefs,
                sweeps: message.sweeps,
                rejected: message.rejected,
                unknown: message.unknown,
                deadline_misses: message.deadline_misses,
                worst_delay_ns: message.worst_delay_ns,
                allocations: message.allocations,
            },
            text: text(&message.text)?,
        })
    }
}

impl Recordable for ModelNames {
    const MESSAGE: &'static str = "tactnet.ModelNames";

    fn to_message(&self) -> Vec<u8> {
        let materials = (self.materials as usize).min(self.names.len());
        proto::ModelNames {
            version: self.version,
            sample_rate_hz: self.sample_rate_hz,
            steps: self.steps,
            rows: self.rows,
            cols: self.cols,
            mc_samples: self.mc_samples,
            materials: self.names[..materials]
                .iter()
                .map(|name| name.as_str().into())
                .collect(),
        }
        .encode_to_vec()
    }

    fn from_message(bytes: &[u8]) -> Option<Self> {
        let message = proto::ModelNames::decode(bytes).ok()?;
        let names = message.materials.iter().map(|name| text(name));
        Some(Self {
            version: message.version,
            sample_rate_hz: message.sample_rate_hz,
            steps: message.steps,
            rows: message.rows,
            cols: message.cols,
            mc_samples: message.mc_samples,
            materials: message.materials.len() as u32,
            reserved: 0,
            names: filled(&names.collect::<Option<Vec<_>>>()?)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::{Zeroable, bytes_of};

    use tactnet_skin::packets::MAX_TAXELS;

    use super::*;

    /// Whatever a packet holds comes back, bit by bit.
    fn comes_back<T: Recordable>(packet: T) {
        let message = packet.to_message();
        let back = T::from_message(&message).unwrap();
        assert_eq!(bytes_of(&packet), bytes_of(&back), "{}", T::MESSAGE);
        assert!(T::from_message(&message[..message.len() - 1]).is_none());
    }

    #[test]
    fn packets_survive_bit_by_bit() {
        let mut frame = SkinFrame::zeroed();
        frame.sequence = u64::MAX;
        frame.taxels = 3;
        frame.digits[..3].copy_from_slice(&[f32::MIN_POSITIVE, -0.0, f32::from_bits(0x7fc0_1234)]);
        comes_back(frame);
        let mut command = SweepCommand::zeroed();
        command.kind = 4;
        command.material = Text::new("grüner Filz");
        comes_back(command);
        let mut belief = TactileBelief::zeroed();
        belief.materials = 2;
        belief.posterior[..2].copy_from_slice(&[0.25, 0.75]);
        belief.fused[..2].copy_from_slice(&[1e-30, 1.0]);
        belief.latency_ns = 1;
        comes_back(belief);
        let mut status = TactileStatus::zeroed();
        status.counters.allocations = 7;
        status.text = Text::new("one line");
        comes_back(status);
        let mut names = ModelNames::zeroed();
        names.sample_rate_hz = 750.0;
        names.materials = 2;
        names.names[0] = Text::new("felt");
        names.names[1] = Text::new("cork");
        comes_back(names);
    }

    #[test]
    fn more_than_a_packet_holds_is_no_packet() {
        let long = proto::SkinFrame {
            digits: vec![0.0; MAX_TAXELS + 1],
            ..Default::default()
        };
        assert!(SkinFrame::from_message(&long.encode_to_vec()).is_none());
        let long = proto::SweepCommand {
            material: "x".repeat(57),
            ..Default::default()
        };
        assert!(SweepCommand::from_message(&long.encode_to_vec()).is_none());
    }
}
