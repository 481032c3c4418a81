//! Declaration of packets in Rust.

use super::{IsField, Layout};

/// A packet, or a part of one, with a description for other languages.
pub trait Described: IsField + Copy {
    /// Memory layout.
    const LAYOUT: Layout;
}

/// Declares packets: plain little-endian data without padding, known to all languages.
///
/// Types derive `Debug`, `Clone`, `Copy`, `Pod` and `Zeroable`, and the given traits. A struct with `#[version(N)]` is
/// a [`Packet`](crate::Packet); without it, it is a part of others. `#[recorded(N)]` sets a field's number in
/// recordings, and `#[recorded(N, count)]` also names the field with the number of valid values.
///
/// ```
/// tactnet_packet::packets! {
///     /// State of a joint.
///     #[version(1)]
///     pub struct Joint {
///         /// rad
///         #[recorded(1)]
///         pub position: f64,
///         /// Nm
///         #[recorded(2)]
///         pub torque: f64,
///     }
/// }
/// use tactnet_packet::{Described, Packet};
/// assert_eq!((Joint::NAME, Joint::LAYOUT.bytes, Joint::LAYOUT.fields[1].offset), ("Joint", 16, 8));
/// ```
#[macro_export]
macro_rules! packets {
    ($(
        $(#[doc = $doc:literal])*
        $(#[derive($($derive:ident),*)])?
        $(#[version($version:literal)])?
        pub struct $name:ident {
            $(
                $(#[doc = $field_doc:literal])*
                $(#[recorded($number:literal $(, $count:ident)?)])?
                pub $field:ident: $kind:ty,
            )*
        }
    )*) => { $(
        $(#[doc = $doc])*
        #[repr(C)]
        #[derive(Debug, Clone, Copy, ::bytemuck::Pod, ::bytemuck::Zeroable $($(, $derive)*)?)]
        pub struct $name {
            $(
                $(#[doc = $field_doc])*
                pub $field: $kind,
            )*
        }

        $(
            impl $crate::Packet for $name {
                const NAME: &'static str = stringify!($name);
                const VERSION: u32 = $version;
            }
        )?

        impl $crate::IsField for $name {
            const TYPE: $crate::FieldType = $crate::FieldType::Packet(&<Self as $crate::Described>::LAYOUT);
        }

        impl $crate::Described for $name {
            const LAYOUT: $crate::Layout = $crate::Layout {
                name: stringify!($name),
                version: 0 $(+ $version)?,
                docs: &[$($doc),*],
                bytes: size_of::<Self>(),
                fields: &[$(
                    $crate::Field {
                        name: stringify!($field),
                        docs: &[$($field_doc),*],
                        offset: ::std::mem::offset_of!($name, $field),
                        kind: <$kind as $crate::IsField>::TYPE,
                        number: $crate::packets!(@first $(Some($number),)? None),
                        counted_by: $crate::packets!(@first $($(Some(stringify!($count)),)?)? None),
                    },
                )*],
            };
        }
    )* };
    (@first $first:expr $(, $rest:expr)*) => { $first };
}

/// Declares enums whose numbers are values of fields.
///
/// ```
/// tactnet_packet::choices! {
///     /// Known material or not.
///     pub enum Verdict {
///         /// No verdict yet.
///         NotTold = 0,
///         /// One of the materials.
///         Known = 1,
///     }
/// }
/// assert_eq!((Verdict::of(1), Verdict::of(7)), (Some(Verdict::Known), None));
/// ```
#[macro_export]
macro_rules! choices {
    ($(
        $(#[doc = $doc:literal])*
        pub enum $name:ident {
            $( $(#[doc = $value_doc:literal])* $value:ident = $number:literal, )*
        }
    )*) => { $(
        $(#[doc = $doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u32)]
        pub enum $name {
            $( $(#[doc = $value_doc])* $value = $number, )*
        }

        impl $name {
            /// Description for other languages.
            pub const CHOICE: $crate::Choice = $crate::Choice {
                name: stringify!($name),
                docs: &[$($doc),*],
                values: &[$( (stringify!($value), &[$($value_doc),*], $number), )*],
            };

            /// Returns the choice of a number; `None` for other numbers.
            pub fn of(number: u32) -> Option<Self> {
                match number {
                    $( $number => Some(Self::$value), )*
                    _ => None,
                }
            }
        }
    )* };
}
