//! How a putter wakes getters: a counter in shared memory and the kernel's futex, the condition variable of thesis section 2.3.
//!
//! A putter counts up after every packet and makes a system call only if somebody waits. A getter reads the counter, looks for packets,
//! and sleeps only while the counter is still what it read, so no wake-up can be lost. A sync group sleeps on up to 128 counters at once
//! (`futex_waitv`, Linux 5.16); larger groups sleep on the bus's own counter, which putters count up only while such a group waits.

use std::fs::{File, OpenOptions};
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use crate::ChannelError;

/// Counters that one call can sleep on (`FUTEX_WAITV_MAX`).
pub(crate) const MAX_AT_ONCE: usize = 128;
const FUTEX2_SIZE_U32: u32 = 2;
/// A page.
const FILE_BYTES: usize = 4096;

/// What lies in shared memory. Any bit pattern is a valid bell.
#[repr(C, align(64))]
struct Memory {
    rings: AtomicU32,
    /// Threads that sleep; too high after one was killed, which costs putters a system call each time and nothing else.
    sleepers: AtomicU32,
}

/// A bell of one channel.
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

// SAFETY: the memory holds atomics only and lives as long as the bell.
unsafe impl Send for WakeEvent {}
// SAFETY: as above.
unsafe impl Sync for WakeEvent {}

impl WakeEvent {
    /// Within this process.
    pub(crate) fn local() -> Self {
        let memory = Box::new(Memory {
            rings: AtomicU32::new(0),
            sleepers: AtomicU32::new(0),
        });
        Self {
            memory: NonNull::from(Box::leak(memory)),
            home: Home::Heap,
        }
    }

    /// Makes the file of a bell, for the hub, or leaves it as it is.
    pub(crate) fn create(path: &Path) -> Result<Self, ChannelError> {
        let failed = |source| io_error(path, "make the bell", source);
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(failed)?;
        reserve(&file, FILE_BYTES as u64).map_err(failed)?;
        Self::map(&file, path)
    }

    /// The bell that a hub has made.
    pub(crate) fn open(path: &Path) -> Result<Self, ChannelError> {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .open(path)
            .map_err(|source| io_error(path, "open the bell", source))?;
        Self::map(&file, path)
    }

    fn map(file: &File, path: &Path) -> Result<Self, ChannelError> {
        let length = file
            .metadata()
            .map_err(|source| io_error(path, "map the bell", source))?
            .len();
        if length < FILE_BYTES as u64 {
            let cut = std::io::Error::other("the file is too short; start the hub anew");
            return Err(io_error(path, "map the bell", cut));
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
                "map the bell",
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

    /// Number of rings so far.
    pub(crate) fn rings(&self) -> u32 {
        self.memory().rings.load(Ordering::SeqCst)
    }

    /// Tells everybody who sleeps.
    pub(crate) fn ring(&self) {
        self.memory().rings.fetch_add(1, Ordering::SeqCst);
        if self.memory().sleepers.load(Ordering::SeqCst) > 0 {
            // SAFETY: the address is a valid futex word.
            unsafe {
                libc::syscall(
                    libc::SYS_futex,
                    &raw const self.memory().rings,
                    libc::FUTEX_WAKE,
                    i32::MAX,
                );
            }
        }
    }

    /// Counts as a sleeper until [`WakeEvent::leave`].
    pub(crate) fn attend(&self) {
        self.memory().sleepers.fetch_add(1, Ordering::SeqCst);
    }

    /// The end of [`WakeEvent::attend`].
    pub(crate) fn leave(&self) {
        self.memory().sleepers.fetch_sub(1, Ordering::SeqCst);
    }

    /// Rings only if somebody sleeps or attends.
    pub(crate) fn ring_sleepers(&self) {
        if self.memory().sleepers.load(Ordering::SeqCst) > 0 {
            self.ring();
        }
    }

    /// Sleeps while the number of rings is `seen`, at most until `deadline`. May return early.
    pub(crate) fn sleep(&self, seen: u32, deadline: Instant) {
        let Some(left) = left(deadline) else { return };
        let time = timespec(left);
        self.memory().sleepers.fetch_add(1, Ordering::SeqCst);
        // SAFETY: a valid futex word and a valid time.
        unsafe {
            libc::syscall(
                libc::SYS_futex,
                &raw const self.memory().rings,
                libc::FUTEX_WAIT,
                seen,
                &raw const time,
            );
        }
        self.memory().sleepers.fetch_sub(1, Ordering::SeqCst);
    }

    /// Sleeps while every bell has rung as often as `waits` says, at most until `deadline`. May return early.
    ///
    /// - `waits`: made by [`WakeEvent::wait`], at most [`MAX_AT_ONCE`]
    pub(crate) fn sleep_on_all<'a>(
        bells: impl Iterator<Item = &'a WakeEvent> + Clone,
        waits: &[FutexWait],
        deadline: Instant,
    ) {
        let Some(left) = left(deadline) else { return };
        for bell in bells.clone() {
            bell.memory().sleepers.fetch_add(1, Ordering::SeqCst);
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
                // An old kernel, or a sandbox that knows not the call: look once a millisecond.
                std::thread::sleep(left.min(Duration::from_millis(1)));
            }
        }
        for bell in bells {
            bell.memory().sleepers.fetch_sub(1, Ordering::SeqCst);
        }
    }

    /// What the kernel is to compare.
    pub(crate) fn wait(&self) -> FutexWait {
        FutexWait {
            value: u64::from(self.rings()),
            address: (&raw const self.memory().rings) as u64,
            flags: FUTEX2_SIZE_U32,
            reserved: 0,
        }
    }
}

impl Drop for WakeEvent {
    fn drop(&mut self) {
        match self.home {
            // SAFETY: it came from `Box::leak` and nobody else has it.
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

/// Gives a file of shared memory its pages now, so that a full disk is an error here and no signal later.
pub(crate) fn reserve(file: &File, bytes: u64) -> std::io::Result<()> {
    // SAFETY: a plain call with a valid descriptor.
    match unsafe { libc::posix_fallocate(file.as_raw_fd(), 0, bytes as i64) } {
        0 => Ok(()),
        libc::EINTR => reserve(file, bytes),
        error => Err(std::io::Error::from_raw_os_error(error)),
    }
}

fn io_error(path: &Path, action: &'static str, source: std::io::Error) -> ChannelError {
    ChannelError::Io {
        path: PathBuf::from(path),
        action,
        source,
    }
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
        let bell = WakeEvent::local();
        let seen = bell.rings();
        bell.ring();
        let begun = Instant::now();
        bell.sleep(seen, soon());
        let waits = [FutexWait {
            value: u64::from(seen),
            ..bell.wait()
        }];
        WakeEvent::sleep_on_all([&bell].into_iter(), &waits, soon());
        assert!(begun.elapsed() < Duration::from_secs(10));
    }

    #[test]
    fn sleepers_wake_by_any_of_their_bells_and_by_the_deadline() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bell");
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
                while own.rings() == 0 {
                    WakeEvent::sleep_on_all([&quiet, &*own].into_iter(), &waits, soon());
                }
                begun.elapsed()
            })
        };
        while own.memory().sleepers.load(Ordering::SeqCst) == 0 {
            std::thread::yield_now();
        }
        other.ring();
        assert!(sleeper.join().unwrap() < Duration::from_secs(10));
        let begun = Instant::now();
        own.sleep(own.rings(), begun + Duration::from_millis(20));
        assert!(begun.elapsed() >= Duration::from_millis(20));
        assert_eq!(own.memory().sleepers.load(Ordering::SeqCst), 0);
    }
}
