//! Histories: the last packets of every put-port, which a new get-port copies at once.
//!
//! A put-port lists its last packets on a board in shared memory. The transport keeps the packets themselves while they
//! are listed. A reader copies a packet and then checks that its entry is unchanged, as with a sequence lock.

use std::collections::BTreeSet;
use std::fs::File;
use std::io;
use std::os::fd::{AsRawFd, FromRawFd};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::ptr::NonNull;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering, fence};
use std::time::{Duration, Instant};

use bytemuck::Zeroable;

use crate::channel_store::ChannelStore;
use crate::kept_packets::KeptPacket;
use crate::memory_failure::{file_error, reserve};
use crate::own_file::own_file;
use crate::packet::{Block, blocks};
use crate::{ChannelConfig, ChannelError, Header};

/// Maximum time that a reader waits for a put in progress, whose client may have died.
const PATIENCE: Duration = Duration::from_secs(2);
/// Interval at which it looks again.
const LOOK: Duration = Duration::from_micros(20);

/// Begin of a board. Its entries follow.
#[repr(C, align(64))]
struct Begin {
    /// Number of puts that have begun.
    begun: AtomicU64,
    /// Number of puts that have ended.
    ended: AtomicU64,
}

/// A listed packet.
#[repr(C, align(64))]
struct Entry {
    /// Number of the put, from 1; 0 while it is written.
    put: AtomicU64,
    /// Place of its data: in the put-port's file, or the address in the process domain.
    place: AtomicU64,
    header: Header,
}

/// List of a put-port's last packets.
#[derive(Debug)]
pub(crate) struct Board {
    /// Number of the put-port.
    sender: u128,
    memory: NonNull<Begin>,
    entries: usize,
    /// Address of the put-port's file in this process; 0 in the process domain.
    base: usize,
    /// File of the board, which its put-port removes.
    file: Option<PathBuf>,
}

// SAFETY: entries are atomic or checked after reading, and the memory is valid as long as the board.
unsafe impl Send for Board {}
// SAFETY: as above.
unsafe impl Sync for Board {}

fn board_bytes(entries: usize) -> usize {
    size_of::<Begin>() + entries * size_of::<Entry>()
}

impl Board {
    /// - `path`: file to remove when the board is dropped
    fn map(
        file: &File,
        path: Option<PathBuf>,
        sender: u128,
        entries: usize,
        base: usize,
    ) -> io::Result<Self> {
        if file.metadata()?.len() < board_bytes(entries) as u64 {
            return Err(io::Error::other("the file is too short"));
        }
        // SAFETY: a new shared mapping of a file that is long enough; the result is checked.
        let address = unsafe {
            libc::mmap(
                std::ptr::null_mut(),
                board_bytes(entries),
                libc::PROT_READ | libc::PROT_WRITE,
                libc::MAP_SHARED | libc::MAP_POPULATE,
                file.as_raw_fd(),
                0,
            )
        };
        if address == libc::MAP_FAILED {
            return Err(io::Error::last_os_error());
        }
        Ok(Self {
            sender,
            memory: NonNull::new(address.cast())
                .unwrap_or_else(|| panic!("a mapping is never at address zero")),
            entries,
            base,
            file: path,
        })
    }

    fn begin(&self) -> &Begin {
        // SAFETY: valid and aligned as long as `self`; any bit pattern is valid.
        unsafe { self.memory.as_ref() }
    }

    fn entry(&self, put: u64) -> NonNull<Entry> {
        // SAFETY: the index is below `entries`, which follow the begin.
        unsafe {
            let first = self.memory.add(1).cast::<Entry>();
            first.add((put % self.entries as u64) as usize)
        }
    }

    /// Announces a put, before the transport can release the oldest listed packet. Returns its number, from 0.
    pub(crate) fn begin_put(&self) -> u64 {
        let put = self.begin().begun.fetch_add(1, Ordering::SeqCst);
        // SAFETY: valid, as above.
        unsafe { self.entry(put).as_ref() }
            .put
            .store(0, Ordering::SeqCst);
        put
    }

    /// Ends the put, and lists the packet if it was sent.
    pub(crate) fn end_put(&self, sent: Option<(&Header, NonNull<Block>)>) {
        let put = self.begin().ended.load(Ordering::Relaxed);
        if let Some((header, data)) = sent {
            let entry = self.entry(put).as_ptr();
            let place = (data.as_ptr() as usize - self.base) as u64;
            // SAFETY: valid, as above; this port alone writes, and readers check `put`.
            unsafe {
                (*entry).place.store(place, Ordering::Relaxed);
                (&raw mut (*entry).header).write_volatile(*header);
                (*entry).put.store(put + 1, Ordering::Release);
            }
        }
        self.begin().ended.store(put + 1, Ordering::SeqCst);
    }

    /// Copies the last packets that a new get-port does not have in its ring, at most `most`.
    ///
    /// - `ring`: returns the number of the first put in the ring, if there is one
    /// - `copy`: copies data at a place into a slice; returns false if it cannot
    fn read(
        &self,
        most: usize,
        packet_bytes: usize,
        ring: impl Fn() -> Option<u64>,
        copy: impl Fn(u64, &mut [Block]) -> bool,
    ) -> Vec<KeptPacket> {
        // Later puts find the reader connected, so those that have ended are in its ring if one of them is.
        let before = self.begin().begun.load(Ordering::SeqCst);
        let deadline = Instant::now() + PATIENCE;
        while self.begin().ended.load(Ordering::SeqCst) < before && Instant::now() < deadline {
            std::thread::sleep(LOOK);
        }
        let ended = self.begin().ended.load(Ordering::SeqCst);
        let most = most.min(self.entries) as u64;
        let mut past = Vec::new();
        let end = ring().map_or(ended, |first| first.min(ended));
        for put in end.saturating_sub(most)..end {
            match self.copy(put, packet_bytes, &copy) {
                Some(packet) => past.push(packet),
                // It was replaced meanwhile: a history has no gap.
                None => past.clear(),
            }
        }
        past
    }

    fn copy(
        &self,
        put: u64,
        packet_bytes: usize,
        copy: impl Fn(u64, &mut [Block]) -> bool,
    ) -> Option<KeptPacket> {
        let entry = self.entry(put).as_ptr();
        // SAFETY: valid, as above.
        let number = unsafe { &(*entry).put };
        let is_listed = || number.load(Ordering::Acquire) == put + 1;
        if !is_listed() {
            return None;
        }
        // SAFETY: valid, as above; a torn header is discarded below.
        let (place, header) = unsafe {
            (
                (*entry).place.load(Ordering::Relaxed),
                (&raw const (*entry).header).read_volatile(),
            )
        };
        fence(Ordering::Acquire);
        let bytes = usize::try_from(header.bytes).ok();
        let bytes = bytes.filter(|bytes| *bytes <= packet_bytes && is_listed())?;
        let mut data = vec![Block::zeroed(); blocks(bytes)].into_boxed_slice();
        let is_copied = copy(place, &mut data);
        fence(Ordering::Acquire);
        (is_copied && is_listed()).then_some(KeptPacket { header, data })
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        if let Some(file) = &self.file {
            // The hub may have removed it.
            let _ = std::fs::remove_file(file);
        }
        // SAFETY: it came from `mmap` with this length.
        unsafe {
            libc::munmap(self.memory.as_ptr().cast(), board_bytes(self.entries));
        }
    }
}

/// Boards of a channel's put-ports.
pub(crate) type History = ChannelStore<Arc<Board>>;

/// First part of the files' names.
const PREFIX: &str = "history_";

impl History {
    /// Creates the board of a new put-port, which [`History::remove`] removes.
    ///
    /// - `base`: address of the port's file in this process
    pub(crate) fn create(
        &self,
        sender: u128,
        base: usize,
        config: &ChannelConfig,
    ) -> Result<Arc<Board>, ChannelError> {
        let bytes = board_bytes(config.history) as u64;
        match self {
            Self::Process(boards) => {
                let create = || {
                    let file = private_memory()?;
                    reserve(&file, bytes)?;
                    Board::map(&file, None, sender, config.history, base)
                };
                let board = create()
                    .map_err(|error| file_error(Path::new("history"), "create", bytes, error))?;
                let board = Arc::new(board);
                boards.lock().push(board.clone());
                Ok(board)
            }
            Self::Host(files) => {
                let path = files.path(PREFIX, format_args!("{sender:x}"));
                let create = || {
                    let file = own_file(&path)?;
                    reserve(&file, bytes)?;
                    Board::map(&file, Some(path.clone()), sender, config.history, base)
                };
                create().map(Arc::new).map_err(|error| {
                    let _ = std::fs::remove_file(&path);
                    file_error(&path, "create", bytes, error)
                })
            }
        }
    }

    /// Removes the board of a put-port, before its packets are unmapped.
    pub(crate) fn remove(&self, board: &Arc<Board>) {
        if let Self::Process(boards) = self {
            boards.lock().retain(|other| !Arc::ptr_eq(other, board));
        }
    }

    /// Removes the boards of put-ports that were killed.
    ///
    /// - `living`: returns the numbers of all put-ports
    pub(crate) fn remove_ended(&self, living: impl FnOnce() -> BTreeSet<u128>) {
        let Self::Host(files) = self else {
            return;
        };
        let boards = files.list(PREFIX).into_iter().filter_map(|(sender, path)| {
            let sender = u128::from_str_radix(&sender, 16).ok()?;
            Some((sender, path))
        });
        let boards: Vec<_> = boards.collect();
        if boards.is_empty() {
            return;
        }
        // Ports register before they create their board.
        let living = living();
        for (_, file) in boards.iter().filter(|(sender, _)| !living.contains(sender)) {
            // Its port may have removed it.
            let _ = std::fs::remove_file(file);
        }
    }

    /// Copies the last packets of a put-port that a new get-port does not have in its ring, at most `most`.
    ///
    /// - `ring`: returns the number of the first put in the ring, if there is one
    pub(crate) fn read(
        &self,
        sender: u128,
        most: usize,
        config: &ChannelConfig,
        ring: impl Fn() -> Option<u64>,
    ) -> Vec<KeptPacket> {
        let packet_bytes = config.packet_bytes();
        match self {
            Self::Process(boards) => {
                // The lock keeps the put-port, and with it the packets.
                let boards = boards.lock();
                let Some(board) = boards.iter().find(|board| board.sender == sender) else {
                    return Vec::new();
                };
                board.read(most, packet_bytes, ring, |place, data| {
                    let from = place as usize as *const Block;
                    // SAFETY: the packet is in memory of a port that exists; torn data is discarded.
                    unsafe { std::ptr::copy(from, data.as_mut_ptr(), data.len()) };
                    true
                })
            }
            Self::Host(files) => {
                let open = || -> io::Result<_> {
                    let file = File::options()
                        .read(true)
                        .write(true)
                        .open(files.path(PREFIX, format_args!("{sender:x}")))?;
                    let board = Board::map(&file, None, sender, config.history, 0)?;
                    Ok((board, data_file(files.folder(), sender)?))
                };
                // The put-port has closed.
                let Ok((board, file)) = open() else {
                    return Vec::new();
                };
                board.read(most, packet_bytes, ring, |place, data| {
                    file.read_exact_at(bytemuck::cast_slice_mut(data), place)
                        .is_ok()
                })
            }
        }
    }
}

/// Returns a file in memory without a name.
fn private_memory() -> io::Result<File> {
    // SAFETY: a valid name.
    let file = unsafe { libc::memfd_create(c"history".as_ptr(), libc::MFD_CLOEXEC) };
    if file < 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: a new file descriptor, which only this value has.
    Ok(unsafe { File::from_raw_fd(file) })
}

/// Opens the file with a put-port's packets.
fn data_file(folder: &Path, sender: u128) -> io::Result<File> {
    let end = format!("_{sender}.data");
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().ends_with(&end) {
            return File::open(entry.path());
        }
    }
    Err(io::ErrorKind::NotFound.into())
}
