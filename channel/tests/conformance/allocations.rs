//! Calls on packets neither allocate nor start threads.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::time::Duration;

use tactnet_channel::{ChannelConfig, Priority, Start, Wait};

use crate::world::World;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: the system's allocator with a counter.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn threads() -> usize {
    std::fs::read_dir("/proc/self/task").unwrap().count()
}

fn packet_functions_do_not_allocate(world: &World) {
    let channel = ChannelConfig {
        get_ports: 2,
        ..ChannelConfig::of::<f32>(16)
    };
    let ends = world.with(&[("a", channel.clone()), ("b", channel)]);
    let a = ends.near.put_port::<f32>("a", Priority::Normal).unwrap();
    let get_a = ends.far.get_port::<f32>("a", Start::Now).unwrap();
    let get_b = ends.far.get_port::<f32>("b", Start::Now).unwrap();
    let mut group = ends.far.sync_group(&[&get_a, &get_b]).unwrap();
    let wait = Wait::Block {
        timeout: Duration::from_micros(50),
    };
    let round = |group: &mut tactnet_channel::SyncGroup| {
        let mut packet = a.loan(16).unwrap();
        packet[3] = 1.5;
        a.put(packet).unwrap();
        assert_eq!(group.wait(wait).unwrap(), Some(0));
        assert_eq!(get_a.get(wait).unwrap().unwrap()[3], 1.5);
        assert!(get_b.try_get().unwrap().is_none());
        assert!(get_b.get(wait).unwrap().is_none(), "this one slept");
        assert!(group.wait(wait).unwrap().is_none(), "and this one");
    };
    // The first packet connects the ports.
    round(&mut group);
    let before = ALLOCATIONS.get();
    for _ in 0..200 {
        round(&mut group);
    }
    assert_eq!(ALLOCATIONS.get(), before);
}

#[test]
fn in_the_process_domain() {
    packet_functions_do_not_allocate(&World::process());
}

#[test]
fn on_a_host() {
    packet_functions_do_not_allocate(&World::host());
}

#[test]
fn a_client_has_no_thread_of_its_own() {
    // Other tests start and end threads in this process, so the test runs in a separate one.
    let me = std::env::current_exe().unwrap();
    if std::env::var_os("ALONE").is_none() {
        let alone = std::process::Command::new(me)
            .args([
                "--exact",
                "allocations::a_client_has_no_thread_of_its_own",
                "--test-threads=1",
            ])
            .env("ALONE", "1")
            .status();
        assert!(alone.unwrap().success());
        return;
    }
    let before = threads();
    let ends = World::process().with(&[("a", ChannelConfig::of::<u8>(1))]);
    let put = ends.near.put_port::<u8>("a", Priority::Normal).unwrap();
    let get = ends.near.get_port::<u8>("a", Start::Now).unwrap();
    put.put_copy(&[1]).unwrap();
    assert_eq!(get.get(Wait::Spin).unwrap().unwrap()[0], 1);
    assert_eq!(threads(), before);
}
