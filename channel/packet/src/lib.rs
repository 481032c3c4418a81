//! Packets: plain little-endian data without padding, declared once, in Rust.
//!
//! [`packets!`] declares packets and keeps their [`Layout`]. A [`Description`] turns it into C and C++ headers, Python
//! dataclasses, Protocol Buffers and a page of tables; [`Fields`] turns any packet into JSON.
//!
//! This crate has neither transport nor clock: programs that only fill in or read packets need nothing else.

mod description;
mod fields;
mod packet;
mod text;

pub use description::{Choice, Described, Description, Field, FieldType, IsField, Layout};
pub use fields::Fields;
pub use packet::Packet;
pub use text::Text;
