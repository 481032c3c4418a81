//! Work on memory that a faulty client may have overwritten, in a child process that may crash.

use std::time::{Duration, Instant};

/// Interval at which the parent looks for the end of the child.
const LOOK: Duration = Duration::from_millis(1);

/// Outcome of work in a child process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Work {
    Done,
    Failed,
    /// The child crashed, or took too long and was killed.
    Crashed,
}

/// Runs `work` in a copy of this process, for `most` at most. It returns false if it fails.
///
/// Only what it does to files and shared memory lasts. A lock that another thread held stays locked in the copy, which
/// then takes too long.
pub(crate) fn in_child(most: Duration, work: impl FnOnce() -> bool) -> Work {
    // SAFETY: the child runs `work` and ends at once, without destructors of the parent's values.
    let child = unsafe { libc::fork() };
    match child {
        // Without a process, nothing is done.
        ..0 => Work::Failed,
        0 => {
            let worked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
            // SAFETY: ends this process.
            unsafe {
                match worked {
                    Ok(worked) => libc::_exit(i32::from(!worked)),
                    Err(_) => libc::abort(),
                }
            }
        }
        child => {
            let deadline = Instant::now() + most;
            let mut status = 0;
            loop {
                // SAFETY: a child of this process.
                match unsafe { libc::waitpid(child, &raw mut status, libc::WNOHANG) } {
                    0 if Instant::now() < deadline => std::thread::sleep(LOOK),
                    0 => {
                        // SAFETY: no other thread waits for it, so its number is not used again.
                        unsafe {
                            libc::kill(child, libc::SIGKILL);
                            libc::waitpid(child, &raw mut status, 0);
                        }
                        return Work::Crashed;
                    }
                    // Another part of this process has waited for it.
                    ..0 => return Work::Failed,
                    _ => break,
                }
            }
            match (libc::WIFEXITED(status), libc::WEXITSTATUS(status)) {
                (true, 0) => Work::Done,
                (true, _) => Work::Failed,
                (false, _) => Work::Crashed,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crashes_and_hangs_of_the_child_are_told_from_failures() {
        let soon = Duration::from_secs(10);
        assert_eq!(in_child(soon, || true), Work::Done);
        assert_eq!(in_child(soon, || false), Work::Failed);
        assert_eq!(in_child(soon, || std::process::abort()), Work::Crashed);
        let begun = Instant::now();
        let forever = || loop {
            std::thread::sleep(soon);
        };
        assert_eq!(in_child(Duration::from_millis(20), forever), Work::Crashed);
        assert!(begun.elapsed() < soon);
    }
}
