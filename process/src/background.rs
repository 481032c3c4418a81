//! Threads that yield to all others.

/// Gives the calling thread the lowest priority of the default scheduler, also if it inherited a real-time priority.
/// It then runs in the time that other threads leave. Has no effect outside Linux.
pub fn run_in_background() {
    #[cfg(target_os = "linux")]
    {
        let parameter = libc::sched_param { sched_priority: 0 };
        // SAFETY: number 0 is the calling thread, and the parameter is valid. Every thread may lower its priority.
        unsafe {
            libc::sched_setscheduler(0, libc::SCHED_OTHER, &raw const parameter);
            libc::setpriority(libc::PRIO_PROCESS, 0, 19);
        }
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn only_the_thread_that_asks_is_lowered() {
        // SAFETY: reads the priority of the calling thread.
        let nice = || unsafe { libc::getpriority(libc::PRIO_PROCESS, 0) };
        let before = nice();
        let lowered = std::thread::spawn(move || {
            run_in_background();
            nice()
        });
        assert_eq!((lowered.join().unwrap(), nice()), (19, before));
    }
}
