//! Names that are valid in all generated languages.

use toml::Spanned;

use super::{DescriptionError, Source};

/// Spelling of a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Case {
    /// Of fields and projects: `sensor_time_ns`.
    Snake,
    /// Of structs, enums and their values: `ArmState`.
    Type,
    /// Of constants: `MAX_JOINTS`.
    Constant,
}

/// Keywords of Rust, C, C++ and Python, and names that the generated code uses.
const RESERVED: &str = "abstract alignas alignof and as asm assert async auto await become bool box break case catch char class \
    compl concept const consteval constexpr constinit continue crate def default del delete do double dyn elif else enum except \
    explicit export extern false field final finally float fn for friend from from_bytes gen global goto if impl import in inline int is \
    lambda let linux list long loop macro match mod move mut mutable namespace new noexcept nonlocal not nullptr operator or \
    override pass priv private protected pub put_ns raise received ref register reinterpret_cast requires restrict return self \
    sender short signed sizeof static static_assert str struct super switch template this thread_local throw to_bytes trait true \
    try type typedef typeid typename typeof union unix unsafe unsigned unsized use using virtual void volatile wchar_t where \
    while with xor yield \
    Any ClassVar Described Description False IntEnum None Option Packet Self Some Text True";

/// Returns an error if a name is misspelt or a keyword.
pub(super) fn check(
    source: &Source,
    name: &Spanned<String>,
    case: Case,
) -> Result<(), DescriptionError> {
    let text = name.get_ref().as_str();
    let (first, other, example): (_, fn(char) -> bool, _) = match case {
        Case::Snake => (
            'a'..='z',
            |c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_',
            "sensor_time_ns",
        ),
        Case::Type => ('A'..='Z', |c| c.is_ascii_alphanumeric(), "ArmState"),
        Case::Constant => (
            'A'..='Z',
            |c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_',
            "MAX_JOINTS",
        ),
    };
    let begins = text.starts_with(|c: char| first.contains(&c));
    if !(begins && text.chars().all(other) && text.len() <= 64) {
        let reason = format!(
            "expected a name like `{example}`, found `{}`",
            text.escape_debug()
        );
        return Err(source.error(name.span(), reason));
    }
    if RESERVED.split_whitespace().any(|reserved| reserved == text) {
        let reason = format!("`{text}` is a reserved word of a generated language");
        return Err(source.error(name.span(), reason));
    }
    Ok(())
}
