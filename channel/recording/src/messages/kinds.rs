//! Packet types that recordings can hold, known only at run time.

use std::sync::LazyLock;

use bytemuck::pod_read_unaligned;
use serde::{Serialize, Serializer};
use tactnet_channel::{Description, Fields, Layout, Packet};

use super::{Recorded, decode, encode, schema};

/// A packet type.
#[derive(Debug)]
pub(crate) struct Kind {
    pub layout: &'static Layout,
    /// Full name of its message.
    pub message: String,
    /// Schema of all messages of its description.
    pub schema: &'static [u8],
    recorded: Recorded,
}

static KINDS: LazyLock<Vec<Kind>> = LazyLock::new(|| {
    [
        &tactnet_skin::packets::DESCRIPTION,
        &tactnet_catching_packets::packets::DESCRIPTION,
    ]
    .into_iter()
    .flat_map(of)
    .collect()
});

fn of(description: &'static Description) -> Vec<Kind> {
    let schema: &[u8] = Vec::leak(schema::schema(description));
    let packets = description.packets.iter();
    packets
        .filter(|layout| layout.is_packet())
        .map(|layout| Kind {
            layout,
            message: format!("{}.{}", description.project, layout.name),
            schema,
            recorded: Recorded::of(layout),
        })
        .collect()
}

/// Returns the type of a channel's packets; `None` for packets without a description.
pub(crate) fn kind(name: &str, version: u32) -> Option<&'static Kind> {
    let is = |kind: &&Kind| kind.layout.name == name && kind.layout.version == version;
    KINDS.iter().find(is)
}

/// Returns the type of a message by its full name.
pub(crate) fn kind_of_message(name: &str) -> Option<&'static Kind> {
    KINDS.iter().find(|kind| kind.message == name)
}

impl Kind {
    /// Returns the message of a packet's bytes.
    pub(crate) fn to_message(&self, packet: &[u8]) -> Vec<u8> {
        encode::encode(&self.recorded, packet)
    }
}

/// A packet whose type is known only at run time.
#[derive(Debug, Clone)]
pub struct PlainPacket {
    kind: &'static Kind,
    bytes: Box<[u8]>,
}

impl PlainPacket {
    /// Reads the first item of a packet's bytes. Returns `None` if the bytes are too few or the type has no
    /// description.
    ///
    /// - `packet`, `version`: as in the table of channels
    pub fn new(packet: &str, version: u32, bytes: &[u8]) -> Option<Self> {
        let kind = kind(packet, version)?;
        let bytes = bytes.get(..kind.layout.bytes)?.into();
        Some(Self { kind, bytes })
    }

    /// Returns the packet of a message; `None` for bytes that are not such a message or exceed the packet.
    pub(crate) fn from_message(kind: &'static Kind, message: &[u8]) -> Option<Self> {
        let mut bytes = vec![0; kind.layout.bytes].into_boxed_slice();
        decode::decode(&kind.recorded, message, &mut bytes)?;
        Some(Self { kind, bytes })
    }

    /// Returns the packet as `T`; `None` if it has another type.
    pub fn get<T: Packet>(&self) -> Option<T> {
        let layout = self.kind.layout;
        let is = layout.name == T::NAME && layout.version == T::VERSION;
        is.then(|| pod_read_unaligned(&self.bytes))
    }

    /// Returns its fields.
    pub fn fields(&self) -> Fields<'_> {
        Fields::of(self.kind.layout, &self.bytes).expect("as many bytes as its layout says")
    }

    /// Returns its message as bytes.
    pub fn to_message(&self) -> Vec<u8> {
        self.kind.to_message(&self.bytes)
    }
}

/// Serializes an object of the fields, plus the name of the packet as `type`.
impl Serialize for PlainPacket {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Typed<'a> {
            r#type: &'static str,
            #[serde(flatten)]
            fields: Fields<'a>,
        }
        Typed {
            r#type: self.kind.layout.name,
            fields: self.fields(),
        }
        .serialize(serializer)
    }
}
