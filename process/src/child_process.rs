//! Child processes that end with their owner.

use std::io;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus};

/// Process in a separate process group. It is killed when the value is dropped, and gets SIGTERM when the thread that
/// started it ends.
#[derive(Debug)]
pub struct ChildProcess(Child);

impl ChildProcess {
    /// Starts `command`, whose streams the caller has set.
    ///
    /// # Errors
    /// A program that is missing or cannot be started.
    pub fn start(command: &mut Command) -> io::Result<Self> {
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt;
            // Ctrl-C on a terminal reaches only the program that started the process.
            command.process_group(0);
        }
        end_with_this_thread(command);
        command.spawn().map(Self)
    }

    /// Returns the process id.
    pub fn id(&self) -> u32 {
        self.0.id()
    }

    /// Returns the exit status if the process has ended.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        self.0.try_wait()
    }

    /// Sends SIGTERM. Does nothing outside Unix, or if the process has ended.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn ask_to_end(&mut self) -> io::Result<()> {
        #[cfg(unix)]
        if self.ended()?.is_none() {
            // SAFETY: a system call without memory. The process is our child and was not waited for, so its id is not
            // reused.
            if unsafe { libc::kill(self.0.id() as libc::pid_t, libc::SIGTERM) } != 0 {
                return Err(io::Error::last_os_error());
            }
        }
        Ok(())
    }

    /// Waits until the process ends.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn wait(&mut self) -> io::Result<ExitStatus> {
        self.0.wait()
    }

    /// Kills the process.
    pub(crate) fn kill(&mut self) {
        // Both calls fail if the process has ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }

    /// Takes the pipes of its streams.
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

/// Makes the process end when the thread that starts it, and usually with it this program, is killed.
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
        // SAFETY: signal 0 only checks that the process exists.
        assert_eq!(unsafe { libc::kill(number, 0) }, -1);
    }
}
