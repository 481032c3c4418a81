//! Packets: plain little-endian data without padding, described once, in Rust. [`packets!`] declares them and keeps their [`Layout`];
//! from that come headers of C and C++, dataclasses of Python, Protocol Buffers, a page ([`Description`]), and any packet's fields as
//! JSON ([`Fields`]).
//!
//! No transport and no clock: whoever only fills in or reads packets needs nothing else.

mod description;
mod fields;
mod packet;
mod text;

pub use description::{Choice, Described, Description, Field, FieldType, IsField, Layout};
pub use fields::Fields;
pub use packet::Packet;
pub use text::Text;
