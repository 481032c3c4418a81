//! Messages on standard error.

/// Writes a line to standard error, as `eprintln!` does, but ignores write errors.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}
