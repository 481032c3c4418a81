//! Scheduling and memory for a thread that must be on time. Requests that Linux refuses are returned, and the work goes on.

use std::io;

/// Requests to the system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Realtime {
    /// Priority under `SCHED_FIFO`, 1 to 99; `None`: the usual scheduler.
    pub priority: Option<u8>,
    /// The only core for this thread; `None`: any.
    pub cpu: Option<usize>,
    /// Keep all memory of the process in RAM.
    pub lock_memory: bool,
}

impl Realtime {
    /// Asks for it for this thread (and, for memory, this process). Gives one line for everything that could not be had.
    pub fn apply(self) -> Vec<String> {
        let mut refused = Vec::new();
        let mut note = |what: &str, outcome: io::Result<()>| {
            if let Err(error) = outcome {
                refused.push(format!("{what}: {error}"));
            }
        };
        if self.lock_memory {
            // SAFETY: changes nothing but where pages are kept.
            let failed = unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) };
            note("cannot keep memory in RAM (mlockall)", done(failed));
            touch_stack();
        }
        if let Some(cpu) = self.cpu {
            note(&format!("cannot stay on core {cpu}"), stay_on(cpu));
        }
        if let Some(priority) = self.priority {
            let parameter = libc::sched_param {
                sched_priority: i32::from(priority),
            };
            // SAFETY: this thread and a valid parameter.
            let failed =
                unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameter) };
            note(
                &format!("no SCHED_FIFO with priority {priority}"),
                done(failed),
            );
        }
        refused
    }
}

fn done(failed: i32) -> io::Result<()> {
    if failed == 0 {
        Ok(())
    } else {
        Err(io::Error::last_os_error())
    }
}

fn stay_on(cpu: usize) -> io::Result<()> {
    if cpu >= libc::CPU_SETSIZE as usize {
        return Err(io::Error::from_raw_os_error(libc::EINVAL));
    }
    // SAFETY: a set of cores is plain bits; `cpu` is below its size.
    let failed = unsafe {
        let mut cores: libc::cpu_set_t = std::mem::zeroed();
        libc::CPU_SET(cpu, &mut cores);
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &raw const cores)
    };
    done(failed)
}

/// Maps the pages of the stack that the thread may come to use.
#[inline(never)]
fn touch_stack() {
    let mut pages = [0_u8; 256 * 1024];
    std::hint::black_box(&mut pages);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_had_is_said() {
        let outcome = std::thread::spawn(|| {
            Realtime {
                cpu: Some(100_000),
                ..Realtime::default()
            }
            .apply()
        });
        let refused = outcome.join().unwrap();
        assert_eq!(refused.len(), 1);
        assert!(refused[0].contains("core 100000"), "{refused:?}");
        assert!(Realtime::default().apply().is_empty());
    }
}
