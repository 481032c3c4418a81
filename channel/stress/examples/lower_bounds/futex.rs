//! Wake-up of another process through two futex words, without a packet: the minimum cost of any transport.

use std::fs::{File, OpenOptions};
use std::os::fd::AsRawFd;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use tactnet_channel_stress::{Client, Failure, Master};

/// Two words on separate cache lines, in a file of shared memory.
struct Words {
    there: &'static AtomicU32,
    back: &'static AtomicU32,
}

fn path(name: &str) -> PathBuf {
    PathBuf::from(format!("/dev/shm/{name}_futex"))
}

impl Words {
    fn map(file: &File) -> Result<Self, Failure> {
        // SAFETY: a new shared mapping of a page that the file has; it is never unmapped, so the references stay valid.
        unsafe {
            let page = libc::mmap(
                std::ptr::null_mut(),
                4096,
                libc::PROT_READ | libc::PROT_WRITE,
                libc::MAP_SHARED,
                file.as_raw_fd(),
                0,
            );
            if page == libc::MAP_FAILED {
                return Err(std::io::Error::last_os_error().into());
            }
            Ok(Self {
                there: &*page.cast::<AtomicU32>(),
                back: &*page.cast::<AtomicU32>().add(64),
            })
        }
    }
}

fn wake(word: &AtomicU32, value: u32) {
    word.store(value, Ordering::SeqCst);
    // SAFETY: a valid futex word.
    unsafe { libc::syscall(libc::SYS_futex, word.as_ptr(), libc::FUTEX_WAKE, i32::MAX) };
}

/// Sleeps until the word differs from `seen`, and returns it. Returns `None` after the timeout.
fn sleep(word: &AtomicU32, seen: u32, patience: Duration) -> Option<u32> {
    let time = libc::timespec {
        tv_sec: patience.as_secs() as i64,
        tv_nsec: i64::from(patience.subsec_nanos()),
    };
    for _ in 0..1000 {
        let value = word.load(Ordering::SeqCst);
        if value != seen {
            return Some(value);
        }
        // SAFETY: a valid futex word and a valid time.
        unsafe {
            libc::syscall(
                libc::SYS_futex,
                word.as_ptr(),
                libc::FUTEX_WAIT,
                seen,
                &raw const time,
            );
        }
    }
    None
}

pub(super) struct FutexMaster {
    words: Words,
    path: PathBuf,
    seen: u32,
}

impl FutexMaster {
    pub(super) fn open(name: &str) -> Result<Self, Failure> {
        let path = path(name);
        let mut options = OpenOptions::new();
        let file = options
            .read(true)
            .write(true)
            .create(true)
            .truncate(true)
            .open(&path)?;
        file.set_len(4096)?;
        Ok(Self {
            words: Words::map(&file)?,
            path,
            seen: 0,
        })
    }
}

impl Drop for FutexMaster {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

impl Master for FutexMaster {
    fn broadcast(&mut self, round: u32) -> Result<(), Failure> {
        // The word is zero before the first round.
        wake(self.words.there, round.wrapping_add(1));
        Ok(())
    }

    fn answer(&mut self, patience: Duration) -> Result<Option<u32>, Failure> {
        let found = sleep(self.words.back, self.seen, patience);
        self.seen = found.unwrap_or(self.seen);
        Ok(found.map(|word| word.wrapping_sub(1)))
    }
}

pub(super) struct FutexClient {
    words: Words,
    seen: u32,
}

impl FutexClient {
    pub(super) fn open(name: &str) -> Result<Self, Failure> {
        let file = OpenOptions::new().read(true).write(true).open(path(name))?;
        Ok(Self {
            words: Words::map(&file)?,
            seen: 0,
        })
    }
}

impl Client for FutexClient {
    fn round(&mut self, patience: Duration) -> Result<Option<u32>, Failure> {
        let found = sleep(self.words.there, self.seen, patience);
        self.seen = found.unwrap_or(self.seen);
        Ok(found.map(|word| word.wrapping_sub(1)))
    }

    fn answer(&mut self, round: u32) -> Result<(), Failure> {
        wake(self.words.back, round.wrapping_add(1));
        Ok(())
    }
}
