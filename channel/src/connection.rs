//! Connections of iceoryx2 that count lost packets and can hold packets back.
//!
//! The states of two otherwise unused channels of a connection are numbers in shared memory: the sender counts packets
//! that it overwrote before they were taken, and notes its first put; the receiver sets a bit at its first look.

use std::cell::Cell;
use std::marker::PhantomData;
use std::ptr::NonNull;
use std::sync::Arc;
use std::time::Duration;

use iceoryx2::prelude::{FileName, Path};
use iceoryx2_bb_concurrency::atomic::{AtomicU64, Ordering};
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_cal::named_concept::{
    NamedConcept, NamedConceptBuilder, NamedConceptDoesExistError, NamedConceptListError,
    NamedConceptMgmt, NamedConceptPathHintRemoveError, NamedConceptRemoveError,
};
use iceoryx2_cal::shared_memory::PointerOffset;
use iceoryx2_cal::zero_copy_connection::{
    BackpressureToReceiverAction, BackpressureToReceiverFn, ChannelId, ChannelState,
    ZeroCopyConnection, ZeroCopyConnectionBuilder, ZeroCopyCreationError, ZeroCopyPortDetails,
    ZeroCopyPortRemoveError, ZeroCopyReceiveError, ZeroCopyReceiver, ZeroCopyReclaimError,
    ZeroCopyReleaseError, ZeroCopySendError, ZeroCopySender,
};

use crate::lanes::{Lane, Lanes, Link, close_lane, close_link, open_lane, open_link};

/// Bit of the counter that the receiver sets.
const SEEN: u64 = 1 << 62;
/// Value that iceoryx2 writes when it removes a dead end.
const REMOVED: u64 = u64::MAX;

/// Number of channels that connections have in addition to those of iceoryx2.
const ADDED: usize = 2;

thread_local! {
    static PUT: Cell<u64> = const { Cell::new(0) };
}

/// Sets the number of the put that this thread sends next, from 0.
pub(crate) fn set_put(number: u64) {
    PUT.set(number + 1);
}

/// Counter of a connection's lost packets, in its shared memory.
#[derive(Debug)]
pub(crate) struct LossCounter {
    memory: NonNull<AtomicU64>,
    /// Number of the first put, from 1; 0 if there was none.
    first_put: NonNull<AtomicU64>,
    last: u64,
}

// SAFETY: the memory is an atomic integer that stays mapped while the counter is registered.
unsafe impl Send for LossCounter {}

impl LossCounter {
    /// Returns the counter of a connection.
    ///
    /// # Safety
    /// It is not used after the connection's end was dropped.
    unsafe fn of(end: &impl ZeroCopyPortDetails) -> Self {
        let state = |before_last| {
            let channel = ChannelId::new(end.number_of_channels() - 1 - before_last);
            NonNull::from_ref(end.__internal_get_channel_state(channel))
        };
        Self {
            memory: state(0),
            first_put: state(1),
            last: 0,
        }
    }

    fn memory(&self) -> &AtomicU64 {
        // SAFETY: mapped, as `of` requires.
        unsafe { self.memory.as_ref() }
    }

    #[cfg(feature = "zenoh")]
    pub(crate) fn add(&self, packets: u64) {
        self.memory().fetch_add(packets, Ordering::Relaxed);
    }

    /// Returns the number of lost packets; the last one that was read if the sender has died.
    pub(crate) fn lost(&mut self) -> u64 {
        let value = self.memory().load(Ordering::Relaxed);
        if value != REMOVED {
            self.last = value & !SEEN;
        }
        self.last
    }

    /// Returns the number of the first put, from 0, if there was one and the channel has a history.
    pub(crate) fn first_put(&self) -> Option<u64> {
        // SAFETY: mapped, as `of` requires.
        let first = unsafe { self.first_put.as_ref() }.load(Ordering::SeqCst);
        (first != REMOVED).then(|| first.checked_sub(1)).flatten()
    }

    /// Returns true if the receiver has looked for packets.
    pub(crate) fn is_seen(&self) -> bool {
        self.memory().load(Ordering::Relaxed) & SEEN != 0
    }
}

/// Returns the numbers of put-port and get-port.
fn ports(name: &FileName) -> (u128, u128) {
    let name = name.to_string();
    let numbers = name
        .split_once('_')
        .and_then(|(sender, getter)| Some((sender.parse().ok()?, getter.parse().ok()?)));
    numbers.unwrap_or_else(|| panic!("iceoryx2 names connections after two ports, not `{name}`"))
}

/// A kind of connection with counters, on top of one of iceoryx2.
#[derive(Debug)]
pub struct Connection<C>(PhantomData<C>);

/// Creates a connection's ends.
#[derive(Debug)]
pub struct Builder<C: ZeroCopyConnection> {
    name: FileName,
    inner: C::Builder,
}

/// End of a put-port.
#[derive(Debug)]
pub struct Sender<C: ZeroCopyConnection> {
    link: Arc<Link>,
    inner: C::Sender,
}

/// End of a get-port.
#[derive(Debug)]
pub struct Receiver<C: ZeroCopyConnection> {
    getter: u128,
    lane: Arc<Lane>,
    lanes: Arc<Lanes>,
    inner: C::Receiver,
}

impl<C: ZeroCopyConnection> Drop for Sender<C> {
    fn drop(&mut self) {
        close_link(&self.link);
    }
}

impl<C: ZeroCopyConnection> Drop for Receiver<C> {
    fn drop(&mut self) {
        close_lane(self.getter, &self.lanes, &self.lane);
    }
}

impl<C: ZeroCopyConnection> Abandonable for Sender<C> {
    unsafe fn abandon_in_place(mut this: NonNull<Self>) {
        // SAFETY: the caller forgets `this` afterwards.
        unsafe {
            let this = this.as_mut();
            close_link(&this.link);
            C::Sender::abandon_in_place(NonNull::from_mut(&mut this.inner));
        }
    }
}

impl<C: ZeroCopyConnection> Abandonable for Receiver<C> {
    unsafe fn abandon_in_place(mut this: NonNull<Self>) {
        // SAFETY: the caller forgets `this` afterwards.
        unsafe {
            let this = this.as_mut();
            close_lane(this.getter, &this.lanes, &this.lane);
            C::Receiver::abandon_in_place(NonNull::from_mut(&mut this.inner));
        }
    }
}

macro_rules! forward_details {
    ($end:ident) => {
        impl<C: ZeroCopyConnection> NamedConcept for $end<C> {
            fn name(&self) -> &FileName {
                self.inner.name()
            }
        }

        impl<C: ZeroCopyConnection> ZeroCopyPortDetails for $end<C> {
            fn number_of_channels(&self) -> usize {
                self.inner.number_of_channels() - ADDED
            }
            fn buffer_size(&self) -> usize {
                self.inner.buffer_size()
            }
            fn has_enabled_safe_overflow(&self) -> bool {
                self.inner.has_enabled_safe_overflow()
            }
            fn max_borrowed_chunks(&self) -> usize {
                self.inner.max_borrowed_chunks()
            }
            fn max_supported_shared_memory_segments(&self) -> u8 {
                self.inner.max_supported_shared_memory_segments()
            }
            fn is_connected(&self) -> bool {
                self.inner.is_connected()
            }
            fn __internal_get_channel_state(&self, channel: ChannelId) -> &AtomicU64 {
                self.inner.__internal_get_channel_state(channel)
            }
        }
    };
}
forward_details!(Sender);
forward_details!(Receiver);

impl<C: ZeroCopyConnection> Sender<C> {
    /// Counts a packet and those that were lost for it.
    fn count(
        &self,
        sent: Result<Option<PointerOffset>, ZeroCopySendError>,
    ) -> Result<Option<PointerOffset>, ZeroCopySendError> {
        let state = |channel| {
            self.inner
                .__internal_get_channel_state(ChannelId::new(channel))
        };
        let channels = self.number_of_channels();
        if self.link.count() == 0 {
            state(channels).store(PUT.get(), Ordering::SeqCst);
        }
        if !matches!(sent, Ok(None)) {
            state(channels + 1).fetch_add(1, Ordering::Relaxed);
        }
        sent
    }
}

impl<C: ZeroCopyConnection> ZeroCopySender for Sender<C> {
    fn try_send(
        &self,
        offset: PointerOffset,
        bytes: usize,
        channel: ChannelId,
    ) -> Result<Option<PointerOffset>, ZeroCopySendError> {
        self.count(self.inner.try_send(offset, bytes, channel))
    }

    fn blocking_send<F: BackpressureToReceiverFn>(
        &self,
        offset: PointerOffset,
        bytes: usize,
        channel: ChannelId,
        handler: F,
        action: BackpressureToReceiverAction,
    ) -> Result<Option<PointerOffset>, ZeroCopySendError> {
        self.count(
            self.inner
                .blocking_send(offset, bytes, channel, handler, action),
        )
    }

    fn reclaim(&self, channel: ChannelId) -> Result<Option<PointerOffset>, ZeroCopyReclaimError> {
        self.inner.reclaim(channel)
    }

    unsafe fn acquire_used_offsets<F: FnMut(PointerOffset)>(&self, callback: F) {
        // SAFETY: as the caller promises.
        unsafe { self.inner.acquire_used_offsets(callback) }
    }
}

impl<C: ZeroCopyConnection> Receiver<C> {
    /// Tells the put-port that this end is complete: packets that it puts here arrive, also after it has closed.
    fn begin_use(&self) {
        if self.lane.begin_use() {
            let counter = ChannelId::new(self.number_of_channels() + ADDED - 1);
            let counter = self.inner.__internal_get_channel_state(counter);
            counter.fetch_or(SEEN, Ordering::SeqCst);
        }
    }
}

impl<C: ZeroCopyConnection> ZeroCopyReceiver for Receiver<C> {
    fn has_data(&self, channel: ChannelId) -> bool {
        self.begin_use();
        let has_data = self.inner.has_data(channel);
        if self.lane.is_staged() {
            self.lane.set_more(has_data);
            return false;
        }
        has_data
    }

    fn receive(&self, channel: ChannelId) -> Result<Option<PointerOffset>, ZeroCopyReceiveError> {
        self.begin_use();
        if self.lane.is_staged() {
            self.lane.set_more(self.inner.has_data(channel));
            return Ok(None);
        }
        let received = self.inner.receive(channel);
        self.lane.set_more(self.inner.has_data(channel));
        self.lane.set_held(self.inner.borrow_count(channel));
        received
    }

    fn release(
        &self,
        offset: PointerOffset,
        channel: ChannelId,
    ) -> Result<(), ZeroCopyReleaseError> {
        let released = self.inner.release(offset, channel);
        self.lane.set_held(self.inner.borrow_count(channel));
        released
    }

    fn borrow_count(&self, channel: ChannelId) -> usize {
        self.inner.borrow_count(channel)
    }
}

impl<C: ZeroCopyConnection> NamedConceptBuilder<Connection<C>> for Builder<C> {
    fn new(name: &FileName) -> Self {
        Self {
            name: *name,
            inner: C::Builder::new(name).number_of_channels(1 + ADDED),
        }
    }

    fn config(mut self, config: &C::Configuration) -> Self {
        self.inner = self.inner.config(config);
        self
    }
}

impl<C: ZeroCopyConnection> ZeroCopyConnectionBuilder<Connection<C>> for Builder<C> {
    fn buffer_size(mut self, value: usize) -> Self {
        self.inner = self.inner.buffer_size(value);
        self
    }

    fn enable_safe_overflow(mut self, value: bool) -> Self {
        self.inner = self.inner.enable_safe_overflow(value);
        self
    }

    fn receiver_max_borrowed_chunks_per_channel(mut self, value: usize) -> Self {
        self.inner = self.inner.receiver_max_borrowed_chunks_per_channel(value);
        self
    }

    fn max_supported_shared_memory_segments(mut self, value: u8) -> Self {
        self.inner = self.inner.max_supported_shared_memory_segments(value);
        self
    }

    fn number_of_chunks_per_segment(mut self, value: usize) -> Self {
        self.inner = self.inner.number_of_chunks_per_segment(value);
        self
    }

    fn number_of_channels(mut self, value: usize) -> Self {
        self.inner = self.inner.number_of_channels(value + ADDED);
        self
    }

    fn initial_channel_state(mut self, value: ChannelState) -> Self {
        self.inner = self.inner.initial_channel_state(value);
        self
    }

    fn timeout(mut self, value: Duration) -> Self {
        self.inner = self.inner.timeout(value);
        self
    }

    fn create_sender(self) -> Result<Sender<C>, ZeroCopyCreationError> {
        let (sender, getter) = ports(&self.name);
        let inner = self.inner.create_sender()?;
        let link = Arc::new(Link::new(sender, getter));
        // SAFETY: `Sender` closes the link before `inner` is dropped.
        open_link(&link, unsafe { LossCounter::of(&inner) });
        Ok(Sender { link, inner })
    }

    fn create_receiver(self) -> Result<Receiver<C>, ZeroCopyCreationError> {
        let (sender, getter) = ports(&self.name);
        let inner = self.inner.create_receiver()?;
        let lane = Arc::new(Lane::new(sender));
        // SAFETY: `Receiver` closes the lane before `inner` is dropped.
        let counter = unsafe { LossCounter::of(&inner) };
        let lanes = open_lane(getter, &lane, counter);
        Ok(Receiver {
            getter,
            lane,
            lanes,
            inner,
        })
    }
}

impl<C: ZeroCopyConnection> NamedConceptMgmt for Connection<C> {
    type Configuration = C::Configuration;

    unsafe fn remove_cfg(
        name: &FileName,
        config: &C::Configuration,
    ) -> Result<bool, NamedConceptRemoveError> {
        // SAFETY: as the caller promises.
        unsafe { C::remove_cfg(name, config) }
    }

    fn does_exist_cfg(
        name: &FileName,
        config: &C::Configuration,
    ) -> Result<bool, NamedConceptDoesExistError> {
        C::does_exist_cfg(name, config)
    }

    fn list_cfg(config: &C::Configuration) -> Result<Vec<FileName>, NamedConceptListError> {
        C::list_cfg(config)
    }

    fn remove_path_hint(value: &Path) -> Result<(), NamedConceptPathHintRemoveError> {
        C::remove_path_hint(value)
    }
}

impl<C: ZeroCopyConnection> ZeroCopyConnection for Connection<C> {
    type Sender = Sender<C>;
    type Receiver = Receiver<C>;
    type Builder = Builder<C>;

    unsafe fn remove_sender(
        name: &FileName,
        config: &C::Configuration,
    ) -> Result<(), ZeroCopyPortRemoveError> {
        // SAFETY: as the caller promises.
        unsafe { C::remove_sender(name, config) }
    }

    unsafe fn remove_receiver(
        name: &FileName,
        config: &C::Configuration,
    ) -> Result<(), ZeroCopyPortRemoveError> {
        // SAFETY: as the caller promises.
        unsafe { C::remove_receiver(name, config) }
    }

    fn does_support_safe_overflow() -> bool {
        C::does_support_safe_overflow()
    }

    fn has_configurable_buffer_size() -> bool {
        C::has_configurable_buffer_size()
    }
}
