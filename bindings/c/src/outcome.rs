//! Results of functions and error texts.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use tactnet_channel::ChannelError;

/// Result of a function; `tactnet_last_error` returns the text of an error.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Success.
    Ok = 0,
    /// No packet arrived in time.
    Timeout = 1,
    /// An argument is null, not UTF-8, or already released.
    Argument = 2,
    /// The table cannot be read or is wrong.
    Table = 3,
    /// The table has no such channel, or a new one exists already.
    Channel = 4,
    /// No hub of this bus runs on this host.
    NoHub = 5,
    /// The channel has another packet type.
    Type = 6,
    /// All ports of the channel are taken.
    Full = 7,
    /// The packet has more items than the channel allows, or the channel keeps less history than requested.
    TooLarge = 8,
    /// Too many packets are on loan or held at this port.
    Held = 9,
    /// Not enough shared memory.
    Memory = 10,
    /// The operating system refused an operation.
    System = 11,
    /// A defect of the library; the text names the place.
    Internal = 12,
}

/// An error with its text.
pub(crate) struct Failure(Outcome, String);

impl Failure {
    pub(crate) fn argument(text: impl Into<String>) -> Self {
        Self(Outcome::Argument, text.into())
    }

    pub(crate) fn table(error: ChannelError) -> Self {
        Self(Outcome::Table, error.to_string())
    }
}

impl From<ChannelError> for Failure {
    fn from(error: ChannelError) -> Self {
        let outcome = match &error {
            ChannelError::Id { .. }
            | ChannelError::NoSuchChannel { .. }
            | ChannelError::ChannelExists { .. } => Outcome::Channel,
            ChannelError::Table { .. } => Outcome::Table,
            ChannelError::NoHub { .. } => Outcome::NoHub,
            ChannelError::Type { .. } => Outcome::Type,
            ChannelError::TooManyPorts { .. } => Outcome::Full,
            ChannelError::TooLarge { .. } | ChannelError::History { .. } => Outcome::TooLarge,
            ChannelError::Held { .. } => Outcome::Held,
            ChannelError::Memory { .. } => Outcome::Memory,
            ChannelError::EmptyGroup | ChannelError::MixedGroup { .. } => Outcome::Argument,
            _ => Outcome::System,
        };
        Self(outcome, error.to_string())
    }
}

thread_local! {
    static LAST: RefCell<Option<CString>> = const { RefCell::new(None) };
}

fn remember(text: String) {
    let text = CString::new(text.replace('\0', " ")).ok();
    LAST.with_borrow_mut(|last| *last = text);
}

/// Runs `run` and keeps the text of its error for this thread.
pub(crate) fn outcome(run: impl FnOnce() -> Result<Outcome, Failure>) -> Outcome {
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(outcome)) => outcome,
        Ok(Err(Failure(outcome, text))) => {
            remember(text);
            outcome
        }
        Err(_) => {
            remember("the library panicked; its message is on standard error".into());
            Outcome::Internal
        }
    }
}

/// Returns a text of C.
///
/// # Safety
/// Null, or a text that ends with a zero.
pub(crate) unsafe fn text<'a>(what: &str, text: *const c_char) -> Result<&'a str, Failure> {
    if text.is_null() {
        return Err(Failure::argument(format!("{what} is null")));
    }
    // SAFETY: by the caller.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str()
        .map_err(|_| Failure::argument(format!("{what} is not UTF-8")))
}

/// Returns the target of a C pointer.
///
/// # Safety
/// Null, or valid without another writer.
pub(crate) unsafe fn reference<'a, T>(what: &str, pointer: *const T) -> Result<&'a T, Failure> {
    // SAFETY: by the caller.
    unsafe { pointer.as_ref() }.ok_or_else(|| Failure::argument(format!("{what} is null")))
}

/// Returns the target of a C pointer, for writing.
///
/// # Safety
/// Null, or valid without another user.
pub(crate) unsafe fn exclusive<'a, T>(what: &str, pointer: *mut T) -> Result<&'a mut T, Failure> {
    // SAFETY: by the caller.
    unsafe { pointer.as_mut() }.ok_or_else(|| Failure::argument(format!("{what} is null")))
}

/// Frees a boxed value; null is ignored.
///
/// # Safety
/// Null, or from a box without another user.
pub(crate) unsafe fn close<T>(pointer: *mut T) {
    if !pointer.is_null() {
        // SAFETY: by the caller.
        drop(unsafe { Box::from_raw(pointer) });
    }
}

/// Returns the text of this thread's last error: one line of UTF-8, empty before the first error. It is valid until
/// the next error.
#[unsafe(no_mangle)]
pub extern "C" fn tactnet_last_error() -> *const c_char {
    LAST.with_borrow(|last| last.as_ref().map_or(c"".as_ptr(), |text| text.as_ptr()))
}
