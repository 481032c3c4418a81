//! Lines on standard error.

/// Writes a line to standard error, as `eprintln!` does; one that cannot be written is no reason to end.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}
