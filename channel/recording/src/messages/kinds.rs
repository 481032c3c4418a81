//! Packet types that recordings can hold, known only at run time.

use std::sync::{LazyLock, PoisonError, RwLock};

use bytemuck::pod_read_unaligned;
use serde::{Serialize, Serializer};
use tactnet_channel::{Description, Fields, Layout, Packet};
use tactnet_skin::packets::ModelNames;

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

static KINDS: LazyLock<RwLock<Vec<&'static Kind>>> = LazyLock::new(|| {
    let known = [
        tactnet_skin::packets::DESCRIPTION,
        tactnet_catching_packets::packets::DESCRIPTION,
    ];
    RwLock::new(known.iter().flat_map(of).collect())
});

fn of(description: &Description) -> Vec<&'static Kind> {
    let schema: &[u8] = Vec::leak(schema::schema(description));
    let packets = description.packets.iter();
    packets
        .filter(|layout| layout.is_packet())
        .map(|layout| -> &'static Kind {
            Box::leak(Box::new(Kind {
                layout,
                message: format!("{}.{}", description.project, layout.name),
                schema,
                recorded: Recorded::of(layout),
            }))
        })
        .collect()
}

/// Adds packet types for this process: recorders record them and readers of recordings return them.
///
/// Types that are built in have precedence over types of the same name and version.
pub fn add_packet_types(description: &Description) {
    let mut kinds = KINDS.write().unwrap_or_else(PoisonError::into_inner);
    kinds.extend(of(description));
}

fn find(is: impl Fn(&Kind) -> bool) -> Option<&'static Kind> {
    let kinds = KINDS.read().unwrap_or_else(PoisonError::into_inner);
    kinds.iter().copied().find(|kind| is(kind))
}

/// Returns the type of a channel's packets; `None` for packets without a description.
pub(crate) fn kind(name: &str, version: u32) -> Option<&'static Kind> {
    find(|kind| kind.layout.name == name && kind.layout.version == version)
}

/// Returns the type of a message by its full name.
pub(crate) fn kind_of_message(name: &str) -> Option<&'static Kind> {
    find(|kind| kind.message == name)
}

impl Kind {
    /// Returns true for the names of a classifier's materials. It puts them once, when it starts, and they are needed
    /// to read its beliefs.
    pub(crate) fn is_needed_to_read_others(&self) -> bool {
        self.layout.name == ModelNames::NAME
    }

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
