//! This program again as a process beside it, for commands that run several at once.

use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::JoinHandle;

use anyhow::{Context, bail};
use tactnet_channel::{Table, remove_bus};

/// A process that says `ready`; it is killed if this is dropped before [`ChildProcess::end`].
pub struct ChildProcess {
    name: &'static str,
    child: Child,
    /// Reads what it prints, so that it never waits for us.
    printed: Option<JoinHandle<String>>,
}

impl ChildProcess {
    /// Starts `tactnet ARGUMENTS TABLE` and waits until it is ready.
    pub fn start(name: &'static str, arguments: &[&str], table: &Path) -> anyhow::Result<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        command
            .args(arguments)
            .arg(table)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            // Ctrl-C is for us; we end it in our own time.
            .process_group(0);
        // SAFETY: one system call between fork and exec.
        unsafe {
            // Nor does it stay when we are killed.
            command.pre_exec(|| {
                libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM);
                Ok(())
            });
        }
        let mut child = command
            .spawn()
            .with_context(|| format!("cannot start the {name}"))?;
        let pipes = (child.stdout.take(), child.stderr.take());
        let mut part = Self {
            name,
            child,
            printed: None,
        };
        let (Some(out), Some(errors)) = pipes else {
            bail!("the {name} has no output");
        };
        let mut out = BufReader::new(out);
        let mut errors = BufReader::new(errors);
        let mut line = String::new();
        out.read_line(&mut line)?;
        if line != "ready\n" {
            let mut said = String::new();
            errors.read_line(&mut said)?;
            bail!("the {name} did not start: {}", said.trim());
        }
        std::thread::spawn(move || std::io::copy(&mut errors, &mut std::io::sink()));
        part.printed = Some(std::thread::spawn(move || {
            let mut printed = String::new();
            // What is no text is not ours.
            let _ = out.read_to_string(&mut printed);
            printed
        }));
        Ok(part)
    }

    /// What it is.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Its status, if it has ended by itself.
    pub fn ended(&mut self) -> anyhow::Result<Option<ExitStatus>> {
        Ok(self.child.try_wait()?)
    }

    /// Asks it to end and gives what it printed.
    pub fn end(mut self) -> anyhow::Result<String> {
        // SAFETY: the process is our child and has not been waited for, so its number is its own.
        unsafe { libc::kill(self.child.id() as libc::pid_t, libc::SIGTERM) };
        let status = self.child.wait()?;
        let printed = match self.printed.take().map(JoinHandle::join) {
            Some(Ok(printed)) => printed,
            _ => bail!("the {} printed nothing", self.name),
        };
        if !status.success() {
            bail!("the {} ended with {status}", self.name);
        }
        Ok(printed)
    }
}

impl Drop for ChildProcess {
    fn drop(&mut self) {
        // Both fail where it has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A bus whose memory is cleared at the end.
pub struct OwnBus<'a>(pub &'a Table);

impl Drop for OwnBus<'_> {
    fn drop(&mut self) {
        // Nothing depends on it.
        let _ = remove_bus(self.0);
    }
}
