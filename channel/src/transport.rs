//! Transport: iceoryx2 publishers and subscribers, in memory of the process or of the host.

use iceoryx2::port::{publisher::Publisher, subscriber::Subscriber};
use std::fmt::Debug;

use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::service::internal::ServiceInternal;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory as Channel;
use iceoryx2::unique_id_generator::unique_system_id::UniqueSystemId;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_cal::shared_memory::common::details::{AllocatorDetails, Memory};
use iceoryx2_cal::shm_allocator::bump_allocator::BumpAllocator;
use iceoryx2_cal::shm_allocator::pool_allocator::PoolAllocator;
use iceoryx2_cal::zero_copy_connection::common::details::{
    Connection as ZeroCopy, SharedManagementData,
};
use iceoryx2_cal::{
    bag, dynamic_storage, event, hash, monitoring, reactor, resizable_shared_memory, serialize,
    shared_memory, static_storage, zero_copy_connection,
};

use crate::connection::Connection;
use crate::packet::{Block, Header};
use crate::shared::Shared;
use crate::storage::Storage;

/// Memory of this process: iceoryx2's `local_threadsafe` with [`Shared`] state and counting connections.
#[derive(Debug, Clone)]
pub struct Local;

impl Service for Local {
    type StaticStorage = static_storage::recommended::Local;
    type ConfigSerializer = serialize::recommended::Recommended;
    type PersistentDynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> =
        dynamic_storage::recommended::PersistentLocal<T>;
    type Bag = bag::recommended::Recommended;
    type DynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> =
        dynamic_storage::recommended::Local<T>;
    type ServiceNameHasher = hash::recommended::Recommended;
    type SharedMemory = shared_memory::recommended::Local<PoolAllocator>;
    type ResizableSharedMemory = resizable_shared_memory::recommended::Local<PoolAllocator>;
    type Connection = Connection<zero_copy_connection::recommended::Local>;
    type Event = event::recommended::Local;
    type Monitoring = monitoring::recommended::Local;
    type Reactor = reactor::recommended::Local;
    type ArcThreadSafetyPolicy<T: Send + Debug + Abandonable> = Shared<T>;
    type BlackboardMgmt<T: Send + Sync + Debug + ZeroCopySend + 'static> =
        dynamic_storage::recommended::Local<T>;
    type BlackboardPayload = shared_memory::recommended::Local<BumpAllocator>;
    type UniqueId = UniqueSystemId;
}

impl ServiceInternal<Local> for Local {}

/// Memory of the host: iceoryx2's `ipc_threadsafe` with [`Shared`] state, counting connections, and files in a private
/// folder whose pages are allocated before they are written.
///
/// `ipc_threadsafe` itself uses named shared memory that all users can see and partly write.
#[derive(Debug, Clone)]
pub struct Ipc;

impl Service for Ipc {
    type StaticStorage = static_storage::recommended::Ipc;
    type ConfigSerializer = serialize::recommended::Recommended;
    type PersistentDynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> = Storage<T>;
    type Bag = bag::recommended::Recommended;
    type DynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> = Storage<T>;
    type ServiceNameHasher = hash::recommended::Recommended;
    type SharedMemory = Memory<PoolAllocator, Storage<AllocatorDetails<PoolAllocator>>>;
    type ResizableSharedMemory =
        resizable_shared_memory::dynamic::DynamicMemory<PoolAllocator, Self::SharedMemory>;
    type Connection = Connection<ZeroCopy<Storage<SharedManagementData>>>;
    type Event = event::recommended::Ipc;
    type Monitoring = monitoring::recommended::Ipc;
    type Reactor = reactor::recommended::Ipc;
    type ArcThreadSafetyPolicy<T: Send + Debug + Abandonable> = Shared<T>;
    type BlackboardMgmt<T: Send + Sync + Debug + ZeroCopySend + 'static> = Storage<T>;
    type BlackboardPayload = Memory<BumpAllocator, Storage<AllocatorDetails<BumpAllocator>>>;
    type UniqueId = UniqueSystemId;
}

impl ServiceInternal<Ipc> for Ipc {}

/// Value of one of the two transports.
#[derive(Debug)]
pub(crate) enum Either<L, I> {
    Process(L),
    Host(I),
}

macro_rules! both {
    ($either:expr, $name:pat => $body:expr) => {
        match $either {
            $crate::transport::Either::Process($name) => $body,
            $crate::transport::Either::Host($name) => $body,
        }
    };
}
pub(crate) use both;

pub(crate) type AnyNode = Either<Node<Local>, Node<Ipc>>;
pub(crate) type AnyChannel = Either<Channel<Local, [Block], Header>, Channel<Ipc, [Block], Header>>;
pub(crate) type AnyPublisher =
    Either<Publisher<Local, [Block], Header>, Publisher<Ipc, [Block], Header>>;
pub(crate) type AnySubscriber =
    Either<Subscriber<Local, [Block], Header>, Subscriber<Ipc, [Block], Header>>;
pub(crate) type AnyLoan =
    Either<SampleMut<Local, [Block], Header>, SampleMut<Ipc, [Block], Header>>;
pub(crate) type AnySample = Either<Sample<Local, [Block], Header>, Sample<Ipc, [Block], Header>>;
