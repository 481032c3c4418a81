//! Real-time scheduling and memory locking for a thread. Requests that Linux refuses are returned as text, and the
//! program continues.

use std::io;

/// Requests to the operating system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Realtime {
    /// Priority under `SCHED_FIFO`, 1 to 99; `None` keeps the default scheduler.
    pub priority: Option<u8>,
    /// The only core on which this thread runs; `None` allows any.
    pub cpu: Option<usize>,
    /// True to lock all memory of the process in RAM.
    pub lock_memory: bool,
}

impl Realtime {
    /// Applies the requests to this thread (memory locking: to the process). Returns one line for each refused request.
    pub fn apply(self) -> Vec<String> {
        let mut refused = Vec::new();
        let mut note = |what: &str, outcome: io::Result<()>| {
            if let Err(error) = outcome {
                refused.push(format!("{what}: {error}"));
            }
        };
        if self.lock_memory {
            // SAFETY: `mlockall` only changes where pages are kept.
            let failed = unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) };
            note("cannot lock memory in RAM (mlockall)", done(failed));
            touch_stack();
        }
        if let Some(cpu) = self.cpu {
            note(
                &format!("cannot pin the thread to core {cpu}"),
                stay_on(cpu),
            );
        }
        if let Some(priority) = self.priority {
            let parameter = libc::sched_param {
                sched_priority: i32::from(priority),
            };
            // SAFETY: thread 0 is the calling thread, and the parameter is valid.
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
    // SAFETY: a set of cores is plain bits, and `cpu` is below its size.
    let failed = unsafe {
        let mut cores: libc::cpu_set_t = std::mem::zeroed();
        libc::CPU_SET(cpu, &mut cores);
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &raw const cores)
    };
    done(failed)
}

/// Touches the stack pages that the thread may need, so that they are mapped.
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
