//! The description in Rust.

use super::{IsField, Layout};

/// A packet, or a part of one, whose fields are known to other languages.
pub trait Described: IsField + Copy {
    /// How it lies in memory.
    const LAYOUT: Layout;
}

/// Declares packets: plain little-endian data without padding, known to all languages.
///
/// Types derive `Debug`, `Clone`, `Copy`, `Pod` and `Zeroable`, and whatever else is asked for; a struct with `#[version(N)]` is a [`Packet`](crate::Packet), one without it is a part of others.
/// `#[recorded(N)]` gives a field its number in recordings, `#[recorded(N, count)]` says which field holds the number of valid values.
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

/// Declares enums of numbers that fields hold.
///
/// ```
/// tactnet_packet::choices! {
///     /// Known material or not.
///     pub enum Verdict {
///         /// Not yet.
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
            /// The description for other languages.
            pub const CHOICE: $crate::Choice = $crate::Choice {
                name: stringify!($name),
                docs: &[$($doc),*],
                values: &[$( (stringify!($value), &[$($value_doc),*], $number), )*],
            };

            /// Returns the choice of a number; `None` for a number that is none.
            pub fn of(number: u32) -> Option<Self> {
                match number {
                    $( $number => Some(Self::$value), )*
                    _ => None,
                }
            }
        }
    )* };
}
