//! Reference-counted state of ports and packets, with memory from a pool of the thread.
//!
//! Iceoryx2 creates such a state for every loaned packet, each with a heap allocation and a POSIX mutex. Here freed
//! memory is kept and used again, so a packet costs no allocation. The lock is parking_lot's, which makes no system
//! call without contention.

use std::alloc::{Layout, alloc, dealloc, handle_alloc_error};
use std::cell::RefCell;
use std::fmt;
use std::marker::PhantomData;
use std::ops::Deref;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicUsize, Ordering, fence};

use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_cal::arc_sync_policy::{ArcSyncPolicy, ArcSyncPolicyCreationError, LockGuard};
use parking_lot::{ReentrantMutex, ReentrantMutexGuard};

/// Maximum number of memory blocks in a thread's pool.
const KEPT: usize = 64;

struct Pool(Vec<(Layout, NonNull<u8>)>);

impl Drop for Pool {
    fn drop(&mut self) {
        for (layout, memory) in self.0.drain(..) {
            // SAFETY: it was allocated with this layout and has no other user.
            unsafe { dealloc(memory.as_ptr(), layout) };
        }
    }
}

thread_local! {
    static POOL: RefCell<Pool> = RefCell::new(Pool(Vec::with_capacity(KEPT)));
}

/// Returns memory of `layout`, whose size must not be zero.
fn take(layout: Layout) -> NonNull<u8> {
    let kept = POOL.try_with(|pool| {
        let pool = &mut pool.borrow_mut().0;
        let found = pool.iter().rposition(|(kept, _)| *kept == layout)?;
        Some(pool.swap_remove(found).1)
    });
    kept.ok().flatten().unwrap_or_else(|| {
        // SAFETY: the layout has a size.
        let memory = unsafe { alloc(layout) };
        NonNull::new(memory).unwrap_or_else(|| handle_alloc_error(layout))
    })
}

/// Puts memory back into the pool, or frees it if the pool is full.
fn give_back(layout: Layout, memory: NonNull<u8>) {
    let kept = POOL.try_with(|pool| {
        let pool = &mut pool.borrow_mut().0;
        let room = pool.len() < KEPT;
        if room {
            pool.push((layout, memory));
        }
        room
    });
    if !kept.unwrap_or(false) {
        // SAFETY: it was allocated with this layout and has no other user.
        unsafe { dealloc(memory.as_ptr(), layout) };
    }
}

struct Counted<T> {
    owners: AtomicUsize,
    value: ReentrantMutex<T>,
}

/// A value with several owners behind a reentrant lock.
pub struct Shared<T> {
    counted: NonNull<Counted<T>>,
    owns: PhantomData<Counted<T>>,
}

// SAFETY: the count is atomic, and the value is accessible only through the lock.
unsafe impl<T: Send> Send for Shared<T> {}
// SAFETY: as above.
unsafe impl<T: Send> Sync for Shared<T> {}

impl<T> Shared<T> {
    fn counted(&self) -> &Counted<T> {
        // SAFETY: alive as long as it has owners.
        unsafe { self.counted.as_ref() }
    }
}

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        self.counted().owners.fetch_add(1, Ordering::Relaxed);
        Self { ..*self }
    }
}

impl<T> Drop for Shared<T> {
    fn drop(&mut self) {
        if self.counted().owners.fetch_sub(1, Ordering::Release) == 1 {
            fence(Ordering::Acquire);
            // SAFETY: this was the last owner.
            unsafe { self.counted.drop_in_place() };
            give_back(Layout::new::<Counted<T>>(), self.counted.cast());
        }
    }
}

impl<T> fmt::Debug for Shared<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Shared")
    }
}

/// Lock guard of the value.
pub struct Locked<'a, T>(ReentrantMutexGuard<'a, T>);

impl<T> Deref for Locked<'_, T> {
    type Target = T;
    fn deref(&self) -> &T {
        &self.0
    }
}

impl<'a, T: Send + Abandonable> LockGuard<'a, T> for Locked<'a, T> {}

impl<T: Send + Abandonable> Abandonable for Shared<T> {
    unsafe fn abandon_in_place(this: NonNull<Self>) {
        // SAFETY: the caller forgets `this` afterwards.
        let this = unsafe { &mut *this.as_ptr() };
        if this.counted().owners.load(Ordering::Acquire) == 1 {
            // SAFETY: this is the only owner; the memory stays allocated as after a crash, which the caller requires.
            unsafe {
                let value = (*this.counted.as_ptr()).value.get_mut();
                T::abandon_in_place(NonNull::from(value));
            }
        } else {
            this.counted().owners.fetch_sub(1, Ordering::Release);
        }
    }
}

impl<T: Send + Abandonable> ArcSyncPolicy<T> for Shared<T> {
    type LockGuard<'parent>
        = Locked<'parent, T>
    where
        Self: 'parent,
        T: 'parent;

    fn new(value: T) -> Result<Self, ArcSyncPolicyCreationError> {
        let counted = take(Layout::new::<Counted<T>>()).cast::<Counted<T>>();
        // SAFETY: memory of the right layout without another user.
        unsafe {
            counted.write(Counted {
                owners: AtomicUsize::new(1),
                value: ReentrantMutex::new(value),
            });
        }
        Ok(Self {
            counted,
            owns: PhantomData,
        })
    }

    fn lock(&self) -> Locked<'_, T> {
        Locked(self.counted().value.lock())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    struct Value(Arc<()>);
    impl Abandonable for Value {
        unsafe fn abandon_in_place(_: NonNull<Self>) {}
    }

    #[test]
    fn a_value_is_dropped_once_with_its_last_owner_in_whatever_thread() {
        let witness = Arc::new(());
        for _ in 0..3 {
            let shared = Shared::new(Value(witness.clone())).unwrap();
            let owners: Vec<_> = (0..8).map(|_| shared.clone()).collect();
            drop(shared);
            let threads = owners.into_iter().map(|owner| {
                std::thread::spawn(move || assert!(Arc::strong_count(&(*owner.lock()).0) > 1))
            });
            threads
                .collect::<Vec<_>>()
                .into_iter()
                .for_each(|thread| thread.join().unwrap());
            assert_eq!(Arc::strong_count(&witness), 1);
        }
    }

    #[test]
    fn memory_is_used_again() {
        let first = Shared::new(Value(Arc::default())).unwrap();
        let place = first.counted;
        drop(first);
        let second = Shared::new(Value(Arc::default())).unwrap();
        assert_eq!(second.counted, place);
        let nested = (second.lock(), second.lock());
        let [first, second] = [&*nested.0, &*nested.1];
        assert!(Arc::ptr_eq(&first.0, &second.0));
    }
}
