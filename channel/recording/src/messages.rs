//! Conversion between packets and Protocol Buffers messages, by the description of their fields.

mod decode;
mod encode;
mod kinds;
mod schema;

use std::sync::LazyLock;

use bytemuck::{Pod, Zeroable, bytes_of, bytes_of_mut};
use tactnet_channel::{Described, Field, FieldType, Layout, Packet};
use tactnet_skin::packets::{ModelNames, SkinFrame, SweepCommand, TactileBelief, TactileStatus};

pub(crate) use kinds::{Kind, kind, kind_of_message};
pub use kinds::{PlainPacket, add_packet_types};

/// A packet that can be recorded.
pub trait Recordable: Packet + Described + Pod + Zeroable {
    /// Full name of its message.
    const MESSAGE: &'static str;

    /// Returns its fields, ordered by number.
    #[doc(hidden)]
    fn fields() -> &'static Recorded;

    /// Returns its message as bytes.
    fn to_message(&self) -> Vec<u8> {
        encode::encode(Self::fields(), bytes_of(self))
    }

    /// Returns the packet of a message; `None` for bytes that are not such a message or exceed the packet.
    fn from_message(bytes: &[u8]) -> Option<Self> {
        let mut packet = Self::zeroed();
        decode::decode(Self::fields(), bytes, bytes_of_mut(&mut packet))?;
        Some(packet)
    }
}

/// Recorded fields of a packet.
#[derive(Debug)]
pub struct Recorded {
    /// Fields, ordered by number.
    fields: Vec<RecordedField>,
    /// Offsets of the counts of valid values, and the index of the field that each count belongs to.
    counts: Vec<(usize, usize)>,
}

#[derive(Debug)]
struct RecordedField {
    number: u32,
    offset: usize,
    /// Type of one value.
    kind: FieldType,
    /// Recorded fields of the values, if these are messages themselves.
    part: Option<Recorded>,
    /// Number of values; `None` for a field that is not an array.
    most: Option<usize>,
    /// Offset of the number of valid values, in units of `unit` values.
    count: Option<usize>,
    unit: usize,
}

impl Recorded {
    pub(crate) fn of(layout: &Layout) -> Self {
        let offset_of = |name: &str| {
            let named = |field: &&Field| field.name == name;
            let found = layout.fields.iter().find(named);
            found.expect("the count is a field").offset
        };
        let fields: Vec<RecordedField> = layout
            .recorded()
            .into_iter()
            .map(|(number, offset, field)| {
                let (mut kind, mut most, mut unit) = (field.kind, None, 1);
                while let FieldType::Array(of, length) = kind {
                    unit = most.map_or(1, |_| unit * length);
                    most = Some(most.unwrap_or(1) * length);
                    kind = *of;
                }
                RecordedField {
                    number,
                    offset,
                    kind,
                    part: kind.part().map(Self::of),
                    most,
                    count: field.counted_by.map(offset_of),
                    unit,
                }
            })
            .collect();
        let mut counts: Vec<(usize, usize)> = Vec::new();
        for (at, field) in fields.iter().enumerate() {
            if let Some(count) = field.count
                && counts.iter().all(|(known, _)| *known != count)
            {
                counts.push((count, at));
            }
        }
        Self { fields, counts }
    }
}

macro_rules! recordable {
    ($($packet:ident)*) => { $(
        impl Recordable for $packet {
            const MESSAGE: &'static str = concat!("tactnet.", stringify!($packet));

            fn fields() -> &'static Recorded {
                static FIELDS: LazyLock<Recorded> = LazyLock::new(|| Recorded::of(&<$packet>::LAYOUT));
                &FIELDS
            }
        }
    )* };
}
recordable!(SkinFrame SweepCommand TactileBelief TactileStatus ModelNames);

#[cfg(test)]
mod tests {
    use tactnet_skin::packets::{MAX_TAXELS, Text};

    use super::*;

    /// Asserts that a packet survives the conversion bit by bit.
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
        belief.entropy = -0.0;
        comes_back(belief);
        let mut status = TactileStatus::zeroed();
        status.counters.allocations = 7;
        status.text = Text::new("one line");
        comes_back(status);
        let mut names = ModelNames::zeroed();
        names.sample_rate_hz = 750.0;
        names.materials = 3;
        names.names[0] = Text::new("felt");
        names.names[2] = Text::new("cork");
        comes_back(names);
    }

    #[test]
    fn packets_within_packets_survive_bit_by_bit() {
        use tactnet_catching_packets::packets::{
            BallPredictions, CatchStatus, ControllerState, HeadPose, PlanResult,
        };
        fn comes_back<T: Packet>(packet: &T, bytes: usize) {
            let plain = PlainPacket::new(T::NAME, T::VERSION, bytes_of(packet)).unwrap();
            let message = plain.to_message();
            let kind = kind_of_message(&format!("tactnet_catching.{}", T::NAME)).unwrap();
            let back = PlainPacket::from_message(kind, &message).unwrap();
            assert_eq!(bytes_of(packet), bytes_of(&back.get::<T>().unwrap()));
            assert!(back.get::<SkinFrame>().is_none());
            assert_eq!(message.len(), bytes, "{}", T::NAME);
            assert!(PlainPacket::from_message(kind, &message[..message.len() - 1]).is_none());
        }
        let mut pose = HeadPose::zeroed();
        pose.covariance[3][4] = -0.0;
        pose.covariance[14][14] = 1e-300;
        // Key and length of each list, and its values; the number zero is omitted.
        comes_back(&pose, 4 * (2 + 24) + (2 + 32) + (3 + 8 * 225));
        let mut balls = BallPredictions::zeroed();
        (balls.exposure_ns, balls.count) = (1, 1);
        balls.balls[0].covariance[9][0] = f64::from_bits(0x7ff8_0000_dead_beef);
        balls.balls[0].frames = u32::MAX;
        // Only the first of two balls is valid.
        let ball = 2 * (2 + 24) + (2 + 24) + (3 + 800) + 6;
        comes_back(&balls, 2 + 3 + ball);
        let mut answer = PlanResult::zeroed();
        answer.request.last_q[6] = 0.25;
        answer.ramps[6].end = 0.5;
        // The last is that of the other arm, whose number takes two bytes.
        let asked = 3 * (2 + 56) + 2 + 3 * (2 + 24) + 7 * 3;
        comes_back(&answer, 3 + asked + (2 + 56) + 6 * 2 + (2 + 9));
        let mut state = ControllerState::zeroed();
        state.reason = Text::new("stuck");
        state.paths[1].ramps[2].t2 = 1.0;
        comes_back(&state, (2 + 5) + (2 + 7 * 2) + (2 + 6 * 2 + 2 + 9));
        let mut status = CatchStatus::zeroed();
        status.phase = 8;
        comes_back(&status, 2);
    }

    /// A damaged file can make a list longer than its packet, and can cut a packet within it.
    #[test]
    fn a_packet_within_that_is_too_long_is_none() {
        use tactnet_catching_packets::packets::Gaze;
        let kind = kind_of_message("tactnet_catching.Gaze").unwrap();
        // `flights` is field 2; an empty flight.
        let flights = |count: usize| [0x12, 0].repeat(count);
        let gaze = PlainPacket::from_message(kind, &flights(2)).unwrap();
        assert_eq!(gaze.get::<Gaze>().unwrap().count, 2);
        assert!(PlainPacket::from_message(kind, &flights(3)).is_none());
        assert!(PlainPacket::from_message(kind, &[0x12, 3, 0x08]).is_none());
        assert!(PlainPacket::from_message(kind, &[0x12, 1, 0x08]).is_none());
    }

    /// Recordings of earlier versions, written by prost-build's code, stay readable, and new ones have the same bytes.
    #[test]
    fn messages_are_those_of_former_versions() {
        let mut belief = TactileBelief::zeroed();
        (belief.sweep, belief.stage, belief.materials) = (300, 3, 2);
        (belief.entropy, belief.fused_verdict) = (0.5, 1);
        belief.posterior[..2].copy_from_slice(&[0.25, 0.75]);
        belief.fused[..2].copy_from_slice(&[0.5, 0.5]);
        let bytes = [
            0x08, 0xac, 0x02, 0x30, 0x03, 0x65, 0, 0, 0, 0x3f, 0x92, 0x01, 8, 0, 0, 0x80, 0x3e, 0,
            0, 0x40, 0x3f, 0x9a, 0x01, 8, 0, 0, 0, 0x3f, 0, 0, 0, 0x3f, 0xa0, 0x01, 1,
        ];
        assert_eq!(belief.to_message(), bytes);
        let mut names = ModelNames::zeroed();
        (names.version, names.sample_rate_hz, names.materials) = (1, 750.0, 1);
        names.names[0] = Text::new("felt");
        let bytes = [
            8, 1, 0x11, 0, 0, 0, 0, 0, 0x70, 0x87, 0x40, 0x3a, 4, b'f', b'e', b'l', b't',
        ];
        assert_eq!(names.to_message(), bytes);
    }

    /// A text that begins with zero is recorded like an empty text (regression test of an attack).
    #[test]
    fn a_text_that_begins_with_zero_is_empty() {
        let command = SweepCommand::from_message(&[0x2a, 3, 0, 0xc3, 0xbc]).unwrap();
        assert!(command.to_message().is_empty());
        let names = ModelNames::from_message(&[0x3a, 2, 0, b'x', 0x3a, 1, b'y']).unwrap();
        assert_eq!(names.to_message(), [0x3a, 0, 0x3a, 1, b'y']);
    }

    #[test]
    fn more_than_a_packet_holds_is_no_packet() {
        let most = 4 * MAX_TAXELS;
        let message = |floats: usize| {
            let mut message = vec![0x1a];
            prost::encoding::encode_varint(4 * floats as u64, &mut message);
            message.resize(message.len() + 4 * floats, 0);
            message
        };
        assert!(SkinFrame::from_message(&message(MAX_TAXELS)).is_some());
        assert!(SkinFrame::from_message(&message(MAX_TAXELS + 1)).is_none());
        // Both in one list and value by value.
        let twice = [message(MAX_TAXELS), message(1)].concat();
        assert!(SkinFrame::from_message(&twice).is_none());
        let mut single = vec![0x1d, 0, 0, 0x80, 0x3f];
        assert_eq!(SkinFrame::from_message(&single).unwrap().values(), [1.0]);
        single.extend(message(most / 4));
        assert!(SkinFrame::from_message(&single).is_none());
        let text = |bytes: usize| [vec![0x2a, bytes as u8], vec![b'x'; bytes]].concat();
        assert!(SweepCommand::from_message(&text(56)).is_some());
        assert!(SweepCommand::from_message(&text(57)).is_none());
        assert!(SweepCommand::from_message(&[0x2a, 1, 0xff]).is_none());
    }

    #[test]
    fn fields_of_later_versions_are_skipped() {
        // Field 100: a number, a text, four and eight bytes.
        let later = [
            0xa0, 0x06, 5, 0xa2, 0x06, 1, b'x', 0xa5, 0x06, 1, 2, 3, 4, 0xa1, 0x06, 1, 2, 3, 4, 5,
            6, 7, 8,
        ];
        let command = SweepCommand::from_message(&[&[0x08, 2], later.as_slice()].concat());
        assert_eq!(command.unwrap().kind, 2);
    }
}
