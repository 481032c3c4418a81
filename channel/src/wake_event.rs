//! Wake-up of getters by putters: a counter in shared memory and the kernel's futex (the condition variable of thesis
//! section 2.3).
//!
//! A putter increments the counter after every packet and makes a system call only if a getter sleeps. A getter reads
//! the counter, checks for packets, and sleeps only while the counter is unchanged, so no wake-up is lost. A sync
//! group sleeps on up to 128 counters at once (`futex_waitv`, Linux 5.16). Larger groups sleep on one counter of the
//! bus, which putters increment only while such a group waits.

use std::fs::{File, OpenOptions};
use std::os::fd::AsRawFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use crate::ChannelError;
use crate::memory_failure::{file_error, reserve};
use crate::own_file::own_file;

/// Maximum number of counters that one system call can wait for (`FUTEX_WAITV_MAX`).
pub(crate) const MAX_AT_ONCE: usize = 128;
const FUTEX2_SIZE_U32: u32 = 2;
/// Size of a wake event's file, in bytes: one page.
const FILE_BYTES: usize = 4096;

/// Content of the shared memory. Any bit pattern is a valid wake event.
#[repr(C, align(64))]
struct Memory {
    notifications: AtomicU32,
    /// Number of sleeping threads. Too high after one was killed, which only costs putters a system call for each
    /// packet.
    sleepers: AtomicU32,
    /// Separates what every put writes from what getters always read.
    reserved: [u32; 14],
    /// Number of times that packets of a closed put-port were kept.
    kept: AtomicU32,
}

/// Wake event of one channel.
#[derive(Debug)]
pub(crate) struct WakeEvent {
    memory: NonNull<Memory>,
    home: Home,
}

#[derive(Debug)]
enum Home {
    Heap,
    File,
}

// SAFETY: the memory holds atomics only and lives as long as the wake event.
unsafe impl Send for WakeEvent {}
// SAFETY: as above.
unsafe impl Sync for WakeEvent {}

impl WakeEvent {
    /// Creates a wake event within this process.
    pub(crate) fn local() -> Self {
        let memory = Box::new(Memory {
            notifications: AtomicU32::new(0),
            sleepers: AtomicU32::new(0),
            reserved: [0; 14],
            kept: AtomicU32::new(0),
        });
        Self {
            memory: NonNull::from(Box::leak(memory)),
            home: Home::Heap,
        }
    }

    /// Creates the file of a wake event, for the hub. An existing file keeps its content.
    pub(crate) fn create(path: &Path) -> Result<Self, ChannelError> {
        let failed = |source| io_error(path, "create the wake event", source);
        let file = own_file(path).map_err(failed)?;
        reserve(&file, FILE_BYTES as u64).map_err(failed)?;
        Self::map(&file, path)
    }

    /// Opens a wake event that a hub has created.
    pub(crate) fn open(path: &Path) -> Result<Self, ChannelError> {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(libc::O_NOFOLLOW)
            .open(path)
            .map_err(|source| io_error(path, "open the wake event", source))?;
        Self::map(&file, path)
    }

    fn map(file: &File, path: &Path) -> Result<Self, ChannelError> {
        let length = file
            .metadata()
            .map_err(|source| io_error(path, "map the wake event", source))?
            .len();
        if length < FILE_BYTES as u64 {
            let cut = std::io::Error::other("the file is too short; restart the hub");
            return Err(io_error(path, "map the wake event", cut));
        }
        // SAFETY: a new shared mapping of a file that is long enough; the result is checked.
        let address = unsafe {
            libc::mmap(
                std::ptr::null_mut(),
                FILE_BYTES,
                libc::PROT_READ | libc::PROT_WRITE,
                libc::MAP_SHARED | libc::MAP_POPULATE,
                file.as_raw_fd(),
                0,
            )
        };
        if address == libc::MAP_FAILED {
            return Err(io_error(
                path,
                "map the wake event",
                std::io::Error::last_os_error(),
            ));
        }
        let memory = NonNull::new(address.cast::<Memory>())
            .unwrap_or_else(|| panic!("a mapping is never at address zero"));
        Ok(Self {
            memory,
            home: Home::File,
        })
    }

    fn memory(&self) -> &Memory {
        // SAFETY: valid, aligned and initialised as long as `self`.
        unsafe { self.memory.as_ref() }
    }

    /// Returns the number of notifications so far.
    pub(crate) fn notifications(&self) -> u32 {
        self.memory().notifications.load(Ordering::SeqCst)
    }

    /// Returns a number that changes when packets of a closed put-port are kept.
    pub(crate) fn kept_version(&self) -> u32 {
        self.memory().kept.load(Ordering::Acquire)
    }

    /// Announces that packets of a closed put-port are kept.
    pub(crate) fn note_kept(&self) {
        self.memory().kept.fetch_add(1, Ordering::Release);
    }

    /// Wakes all sleeping threads.
    pub(crate) fn notify(&self) {
        self.memory().notifications.fetch_add(1, Ordering::SeqCst);
        if self.memory().sleepers.load(Ordering::SeqCst) > 0 {
            // SAFETY: the address is a valid futex word.
            unsafe {
                libc::syscall(
                    libc::SYS_futex,
                    &raw const self.memory().notifications,
                    libc::FUTEX_WAKE,
                    i32::MAX,
                );
            }
        }
    }

    /// Registers a sleeper until [`WakeEvent::leave`].
    pub(crate) fn attend(&self) {
        self.memory().sleepers.fetch_add(1, Ordering::SeqCst);
    }

    /// Ends [`WakeEvent::attend`].
    pub(crate) fn leave(&self) {
        self.memory().sleepers.fetch_sub(1, Ordering::SeqCst);
    }

    /// Notifies if at least one thread sleeps or attends.
    pub(crate) fn notify_sleepers(&self) {
        if self.memory().sleepers.load(Ordering::SeqCst) > 0 {
            self.notify();
        }
    }

    /// Sleeps while the number of notifications equals `seen`, at most until `deadline`. May return early.
    pub(crate) fn sleep(&self, seen: u32, deadline: Instant) {
        let Some(left) = left(deadline) else { return };
        let time = timespec(left);
        self.memory().sleepers.fetch_add(1, Ordering::SeqCst);
        // SAFETY: a valid futex word and a valid time.
        unsafe {
            libc::syscall(
                libc::SYS_futex,
                &raw const self.memory().notifications,
                libc::FUTEX_WAIT,
                seen,
                &raw const time,
            );
        }
        self.memory().sleepers.fetch_sub(1, Ordering::SeqCst);
    }

    /// Sleeps while every wake event has the count given in `waits`, at most until `deadline`. May return early.
    ///
    /// - `waits`: from [`WakeEvent::wait`], at most [`MAX_AT_ONCE`]
    pub(crate) fn sleep_on_all<'a>(
        wake_events: impl Iterator<Item = &'a WakeEvent> + Clone,
        waits: &[FutexWait],
        deadline: Instant,
    ) {
        let Some(left) = left(deadline) else { return };
        for wake_event in wake_events.clone() {
            wake_event.memory().sleepers.fetch_add(1, Ordering::SeqCst);
        }
        let mut until = timespec(Duration::ZERO);
        // SAFETY: valid futex words and times; `waits` is at most as long as the kernel takes.
        unsafe {
            libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut until);
            let nanoseconds = until.tv_nsec + i64::from(left.subsec_nanos());
            until.tv_sec += left.as_secs().min(1 << 32) as i64 + nanoseconds / 1_000_000_000;
            until.tv_nsec = nanoseconds % 1_000_000_000;
            let failed = libc::syscall(
                libc::SYS_futex_waitv,
                waits.as_ptr(),
                waits.len(),
                0,
                &raw const until,
                libc::CLOCK_MONOTONIC,
            ) < 0;
            let refused = [libc::ENOSYS, libc::EPERM].map(Some);
            if failed && refused.contains(&std::io::Error::last_os_error().raw_os_error()) {
                // The kernel is too old, or a sandbox forbids the call: poll every millisecond.
                std::thread::sleep(left.min(Duration::from_millis(1)));
            }
        }
        for wake_event in wake_events {
            wake_event.memory().sleepers.fetch_sub(1, Ordering::SeqCst);
        }
    }

    /// Returns the arguments of the kernel for waiting on this wake event.
    pub(crate) fn wait(&self) -> FutexWait {
        FutexWait {
            value: u64::from(self.notifications()),
            address: (&raw const self.memory().notifications) as u64,
            flags: FUTEX2_SIZE_U32,
            reserved: 0,
        }
    }
}

impl Drop for WakeEvent {
    fn drop(&mut self) {
        match self.home {
            // SAFETY: it came from `Box::leak` and has no other owner.
            Home::Heap => drop(unsafe { Box::from_raw(self.memory.as_ptr()) }),
            // SAFETY: it came from `mmap` with this length.
            Home::File => unsafe {
                libc::munmap(self.memory.as_ptr().cast(), FILE_BYTES);
            },
        }
    }
}

/// `struct futex_waitv` of the kernel.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct FutexWait {
    value: u64,
    address: u64,
    flags: u32,
    reserved: u32,
}

fn left(deadline: Instant) -> Option<Duration> {
    let left = deadline.saturating_duration_since(Instant::now());
    (!left.is_zero()).then_some(left)
}

fn timespec(time: Duration) -> libc::timespec {
    libc::timespec {
        tv_sec: time.as_secs().min(1 << 32) as i64,
        tv_nsec: i64::from(time.subsec_nanos()),
    }
}

fn io_error(path: &Path, action: &'static str, source: std::io::Error) -> ChannelError {
    file_error(path, action, FILE_BYTES as u64, source)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    fn soon() -> Instant {
        Instant::now() + Duration::from_secs(20)
    }

    #[test]
    fn a_ring_between_look_and_sleep_is_not_lost() {
        let wake_event = WakeEvent::local();
        let seen = wake_event.notifications();
        wake_event.notify();
        let begun = Instant::now();
        wake_event.sleep(seen, soon());
        let waits = [FutexWait {
            value: u64::from(seen),
            ..wake_event.wait()
        }];
        WakeEvent::sleep_on_all([&wake_event].into_iter(), &waits, soon());
        assert!(begun.elapsed() < Duration::from_secs(10));
    }

    #[test]
    fn sleepers_wake_by_any_of_their_wake_events_and_by_the_deadline() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wake_event");
        WakeEvent::create(&path).unwrap();
        // Two mappings of one file, as two processes have them.
        let (own, other) = (
            WakeEvent::open(&path).unwrap(),
            WakeEvent::open(&path).unwrap(),
        );
        let quiet = WakeEvent::local();
        let own = Arc::new(own);
        let sleeper = {
            let own = own.clone();
            std::thread::spawn(move || {
                let waits = [quiet.wait(), own.wait()];
                let begun = Instant::now();
                while own.notifications() == 0 {
                    WakeEvent::sleep_on_all([&quiet, &*own].into_iter(), &waits, soon());
                }
                begun.elapsed()
            })
        };
        while own.memory().sleepers.load(Ordering::SeqCst) == 0 {
            std::thread::yield_now();
        }
        other.notify();
        assert!(sleeper.join().unwrap() < Duration::from_secs(10));
        let begun = Instant::now();
        own.sleep(own.notifications(), begun + Duration::from_millis(20));
        assert!(begun.elapsed() >= Duration::from_millis(20));
        assert_eq!(own.memory().sleepers.load(Ordering::SeqCst), 0);
    }
}
