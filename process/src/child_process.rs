//! A process that is asked to end, and is never left behind.

use std::io;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus};

/// A process in a group of its own; it is killed when this is dropped, and asked to end when the thread that started it ends.
#[derive(Debug)]
pub struct ChildProcess(Child);

impl ChildProcess {
    /// Starts `command`, whose streams the caller has set.
    ///
    /// # Errors
    /// There is no such program, or the system refuses.
    pub fn start(command: &mut Command) -> io::Result<Self> {
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt;
            // Ctrl-C on a terminal is for the program that started it.
            command.process_group(0);
        }
        end_with_this_thread(command);
        command.spawn().map(Self)
    }

    /// Returns its number.
    pub fn id(&self) -> u32 {
        self.0.id()
    }

    /// Returns its status if it has ended.
    ///
    /// # Errors
    /// The system does not tell.
    pub fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        self.0.try_wait()
    }

    /// Asks it to end, with SIGTERM. Does nothing outside Unix, and nothing where it has ended.
    ///
    /// # Errors
    /// The system refuses.
    pub fn ask_to_end(&mut self) -> io::Result<()> {
        #[cfg(unix)]
        if self.ended()?.is_none() {
            // SAFETY: a system call without memory. The process is our child and has not been waited for, so its number is its own.
            if unsafe { libc::kill(self.0.id() as libc::pid_t, libc::SIGTERM) } != 0 {
                return Err(io::Error::last_os_error());
            }
        }
        Ok(())
    }

    /// Waits until it ends.
    ///
    /// # Errors
    /// The system does not tell.
    pub fn wait(&mut self) -> io::Result<ExitStatus> {
        self.0.wait()
    }

    /// Ends it at once.
    pub(crate) fn kill(&mut self) {
        // Both fail where it has ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }

    /// Takes our ends of its streams that are pipes.
    pub(crate) fn take_pipes(
        &mut self,
    ) -> (Option<ChildStdin>, Option<ChildStdout>, Option<ChildStderr>) {
        let child = &mut self.0;
        (child.stdin.take(), child.stdout.take(), child.stderr.take())
    }
}

impl Drop for ChildProcess {
    fn drop(&mut self) {
        self.kill();
    }
}

/// The process does not stay when the thread that starts it, and with it usually this program, is killed.
#[cfg(target_os = "linux")]
fn end_with_this_thread(command: &mut Command) {
    use std::os::unix::process::CommandExt;
    // SAFETY: one system call between fork and exec.
    unsafe {
        command.pre_exec(|| {
            libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM);
            Ok(())
        });
    }
}

#[cfg(not(target_os = "linux"))]
fn end_with_this_thread(_: &mut Command) {}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;

    use super::*;

    fn sleeping() -> ChildProcess {
        ChildProcess::start(Command::new("sleep").arg("60")).unwrap()
    }

    #[test]
    fn a_process_that_is_asked_ends_by_sigterm_and_may_be_asked_again() {
        let mut process = sleeping();
        assert_eq!(process.ended().unwrap(), None);
        process.ask_to_end().unwrap();
        assert_eq!(process.wait().unwrap().signal(), Some(libc::SIGTERM));
        process.ask_to_end().unwrap();
        assert!(process.ended().unwrap().is_some());
    }

    #[test]
    fn a_process_that_is_dropped_is_gone() {
        let process = sleeping();
        let number = process.0.id() as libc::pid_t;
        drop(process);
        // SAFETY: signal 0 only asks whether the process is there.
        assert_eq!(unsafe { libc::kill(number, 0) }, -1);
    }
}
