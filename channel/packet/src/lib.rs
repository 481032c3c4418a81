//! Packets: plain little-endian data without padding, declared once, in Rust or in a TOML file.
//!
//! [`packets!`] declares packets and keeps their [`Layout`]; `Description::read` reads it from a file (feature `file`). A
//! [`Description`] turns it into Rust, C and C++ headers, Python dataclasses, Protocol Buffers and a page of tables;
//! [`Fields`] turns any packet into JSON.
//!
//! This crate has neither transport nor clock: programs that only fill in or read packets need nothing else.

mod description;
#[cfg(feature = "file")]
mod description_file;
mod fields;
mod packet;
mod text;

pub use description::{Choice, Described, Description, Field, FieldType, IsField, Layout};
#[cfg(feature = "file")]
pub use description_file::DescriptionError;
pub use fields::Fields;
pub use packet::Packet;
pub use text::Text;
