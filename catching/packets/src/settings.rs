//! Settings with their default values and ranges.

/// Numbers of a setting, which a check treats alike.
pub trait Numbers {
    /// Returns the numbers.
    fn numbers(&self) -> impl Iterator<Item = f64>;
}

impl Numbers for f64 {
    fn numbers(&self) -> impl Iterator<Item = f64> {
        std::iter::once(*self)
    }
}

impl Numbers for u32 {
    fn numbers(&self) -> impl Iterator<Item = f64> {
        std::iter::once(f64::from(*self))
    }
}

impl Numbers for usize {
    fn numbers(&self) -> impl Iterator<Item = f64> {
        std::iter::once(*self as f64)
    }
}

impl<T: Numbers, const N: usize> Numbers for [T; N] {
    fn numbers(&self) -> impl Iterator<Item = f64> {
        self.iter().flat_map(Numbers::numbers)
    }
}

/// Defines a struct of settings whose fields declare their default values, and implements [`Default`] for it.
///
/// With the prefix of the settings' names and an error type, the method `check_settings` checks those fields that
/// declare a function of name and value for it.
///
/// ```
/// fn positive(name: &'static str, value: &f64) -> Result<(), &'static str> {
///     (*value > 0.0).then_some(()).ok_or(name)
/// }
///
/// tactnet_catching_packets::settings! {
///     /// Settings of a camera.
///     pub struct CameraConfig in "camera.": &'static str {
///         /// Focal length, in pixels.
///         pub focal: f64 = 1386.0 => positive,
///         /// True if the camera is used.
///         pub used: bool = true,
///     }
/// }
/// assert_eq!(CameraConfig::default().focal, 1386.0);
/// let broken = CameraConfig { focal: 0.0, ..CameraConfig::default() };
/// assert_eq!(broken.check_settings(), Err("camera.focal"));
/// ```
#[macro_export]
macro_rules! settings {
    (
        $(#[$attribute:meta])*
        $visibility:vis struct $name:ident {
            $($(#[$of_field:meta])* $field_visibility:vis $field:ident: $type:ty = $default:expr,)*
        }
    ) => {
        $(#[$attribute])*
        $visibility struct $name {
            $(
                $(#[$of_field])*
                #[doc = concat!("\n\nDefault: `", stringify!($default), "`.")]
                $field_visibility $field: $type,
            )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }
    };
    (
        $(#[$attribute:meta])*
        $visibility:vis struct $name:ident in $prefix:literal: $error:ty {
            $(
                $(#[$of_field:meta])*
                $field_visibility:vis $field:ident: $type:ty = $default:expr $(=> $check:expr)?,
            )*
        }
    ) => {
        $crate::settings! {
            $(#[$attribute])*
            $visibility struct $name {
                $($(#[$of_field])* $field_visibility $field: $type = $default,)*
            }
        }

        impl $name {
            /// Returns an error for the first setting that is out of its range.
            pub(crate) fn check_settings(&self) -> Result<(), $error> {
                $($($check(concat!($prefix, stringify!($field)), &self.$field)?;)?)*
                Ok(())
            }
        }
    };
}
