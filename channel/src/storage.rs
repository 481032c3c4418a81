//! Files in shared memory whose pages are allocated before anything is written to them.
//!
//! Iceoryx2's `dynamic_storage::file` only sets the length of a new file. If the memory is used up, the first write to
//! a page then kills the process by SIGBUS. The files of this module have the same layout.

use std::cell::Cell;
use std::fmt::Debug;
use std::fs::{File, OpenOptions, Permissions};
use std::io;
use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::os::fd::AsRawFd;
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use iceoryx2::prelude::{FileName, Path as IceoryxPath, ZeroCopySend};
use iceoryx2_bb_elementary::bump_allocator::BumpAllocator;
use iceoryx2_bb_elementary::package_version::PackageVersion;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_bb_posix::access_mode::AccessMode;
use iceoryx2_cal::dynamic_storage::file::Configuration;
use iceoryx2_cal::dynamic_storage::{
    DynamicStorage, DynamicStorageBuilder, DynamicStorageCreateError, DynamicStorageOpenError,
    DynamicStorageOpenOrCreateError, file,
};
use iceoryx2_cal::named_concept::{
    NamedConcept, NamedConceptBuilder, NamedConceptConfiguration, NamedConceptDoesExistError,
    NamedConceptListError, NamedConceptMgmt, NamedConceptPathHintRemoveError,
    NamedConceptRemoveError,
};

use crate::memory_failure::{MemoryFailure, reserve};

/// Interval at which an opener checks a file that another process is still creating.
const LOOK: Duration = Duration::from_millis(1);

thread_local! {
    static LAST_SEGMENT: Cell<usize> = const { Cell::new(0) };
}

/// Returns the address of the last file for packets that this thread created.
pub(crate) fn last_segment() -> usize {
    LAST_SEGMENT.get()
}

/// Content of a file: the version, which is 0 until the rest is initialised, and the value. Its heap follows.
#[repr(C)]
struct Data<T> {
    version: AtomicU64,
    value: MaybeUninit<T>,
}

/// A mapped file that holds a value and its heap.
#[derive(Debug)]
pub struct Storage<T> {
    memory: NonNull<u8>,
    bytes: usize,
    path: PathBuf,
    name: FileName,
    is_owner: AtomicBool,
    value: PhantomData<T>,
}

// SAFETY: the mapping is valid in every thread, and the value may be sent and shared.
unsafe impl<T: Send + Sync> Send for Storage<T> {}
// SAFETY: as above.
unsafe impl<T: Send + Sync> Sync for Storage<T> {}

impl<T> Storage<T> {
    fn map(file: &File, path: &Path, name: FileName, protection: i32) -> io::Result<Self> {
        let bytes = file.metadata()?.len() as usize;
        // SAFETY: a new shared mapping of an open file; the result is checked.
        let address = unsafe {
            libc::mmap(
                std::ptr::null_mut(),
                bytes,
                protection,
                libc::MAP_SHARED,
                file.as_raw_fd(),
                0,
            )
        };
        if address == libc::MAP_FAILED {
            return Err(io::Error::last_os_error());
        }
        Ok(Self {
            memory: NonNull::new(address.cast())
                .unwrap_or_else(|| panic!("a mapping is never at address zero")),
            bytes,
            path: path.into(),
            name,
            is_owner: AtomicBool::new(false),
            value: PhantomData,
        })
    }

    fn data(&self) -> NonNull<Data<T>> {
        self.memory.cast()
    }

    fn version(&self) -> &AtomicU64 {
        // SAFETY: the mapping is at least as long as `Data` and aligned to a page; any bit pattern is an integer.
        unsafe { &(*self.data().as_ptr()).version }
    }

    fn unmap(&mut self) {
        // SAFETY: it came from `mmap` with this length and is not used afterwards.
        unsafe {
            libc::munmap(self.memory.as_ptr().cast(), self.bytes);
        }
    }
}

impl<T> Drop for Storage<T> {
    fn drop(&mut self) {
        if *self.is_owner.get_mut() {
            // SAFETY: only a creator or the last user owns the file, after the value was initialised.
            unsafe { (*self.data().as_ptr()).value.assume_init_drop() };
            // Another process may have cleaned up first.
            let _ = std::fs::remove_file(&self.path);
        }
        self.unmap();
    }
}

impl<T> Abandonable for Storage<T> {
    unsafe fn abandon_in_place(mut this: NonNull<Self>) {
        // SAFETY: the caller forgets `this` afterwards.
        unsafe { this.as_mut() }.unmap();
    }
}

/// Function that initialises a value with memory from its heap.
type Initialize<'a, T> = dyn FnMut(&mut MaybeUninit<T>, &mut BumpAllocator) -> bool + 'a;

/// Creates or opens a [`Storage`].
pub struct Builder<'a, T: Send + Sync + Debug + ZeroCopySend> {
    name: FileName,
    heap_bytes: usize,
    is_owner: bool,
    config: Configuration<T>,
    timeout: Duration,
    initialize: Box<Initialize<'a, T>>,
}

impl<T: Send + Sync + Debug + ZeroCopySend> Debug for Builder<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Builder {{ {} }}", self.name)
    }
}

impl<T: Send + Sync + Debug + ZeroCopySend> Builder<'_, T> {
    fn path(&self) -> PathBuf {
        PathBuf::from(self.config.path_for(&self.name).to_string())
    }

    /// Creates the file with all its pages. It is not readable yet, which tells openers to wait.
    fn create_file(&mut self) -> Result<Storage<T>, DynamicStorageCreateError> {
        let path = self.path();
        let created = OpenOptions::new()
            .read(true)
            .write(true)
            .create_new(true)
            .mode(0o200)
            .custom_flags(libc::O_NOFOLLOW)
            .open(&path);
        let file = created.map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => DynamicStorageCreateError::AlreadyExists,
            _ => {
                MemoryFailure::note(&path, "create", 0, error);
                DynamicStorageCreateError::InternalError
            }
        })?;
        let bytes = (size_of::<Data<T>>() + self.heap_bytes) as u64;
        let failed = |action, error| {
            let _ = std::fs::remove_file(&path);
            MemoryFailure::note(&path, action, bytes, error);
            DynamicStorageCreateError::InternalError
        };
        reserve(&file, bytes).map_err(|error| failed("reserve memory for", error))?;
        let protection = libc::PROT_READ | libc::PROT_WRITE;
        let storage = Storage::map(&file, &path, self.name, protection)
            .map_err(|error| failed("map", error))?;
        if path.extension().is_some_and(|kind| kind == "data") {
            LAST_SEGMENT.set(storage.memory.as_ptr() as usize);
        }
        self.initialize(storage, &file)
    }

    fn initialize(
        &mut self,
        storage: Storage<T>,
        file: &File,
    ) -> Result<Storage<T>, DynamicStorageCreateError> {
        let heap = size_of::<Data<T>>();
        // SAFETY: the heap follows the value within the mapping.
        let start = unsafe { storage.memory.add(heap) };
        let mut allocator = BumpAllocator::new(start, storage.bytes - heap);
        // SAFETY: other processes do not use the value before the version is set.
        let value = unsafe { &mut (*storage.data().as_ptr()).value };
        if !(self.initialize)(value, &mut allocator) {
            let _ = std::fs::remove_file(&storage.path);
            return Err(DynamicStorageCreateError::InitializationFailed);
        }
        storage
            .version()
            .store(PackageVersion::get().to_u64(), Ordering::SeqCst);
        if let Err(error) = file.set_permissions(Permissions::from_mode(0o600)) {
            let _ = std::fs::remove_file(&storage.path);
            MemoryFailure::note(&storage.path, "open to other clients", 0, error);
            return Err(DynamicStorageCreateError::InternalError);
        }
        storage.is_owner.store(self.is_owner, Ordering::Relaxed);
        Ok(storage)
    }

    /// Opens the file, and waits for a process that is still creating it.
    fn open_file(&self, access: AccessMode) -> Result<Storage<T>, DynamicStorageOpenError> {
        let path = self.path();
        let deadline = Instant::now() + self.timeout;
        let protection = access.as_protflag();
        loop {
            let opened = OpenOptions::new()
                .read(true)
                .write(access != AccessMode::Read)
                .custom_flags(libc::O_NOFOLLOW)
                .open(&path);
            let failed = |action, error| {
                MemoryFailure::note(&path, action, 0, error);
                DynamicStorageOpenError::InternalError
            };
            let file = match opened {
                Ok(file) => Some(file),
                Err(error) if error.kind() == io::ErrorKind::NotFound => {
                    return Err(DynamicStorageOpenError::DoesNotExist);
                }
                // Not readable yet.
                Err(error) if error.kind() == io::ErrorKind::PermissionDenied => None,
                Err(error) => return Err(failed("open", error)),
            };
            if let Some(file) = file {
                let bytes = file
                    .metadata()
                    .map_err(|error| failed("open", error))?
                    .len();
                if bytes >= size_of::<Data<T>>() as u64 {
                    let storage = Storage::map(&file, &path, self.name, protection)
                        .map_err(|error| failed("map", error))?;
                    let version = storage.version().load(Ordering::SeqCst);
                    if version == PackageVersion::get().to_u64() {
                        return Ok(storage);
                    }
                    if version != 0 {
                        return Err(DynamicStorageOpenError::VersionMismatch);
                    }
                }
            }
            if Instant::now() >= deadline {
                return Err(DynamicStorageOpenError::InitializationNotYetFinalized);
            }
            std::thread::sleep(LOOK);
        }
    }
}

impl<T: Send + Sync + Debug + ZeroCopySend> NamedConceptBuilder<Storage<T>> for Builder<'_, T> {
    fn new(name: &FileName) -> Self {
        Self {
            name: *name,
            heap_bytes: 0,
            is_owner: true,
            config: Configuration::default(),
            timeout: Duration::ZERO,
            initialize: Box::new(|_, _| false),
        }
    }

    fn config(mut self, config: &Configuration<T>) -> Self {
        self.config = config.clone();
        self
    }
}

impl<'a, T: Send + Sync + Debug + ZeroCopySend> DynamicStorageBuilder<'a, T, Storage<T>>
    for Builder<'a, T>
{
    fn has_ownership(mut self, value: bool) -> Self {
        self.is_owner = value;
        self
    }

    fn enable_global_access(self, _: bool) -> Self {
        self
    }

    fn supplementary_size(mut self, value: usize) -> Self {
        self.heap_bytes = value;
        self
    }

    fn timeout(mut self, value: Duration) -> Self {
        self.timeout = value;
        self
    }

    fn initializer<F: FnMut(&mut MaybeUninit<T>, &mut BumpAllocator) -> bool + 'a>(
        mut self,
        value: F,
    ) -> Self {
        self.initialize = Box::new(value);
        self
    }

    fn create(mut self) -> Result<Storage<T>, DynamicStorageCreateError> {
        self.create_file()
    }

    fn open(self, access: AccessMode) -> Result<Storage<T>, DynamicStorageOpenError> {
        self.open_file(access)
    }

    fn open_or_create(mut self) -> Result<Storage<T>, DynamicStorageOpenOrCreateError> {
        loop {
            match self.open_file(AccessMode::ReadWrite) {
                Err(DynamicStorageOpenError::DoesNotExist) => {}
                opened => return Ok(opened?),
            }
            match self.create_file() {
                Err(DynamicStorageCreateError::AlreadyExists) => {}
                created => return Ok(created?),
            }
        }
    }
}

impl<T: Send + Sync + Debug + ZeroCopySend> NamedConcept for Storage<T> {
    fn name(&self) -> &FileName {
        &self.name
    }
}

impl<T: Send + Sync + Debug + ZeroCopySend> NamedConceptMgmt for Storage<T> {
    type Configuration = Configuration<T>;

    unsafe fn remove_cfg(
        name: &FileName,
        config: &Configuration<T>,
    ) -> Result<bool, NamedConceptRemoveError> {
        // SAFETY: as the caller promises.
        unsafe { file::Storage::<T>::remove_cfg(name, config) }
    }

    fn does_exist_cfg(
        name: &FileName,
        config: &Configuration<T>,
    ) -> Result<bool, NamedConceptDoesExistError> {
        file::Storage::<T>::does_exist_cfg(name, config)
    }

    fn list_cfg(config: &Configuration<T>) -> Result<Vec<FileName>, NamedConceptListError> {
        file::Storage::<T>::list_cfg(config)
    }

    fn remove_path_hint(value: &IceoryxPath) -> Result<(), NamedConceptPathHintRemoveError> {
        file::Storage::<T>::remove_path_hint(value)
    }
}

impl<T: Send + Sync + Debug + ZeroCopySend> DynamicStorage<T> for Storage<T> {
    type Builder<'a> = Builder<'a, T>;

    fn does_support_persistency() -> bool {
        true
    }

    fn has_ownership(&self) -> bool {
        self.is_owner.load(Ordering::Relaxed)
    }

    fn release_ownership(&self) {
        self.is_owner.store(false, Ordering::Relaxed);
    }

    fn acquire_ownership(&self) {
        self.is_owner.store(true, Ordering::Relaxed);
    }

    fn get(&self) -> &T {
        // SAFETY: the version shows that the value was initialised.
        unsafe { (*self.data().as_ptr()).value.assume_init_ref() }
    }

    unsafe fn __internal_set_type_name_in_config(config: &mut Configuration<T>, name: &str) {
        // SAFETY: as the caller promises.
        unsafe { file::Storage::<T>::__internal_set_type_name_in_config(config, name) }
    }
}
